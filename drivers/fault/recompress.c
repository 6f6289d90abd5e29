/* What JPEG at a low quality does to a picture: blocks of 8 x 8 whose cosine transform is rounded
 * to the steps of the standard's table for luminance (ITU-T T.81, table K.1), scaled by the quality
 * as the Independent JPEG Group's library scales it. Channels of colour are each treated as grey.
 * Where the picture ends within a block, the block goes on with the last pixels. */
#include "fault.h"

#include "base/elementary.h"

enum { SIZE = 8, BLOCK = SIZE * SIZE };

static const uint8_t luminance[BLOCK] = {
    16, 11, 10, 16, 24,  40,  51,  61,  12, 12, 14, 19, 26,  58,  60,  55,
    14, 13, 16, 24, 40,  57,  69,  56,  14, 17, 22, 29, 51,  87,  80,  62,
    18, 22, 37, 56, 68,  109, 103, 77,  24, 35, 55, 64, 81,  104, 113, 92,
    49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99};

struct tables {
    double cosine[SIZE][SIZE]; /* [frequency][place], orthonormal */
    double step[BLOCK];
};

static void tables_make(int32_t quality, struct tables *tables)
{
    const int32_t percent = quality < 50 ? 5000 / quality : 200 - 2 * quality;
    for (int u = 0; u < SIZE; u++)
        for (int x = 0; x < SIZE; x++)
            tables->cosine[u][x] = (u == 0 ? __builtin_sqrt(1.0 / SIZE) : 0.5) *
                                   fv_cos((2 * x + 1) * u * FV_PI / (2 * SIZE));
    for (int i = 0; i < BLOCK; i++) {
        const int32_t step = (luminance[i] * percent + 50) / 100;
        tables->step[i] = step < 1 ? 1 : step > 255 ? 255 : step;
    }
}

/* to = C from C^T, or with C transposed: the transform, and back. */
static void transform(double cosine[SIZE][SIZE], bool back, const double from[BLOCK],
                      double to[BLOCK])
{
    double rows[BLOCK];
    for (int y = 0; y < SIZE; y++)
        for (int u = 0; u < SIZE; u++) {
            double sum = 0;
            for (int x = 0; x < SIZE; x++)
                sum += from[SIZE * y + x] * (back ? cosine[x][u] : cosine[u][x]);
            rows[SIZE * y + u] = sum;
        }
    for (int v = 0; v < SIZE; v++)
        for (int u = 0; u < SIZE; u++) {
            double sum = 0;
            for (int y = 0; y < SIZE; y++)
                sum += rows[SIZE * y + u] * (back ? cosine[y][v] : cosine[v][y]);
            to[SIZE * v + u] = sum;
        }
}

static int32_t inside(int32_t at, int32_t count)
{
    return at >= count ? count - 1 : at;
}

static void block_pass(const struct fv_fault_picture *picture, struct tables *tables, int32_t x0,
                       int32_t y0, int32_t channel)
{
    double values[BLOCK], frequencies[BLOCK];
    const size_t stride = (size_t)picture->width * (size_t)picture->channels;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++)
            values[SIZE * y + x] =
                picture->pixels[(size_t)inside(y0 + y, picture->height) * stride +
                                (size_t)(inside(x0 + x, picture->width) * picture->channels +
                                         channel)] -
                128.0;
    transform(tables->cosine, false, values, frequencies);
    for (int i = 0; i < BLOCK; i++)
        frequencies[i] = fv_floor(frequencies[i] / tables->step[i] + 0.5) * tables->step[i];
    transform(tables->cosine, true, frequencies, values);
    for (int y = 0; y < SIZE && y0 + y < picture->height; y++)
        for (int x = 0; x < SIZE && x0 + x < picture->width; x++) {
            const double level = fv_floor(values[SIZE * y + x] + 128.5);
            picture->pixels[(size_t)(y0 + y) * stride +
                            (size_t)((x0 + x) * picture->channels + channel)] =
                (uint8_t)(level < 0     ? 0
                          : level > 255 ? 255
                                        : level);
        }
}

void fv_fault_recompress(struct fv_fault_picture *picture)
{
    struct tables tables;
    tables_make(picture->options->quality, &tables);
    for (int32_t y = 0; y < picture->height; y += SIZE)
        for (int32_t x = 0; x < picture->width; x += SIZE)
            for (int32_t c = 0; c < picture->channels; c++)
                block_pass(picture, &tables, x, y, c);
}
