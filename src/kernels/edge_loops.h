/* Kernels of contracts/edge.h, which compilers vectorise well: the C variants, which edge_avx2.c
 * and edge_avx512.c compile again for their instruction sets. FV_NAME(kernel) makes the function's
 * name. */
#include <string.h>

#include "kernels/kernels.h"

/* Columns beside the first and the last one. */
static inline int32_t before_first(int32_t repeat)
{
    return repeat ? 0 : 1;
}

static inline int32_t after_last(int32_t width, int32_t repeat)
{
    return repeat ? width - 1 : width - 2;
}

static inline int16_t derivative_x(const uint8_t *a, const uint8_t *b, const uint8_t *c,
                                   int32_t left, int32_t right, int32_t side, int32_t centre)
{
    return (int16_t)(side * (a[right] - a[left] + (c[right] - c[left])) +
                     centre * (b[right] - b[left]));
}

/* The compiler makes one of it for each pair of weights. */
static inline void derivative_x_row(int16_t *restrict out, const uint8_t *const *rows,
                                    int32_t width, int32_t side, int32_t centre, int32_t repeat)
{
    const uint8_t *a = rows[0], *b = rows[1], *c = rows[2];
    for (int32_t x = 1; x < width - 1; x++)
        out[x] = derivative_x(a, b, c, x - 1, x + 1, side, centre);
    out[0] = derivative_x(a, b, c, before_first(repeat), 1, side, centre);
    out[width - 1] = derivative_x(a, b, c, width - 2, after_last(width, repeat), side, centre);
}

void FV_NAME(derivative_x_row_s16)(int16_t *out, const uint8_t *const *rows, int32_t width,
                                   int32_t side, int32_t centre, int32_t repeat)
{
    if (side == 1 && centre == 2)
        derivative_x_row(out, rows, width, 1, 2, repeat);
    else if (side == 3 && centre == 10)
        derivative_x_row(out, rows, width, 3, 10, repeat);
    else
        derivative_x_row(out, rows, width, side, centre, repeat);
}

static inline int16_t derivative_y(const uint8_t *a, const uint8_t *c, int32_t left, int32_t x,
                                   int32_t right, int32_t side, int32_t centre)
{
    return (int16_t)(side * (c[left] - a[left] + (c[right] - a[right])) + centre * (c[x] - a[x]));
}

static inline void derivative_y_row(int16_t *restrict out, const uint8_t *const *rows,
                                    int32_t width, int32_t side, int32_t centre, int32_t repeat)
{
    const uint8_t *a = rows[0], *c = rows[2];
    for (int32_t x = 1; x < width - 1; x++)
        out[x] = derivative_y(a, c, x - 1, x, x + 1, side, centre);
    out[0] = derivative_y(a, c, before_first(repeat), 0, 1, side, centre);
    out[width - 1] =
        derivative_y(a, c, width - 2, width - 1, after_last(width, repeat), side, centre);
}

void FV_NAME(derivative_y_row_s16)(int16_t *out, const uint8_t *const *rows, int32_t width,
                                   int32_t side, int32_t centre, int32_t repeat)
{
    if (side == 1 && centre == 2)
        derivative_y_row(out, rows, width, 1, 2, repeat);
    else if (side == 3 && centre == 10)
        derivative_y_row(out, rows, width, 3, 10, repeat);
    else
        derivative_y_row(out, rows, width, side, centre, repeat);
}

static inline int16_t laplacian(const uint8_t *a, const uint8_t *b, const uint8_t *c, int32_t left,
                                int32_t x, int32_t right, int32_t corners)
{
    return (int16_t)(corners ? 2 * (a[left] + a[right] + (c[left] + c[right])) - 8 * b[x]
                             : a[x] + c[x] + (b[left] + b[right]) - 4 * b[x]);
}

static inline void laplacian_row(int16_t *restrict out, const uint8_t *const *rows, int32_t width,
                                 int32_t corners)
{
    const uint8_t *a = rows[0], *b = rows[1], *c = rows[2];
    for (int32_t x = 1; x < width - 1; x++)
        out[x] = laplacian(a, b, c, x - 1, x, x + 1, corners);
    out[0] = laplacian(a, b, c, 1, 0, 1, corners);
    out[width - 1] = laplacian(a, b, c, width - 2, width - 1, width - 2, corners);
}

void FV_NAME(laplacian_row_s16)(int16_t *out, const uint8_t *const *rows, int32_t width,
                                int32_t corners)
{
    if (corners)
        laplacian_row(out, rows, width, 1);
    else
        laplacian_row(out, rows, width, 0);
}

static inline int32_t magnitude_of(int32_t value)
{
    return value < 0 ? -value : value;
}

void FV_NAME(magnitude_row_s32)(int32_t *restrict out, const int16_t *dx, const int16_t *dy,
                                int32_t width, int32_t squared)
{
    if (squared)
        for (int32_t x = 0; x < width; x++)
            out[x] = dx[x] * dx[x] + dy[x] * dy[x];
    else
        for (int32_t x = 0; x < width; x++)
            out[x] = magnitude_of(dx[x]) + magnitude_of(dy[x]);
}

/* 1 where a pixel stays, 3 where it is strong as well. */
static inline void thin(uint8_t *restrict flags, const int32_t *const *magnitude, const int16_t *dx,
                        const int16_t *dy, int32_t first, int32_t count, int32_t low, int32_t high)
{
    const int32_t *above = magnitude[0] + first, *row = magnitude[1] + first;
    const int32_t *below = magnitude[2] + first;
    for (int32_t x = 0; x < count; x++) {
        const int32_t gx = dx[first + x], gy = dy[first + x], v = row[x];
        const int32_t across = magnitude_of(gx), down = magnitude_of(gy) * 32768;
        const int32_t t = 13573 * across;
        const int32_t flat = down<t, steep = down> t + 65536 * across, mixed = (gx ^ gy) < 0;
        const int32_t left = row[x - 1], right = row[x + 1], up = above[x], under = below[x];
        const int32_t up_left = above[x - 1], up_right = above[x + 1];
        const int32_t under_left = below[x - 1], under_right = below[x + 1];
        const int32_t diagonal_up = mixed ? up_right : up_left;
        const int32_t diagonal_under = mixed ? under_left : under_right;
        const int32_t a = flat ? left : steep ? up : diagonal_up;
        const int32_t b = flat ? right : steep ? under : diagonal_under;
        const int32_t stays = (v > low) & (v > a) & (v + (flat | steep) > b);
        flags[x] = (uint8_t)(stays * (v > high ? 3 : 1));
    }
}

/* The lowest bit of each of 64 bytes, shifted right by `bit`; the first byte's comes highest. */
static inline uint64_t packed(const uint8_t flags[64], int bit)
{
    uint64_t bits = 0;
    for (int i = 0; i < 8; i++) {
        uint64_t eight;
        memcpy(&eight, flags + 8 * i, sizeof eight);
        bits = bits << 8 | ((eight >> bit & 0x0101010101010101u) * 0x8040201008040201u) >> 56;
    }
    return bits;
}

void FV_NAME(thin_row_s32)(uint64_t *weak, uint64_t *strong, const int32_t *const *magnitude,
                           const int16_t *dx, const int16_t *dy, int32_t width, int32_t low,
                           int32_t high)
{
    uint8_t flags[64];
    for (int32_t x = 0; x < width; x += 64) {
        if (width - x >= 64) {
            thin(flags, magnitude, dx, dy, x, 64, low, high);
        } else {
            memset(flags, 0, sizeof flags);
            thin(flags, magnitude, dx, dy, x, width - x, low, high);
        }
        weak[x / 64] = packed(flags, 0);
        strong[x / 64] = packed(flags, 1);
    }
}
