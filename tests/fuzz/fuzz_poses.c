/* Ground truth files in the three layouts, asked for at their own stamps. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "../../drivers/recorded/poses.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void ask(struct fv_poses *poses)
{
    double T[12];
    for (size_t i = 0; i < poses->count; i++) {
        const int64_t stamp_ns = poses->by_stamp != NULL ? poses->by_stamp[i].stamp_ns : 0;
        if (!fv_poses_at(poses, stamp_ns, i, T)) abort();
        fv_poses_at(poses, (int64_t)((uint64_t)stamp_ns + 1000), i + 1, T);
    }
    fv_poses_free(poses);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    char path[64];
    struct fv_poses poses;
    struct fovea_error error = {.text = ""};
    const int file = memfd_create("poses", 0);
    if (file < 0 || write(file, data, bytes) != (ssize_t)bytes) abort();
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    if (fv_poses_read(path, FV_POSES_EUROC, identity, &poses, &error) == FOVEA_OK) ask(&poses);
    if (fv_poses_read(path, FV_POSES_TUM, identity, &poses, &error) == FOVEA_OK) ask(&poses);
    if (fv_poses_read_kitti(path, &poses, &error) == FOVEA_OK) ask(&poses);
    close(file);
    return 0;
}
