#include "features/scale_space.h"

#include "base/elementary.h"

void fv_scale_gauss_make(struct fv_scale_gauss *gauss, double sigma)
{
    double exact[FV_SCALE_RADIUS_MAX + 1], sum = 0;
    int32_t radius = (int32_t)(4 * sigma + .5), left = 65536;
    if (radius > FV_SCALE_RADIUS_MAX) radius = FV_SCALE_RADIUS_MAX;
    for (int32_t i = 0; i <= radius; i++) {
        exact[i] = fv_exp(-i * i / (2 * sigma * sigma));
        sum += i > 0 ? 2 * exact[i] : exact[i];
    }
    gauss->radius = radius;
    for (int32_t i = radius; i > 0; i--) {
        gauss->weights[i] = (uint16_t)(65536 * exact[i] / sum + .5);
        left -= 2 * gauss->weights[i];
    }
    gauss->weights[0] = (uint16_t)left;
}

/* Blur from one sigma to another, in the same pixels. */
static void gauss_between(struct fv_scale_gauss *gauss, double from, double to)
{
    fv_scale_gauss_make(gauss, __builtin_sqrt(to * to - from * from));
}

void fv_scale_space_carve(struct fv_scale_space *space, int32_t width, int32_t height, bool doubled,
                          uint32_t most, struct fv_arena *arena)
{
    const int32_t times = doubled ? 2 : 1;
    space->doubled = doubled;
    space->octaves = 0;
    gauss_between(&space->first, .5 * times, FV_SCALE_SIGMA); /* a camera blurs by half a pixel */
    for (int32_t l = 1; l < FV_SCALE_LEVELS; l++)
        gauss_between(&space->step[l],
                      FV_SCALE_SIGMA * fv_pow(2, (double)(l - 1) / FV_SCALE_LAYERS),
                      FV_SCALE_SIGMA * fv_pow(2, (double)l / FV_SCALE_LAYERS));
    width *= times;
    height *= times;
    space->row = fv_arena_take_raw(arena, (size_t)fv_scale_stride(width) + 2 * FV_SCALE_PAD,
                                   sizeof *space->row);
    while (space->octaves < FV_SCALE_OCTAVES_MAX && space->octaves < most &&
           width >= FV_SCALE_SIDE_MIN && height >= FV_SCALE_SIDE_MIN) {
        struct fv_scale_octave *octave = &space->octave[space->octaves++];
        octave->width = width;
        octave->height = height;
        octave->stride = fv_scale_stride(width);
        for (int l = 0; l < FV_SCALE_LEVELS; l++)
            octave->level[l] = fv_arena_take(arena, (size_t)octave->stride * (size_t)height,
                                             sizeof *octave->level[l]);
        width /= 2;
        height /= 2;
    }
}

static void blur(const struct fv_scale_space *space, const struct fv_kernels *kernels,
                 const struct fv_scale_gauss *gauss, const struct fv_scale_octave *octave,
                 int32_t from, int32_t to)
{
    const int32_t last = octave->height - 1;
    for (int32_t y = 0; y <= last; y++) {
        const uint16_t *rows[2 * FV_SCALE_RADIUS_MAX + 1];
        for (int32_t i = -gauss->radius; i <= gauss->radius; i++) {
            int32_t at = y + i < 0 ? -(y + i) : y + i;
            if (at > last) at = 2 * last - at;
            rows[gauss->radius + i] = fv_scale_row(octave, from, at);
        }
        kernels->scale_blur_row_u16(octave->level[to] + (int64_t)y * octave->stride, rows,
                                    octave->width, gauss->weights, gauss->radius, space->row);
    }
}

/* The image in 1/128 grey level. */
static void take_image(const struct fv_scale_octave *octave, int32_t level,
                       const struct fv_plane *image)
{
    for (int32_t y = 0; y < octave->height; y++) {
        const uint8_t *in = fv_plane_row(image, y);
        uint16_t *out = octave->level[level] + (int64_t)y * octave->stride;
        for (int32_t x = 0; x < octave->width; x++)
            out[x] = (uint16_t)(in[x] * 128);
    }
}

/* The image at twice its size, bilinear: pixels lie a quarter of a pixel beside those of the image,
 * which smooths all of them alike. The border is repeated. */
static void take_doubled(const struct fv_scale_octave *octave, int32_t level,
                         const struct fv_plane *image)
{
    const int32_t last = image->width - 1;
    for (int32_t y = 0; y < octave->height; y++) {
        const int32_t beside = y / 2 + (y & 1 ? 1 : -1);
        const int32_t far = beside < 0 ? 0 : beside < image->height ? beside : image->height - 1;
        const uint8_t *a = fv_plane_row(image, y / 2), *b = fv_plane_row(image, far);
        uint16_t *restrict out = octave->level[level] + (int64_t)y * octave->stride;
        out[0] = (uint16_t)(32 * (3 * a[0] + b[0]));
        for (int32_t x = 0; x < last; x++) {
            const int32_t left = 3 * a[x] + b[x], right = 3 * a[x + 1] + b[x + 1];
            out[2 * x + 1] = (uint16_t)(8 * (3 * left + right));
            out[2 * x + 2] = (uint16_t)(8 * (left + 3 * right));
        }
        out[2 * last + 1] = (uint16_t)(32 * (3 * a[last] + b[last]));
    }
}

static void halve(const struct fv_scale_octave *from, int32_t level,
                  const struct fv_scale_octave *to)
{
    for (int32_t y = 0; y < to->height; y++) {
        const uint16_t *in = fv_scale_row(from, level, 2 * y);
        uint16_t *restrict out = to->level[0] + (int64_t)y * to->stride;
        for (int32_t x = 0; x < to->width; x++)
            out[x] = in[2 * x];
    }
}

void fv_scale_space_build(struct fv_scale_space *space, const struct fv_kernels *kernels,
                          const struct fv_plane *image)
{
    for (uint32_t i = 0; i < space->octaves; i++) {
        const struct fv_scale_octave *octave = &space->octave[i];
        if (i > 0) {
            halve(&space->octave[i - 1], FV_SCALE_LAYERS, octave);
        } else { /* level 1 holds the image until level 0 is made */
            (space->doubled ? take_doubled : take_image)(octave, 1, image);
            blur(space, kernels, &space->first, octave, 1, 0);
        }
        for (int32_t l = 1; l < FV_SCALE_LEVELS; l++)
            blur(space, kernels, &space->step[l], octave, l - 1, l);
    }
}

double fv_scale_pixel(const struct fv_scale_space *space, uint32_t octave)
{
    return (double)(1u << octave) * (space->doubled ? .5 : 1);
}

double fv_scale_in_image(const struct fv_scale_space *space, uint32_t octave, double at)
{
    return at * fv_scale_pixel(space, octave) - (space->doubled ? .25 : 0);
}
