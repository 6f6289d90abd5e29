#include "support/folder.h"

#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

int fv_folder_open_file(int folder, const char *name, struct stat *there)
{
    const int opened =
        openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (opened < 0) return -1;
    if (fstat(opened, there) == 0 && S_ISREG(there->st_mode)) return opened;
    close(opened);
    errno = EINVAL;
    return -1;
}
