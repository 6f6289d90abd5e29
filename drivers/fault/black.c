/* A covered lens, or no light: one level everywhere. */
#include <string.h>

#include "fault.h"

void fv_fault_black(struct fv_fault_picture *picture)
{
    memset(picture->pixels, picture->options->level,
           (size_t)picture->width * (size_t)picture->height * (size_t)picture->channels);
}
