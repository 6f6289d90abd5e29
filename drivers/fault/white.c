/* Dazzled: every pixel is at its end. */
#include <string.h>

#include "fault.h"

void fv_fault_white(struct fv_fault_picture *picture)
{
    memset(picture->pixels, 255,
           (size_t)picture->width * (size_t)picture->height * (size_t)picture->channels);
}
