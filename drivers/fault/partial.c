/* A transfer that broke off: from a row on that each picture draws, between an eighth and seven
 * eighths of its height, the buffer still holds the last good picture. */
#include <string.h>

#include "fault.h"

#include "base/elementary.h"

void fv_fault_partial(struct fv_fault_picture *picture)
{
    const size_t row = (size_t)picture->width * (size_t)picture->channels;
    const uint32_t eighth = (uint32_t)picture->height / 8;
    struct fv_random random;
    fv_random_seed(&random, picture->seed ^ 0x9A27u);
    const size_t from = eighth + fv_random_below(&random, 6 * eighth + 1);
    memcpy(picture->pixels + from * row, picture->last + from * row,
           ((size_t)picture->height - from) * row);
}
