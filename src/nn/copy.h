/* Copies of a few bytes, of which operators make many: a call of memmove for each costs more than
 * the bytes. */
#ifndef FOVEA_NN_COPY_H
#define FOVEA_NN_COPY_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* What a vector register holds, in a type that compilers keep in one. */
typedef uint8_t fv_nn_bytes16 __attribute__((vector_size(16)));

#define FV_NN_LOAD(type, name, from)                                                               \
    type name;                                                                                     \
    memcpy(&name, from, sizeof name)

/* As memmove: all is read before it is written. What is not a power of two is copied in parts that
 * overlap. */
static inline void fv_nn_copy(uint8_t *to, const uint8_t *from, size_t bytes)
{
    if (bytes > 64 || bytes < 4) {
        memmove(to, from, bytes);
    } else if (bytes > 16) {
        FV_NN_LOAD(fv_nn_bytes16, first, from);
        FV_NN_LOAD(fv_nn_bytes16, last, from + bytes - 16);
        if (bytes > 32) {
            FV_NN_LOAD(fv_nn_bytes16, second, from + 16);
            FV_NN_LOAD(fv_nn_bytes16, third, from + bytes - 32);
            memcpy(to + 16, &second, 16);
            memcpy(to + bytes - 32, &third, 16);
        }
        memcpy(to, &first, 16);
        memcpy(to + bytes - 16, &last, 16);
    } else if (bytes >= 8) {
        FV_NN_LOAD(uint64_t, first, from);
        FV_NN_LOAD(uint64_t, last, from + bytes - 8);
        memcpy(to, &first, 8);
        memcpy(to + bytes - 8, &last, 8);
    } else {
        FV_NN_LOAD(uint32_t, first, from);
        FV_NN_LOAD(uint32_t, last, from + bytes - 4);
        memcpy(to, &first, 4);
        memcpy(to + bytes - 4, &last, 4);
    }
}

/* Copy in pieces of 16 bytes: up to 15 bytes past the end are read and written, so that no length
 * is asked for. Of runs that follow each other, in their order, or where there is slack. */
static inline void fv_nn_copy_pieces(uint8_t *to, const uint8_t *from, int32_t bytes)
{
    for (int32_t i = 0; i < bytes; i += 16)
        memcpy(to + i, from + i, 16);
}

/* Likewise one value. */
static inline void fv_nn_fill_pieces(uint8_t *to, uint8_t value, ptrdiff_t bytes)
{
    uint8_t piece[16];
    memset(piece, value, sizeof piece);
    for (ptrdiff_t i = 0; i < bytes; i += 16)
        memcpy(to + i, piece, 16);
}

#endif
