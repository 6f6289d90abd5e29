#include "bounds/pictures.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/table.h"
#include "fovea/source.h"

static void keep(uint8_t *to, const struct fovea_image *image)
{
    for (int32_t y = 0; y < image->height && to != NULL; y++)
        memcpy(to + (size_t)y * (size_t)image->width,
               image->data + (size_t)y * (size_t)image->stride_bytes, (size_t)image->width);
}

void film_render(struct film *film, const char *uri, int start, int step, int count)
{
    const struct fovea_source_selection selection = {
        .start = (uint64_t)start, .step = (uint64_t)step, .frames = (uint64_t)count};
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_error error;
    struct fovea_frame frame;
    const char *address;
    if (fv_source_find(uri, &ops, &address, &error) ||
        ops->open(address, &selection, &source, &error) || ops->start(source, &error)) {
        fprintf(stderr, "%s\n", error.text);
        exit(2);
    }
    *film = (struct film){.camera = ops->info(source)->rig.cameras[0].camera};
    film->width = film->camera.width;
    film->height = film->camera.height;
    const size_t bytes = (size_t)film->width * (size_t)film->height;
    film->pixels = malloc(bytes * (size_t)count);
    if (ops->info(source)->rig.camera_count > 1) film->seconds = malloc(bytes * (size_t)count);
    if (ops->info(source)->rig.has_imu)
        film->samples = calloc((size_t)count, sizeof *film->samples);
    while (film->count < count && ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        keep(film->pixels + bytes * (size_t)film->count, &frame.images[0]);
        if (film->seconds != NULL)
            keep(film->seconds + bytes * (size_t)film->count, &frame.images[1]);
        if (film->samples != NULL) {
            struct film_samples *samples = &film->samples[film->count];
            samples->stamp_ns = frame.stamp_ns;
            samples->count = ops->samples(source, &frame, samples->list, FOVEA_INPUT_SAMPLES_MAX);
        }
        film->count++;
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
}

void film_free(struct film *film)
{
    free(film->samples);
    free(film->seconds);
    free(film->pixels);
}

static size_t bytes_of(const struct film *film)
{
    return (size_t)film->width * (size_t)film->height;
}

void picture_film(uint8_t *pixels, const struct film *film, int n)
{
    memcpy(pixels, film->pixels + bytes_of(film) * (size_t)(n % film->count), bytes_of(film));
}

static uint8_t noise_at(uint32_t x, uint32_t y, uint32_t seed)
{
    uint32_t h = x * 2654435761u ^ (y + 1) * 2246822519u ^ seed * 3266489917u;
    h ^= h >> 15;
    h *= 2654435769u;
    return (uint8_t)(h >> 24);
}

static void draw(uint8_t *pixels, const struct film *film, uint32_t left, uint32_t tile,
                 uint32_t seed)
{
    for (int32_t y = 0; y < film->height; y++)
        for (int32_t x = 0; x < film->width; x++)
            pixels[(size_t)y * (size_t)film->width + (size_t)x] =
                noise_at(((uint32_t)x + left) % tile, (uint32_t)y % tile, seed);
}

void picture_noise(uint8_t *pixels, const struct film *film, int n)
{
    draw(pixels, film, 0, UINT32_MAX, (uint32_t)n);
}

void picture_drifting(uint8_t *pixels, const struct film *film, int n)
{
    draw(pixels, film, (uint32_t)n * 2, UINT32_MAX, 1);
}

void picture_tiles(uint8_t *pixels, const struct film *film, int n)
{
    draw(pixels, film, (uint32_t)n * 2, 32, 1);
}

void picture_chequer(uint8_t *pixels, const struct film *film, int n)
{
    for (int32_t y = 0; y < film->height; y++)
        for (int32_t x = 0; x < film->width; x++)
            pixels[(size_t)y * (size_t)film->width + (size_t)x] =
                ((x + n) / 3 + y / 3) % 2 ? 230 : 20;
}

void picture_dots(uint8_t *pixels, const struct film *film, int n)
{
    for (int32_t y = 0; y < film->height; y++)
        for (int32_t x = 0; x < film->width; x++)
            pixels[(size_t)y * (size_t)film->width + (size_t)x] =
                (x + n) % 4 < 2 && y % 4 < 2 ? 255 : 0;
}

void picture_window(uint8_t *pixels, const struct film *film, int n)
{
    const int32_t side = film->height / 4, left = (film->width - side) / 2,
                  top = (film->height - side) / 2;
    const uint8_t *from = film->pixels + bytes_of(film) * (size_t)(n % film->count);
    memset(pixels, 128, bytes_of(film));
    for (int32_t y = top; y < top + side; y++)
        memcpy(pixels + (size_t)y * (size_t)film->width + left,
               from + (size_t)y * (size_t)film->width + left, (size_t)side);
}

void picture_blinks(uint8_t *pixels, const struct film *film, int n)
{
    if (n < film->count - film->count / 6)
        picture_film(pixels, film, n);
    else
        memset(pixels, 128, bytes_of(film));
}

void picture_kidnapped(uint8_t *pixels, const struct film *film, int n)
{
    enum { STAY = 12, NOISY = 3 };
    const int half = film->count / 2;
    if (n < half) /* a map first */
        picture_film(pixels, film, n);
    else if (n % STAY < NOISY)
        picture_noise(pixels, film, n);
    else
        picture_film(pixels, film, (n / STAY * 37 + n % STAY) % film->count);
}
