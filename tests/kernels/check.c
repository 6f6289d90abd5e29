#include "kernels/check.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { PATTERN = 0xa7 };

/* splitmix64: only the tests' own draws, so that they do not rest on what is tested. */
uint32_t check_random(struct check *check)
{
    uint64_t z = (check->random += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (uint32_t)((z ^ (z >> 31)) >> 16);
}

int32_t check_between(struct check *check, int32_t low, int32_t high)
{
    return low + (int32_t)(check_random(check) % (uint32_t)(high - low + 1));
}

void check_fail(struct check *check, const char *format, ...)
{
    va_list arguments;
    if (check->failed) return;
    check->failed = true;
    printf("FAILED %s__%s, seed %llu: ", check->kernel, check->isa,
           (unsigned long long)check->seed);
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
    printf("\n");
}

void *check_buffer(struct check *check, size_t bytes, size_t alignment, size_t slack)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t inner = (bytes + slack + alignment + page - 1) / page * page;
    if (check->buffer_count == CHECK_BUFFERS_MAX) abort();
    uint8_t *pages =
        mmap(NULL, inner + 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (pages == MAP_FAILED) abort();
    uint8_t *data = pages + page;
    if (check_random(check) & 1) data += (inner - bytes - slack) & ~(alignment - 1);
    memset(pages + page, PATTERN, inner);
    memset(data, 0, bytes);
    mprotect(pages, page, PROT_NONE);
    mprotect(pages + page + inner, page, PROT_NONE);
    const int i = check->buffer_count++;
    check->buffers[i].pages = pages;
    check->buffers[i].pages_bytes = inner + 2 * page;
    check->buffers[i].data = data;
    /* The slack may be written by contract; it is not part of the guard. */
    check->buffers[i].bytes = bytes + slack;
    return data;
}

void check_release(struct check *check)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    for (int i = 0; i < check->buffer_count; i++) {
        const uint8_t *data = check->buffers[i].data;
        const uint8_t *start = check->buffers[i].pages + page;
        const uint8_t *end = check->buffers[i].pages + check->buffers[i].pages_bytes - page;
        for (const uint8_t *p = start; p < data; p++)
            if (*p != PATTERN) check_fail(check, "wrote %td bytes before a buffer", data - p);
        for (const uint8_t *p = data + check->buffers[i].bytes; p < end; p++)
            if (*p != PATTERN)
                check_fail(check, "wrote %td bytes past a buffer",
                           p - data - (ptrdiff_t)check->buffers[i].bytes);
        munmap(check->buffers[i].pages, check->buffers[i].pages_bytes);
    }
    check->buffer_count = 0;
}

void check_fill(struct check *check, void *data, size_t bytes)
{
    uint8_t *out = data;
    const int32_t kind = check_between(check, 0, 5);
    int32_t ramp = 0, slope = 0;
    const int32_t base = check_between(check, 0, 255);
    for (size_t i = 0; i < bytes; i++) {
        const uint32_t draw = check_random(check);
        switch (kind) {
        case 0:
            out[i] = (uint8_t)draw;
            break;
        case 1:
            out[i] = 0;
            break;
        case 2:
            out[i] = 255;
            break;
        case 3:
            out[i] = (uint8_t)(draw & 256 ? 255 : 0);
            break;
        case 4:
            if (draw % 37 == 0) slope = (int32_t)(draw >> 8) % 9 - 4;
            ramp += slope;
            out[i] = (uint8_t)(ramp + (int32_t)(draw >> 24) % 5);
            break;
        default:
            out[i] = (uint8_t)(base + (int32_t)(draw % 3));
            break;
        }
    }
}

void check_equal(struct check *check, const char *what, const void *expected, const void *found,
                 size_t bytes)
{
    const uint8_t *e = expected, *f = found;
    if (memcmp(e, f, bytes) == 0) return;
    size_t i = 0;
    while (e[i] == f[i])
        i++;
    check_fail(check, "%s differs at byte %zu of %zu: C gives %u, found %u", what, i, bytes, e[i],
               f[i]);
}

static uint8_t *image;

enum { ROWS = BENCH_HEIGHT + 16 };

void bench_image_set(const uint8_t *pixels, size_t stride_bytes)
{
    bench_image();
    for (int y = 0; y < BENCH_HEIGHT; y++)
        memcpy(image + y * BENCH_STRIDE, pixels + (size_t)y * stride_bytes, BENCH_WIDTH);
}

const uint8_t *bench_image(void)
{
    if (image != NULL) return image;
    struct check draw = {.random = 7};
    image = aligned_alloc(64, BENCH_STRIDE * ROWS);
    if (image == NULL) abort();
    memset(image, 110, BENCH_STRIDE * ROWS);
    /* Overlapping rectangles of random grey, then noise: edges and corners at the density of an
     * indoor scene. */
    for (int n = 0; n < 1200; n++) {
        const int x = check_between(&draw, 0, BENCH_WIDTH - 1),
                  y = check_between(&draw, 0, BENCH_HEIGHT - 1);
        const int w = check_between(&draw, 2, 70), h = check_between(&draw, 2, 70);
        const int grey = check_between(&draw, 20, 230);
        for (int row = y; row < y + h && row < ROWS; row++)
            for (int column = x; column < x + w && column < BENCH_STRIDE; column++)
                image[row * BENCH_STRIDE + column] = (uint8_t)grey;
    }
    for (int i = 0; i < BENCH_STRIDE * ROWS; i++)
        image[i] = (uint8_t)(image[i] + check_between(&draw, -3, 3));
    return image;
}

uint8_t *bench_scratch(void)
{
    static uint8_t *scratch;
    if (scratch == NULL) scratch = aligned_alloc(64, 8 << 20);
    if (scratch == NULL) abort();
    return scratch;
}

void check_draw_range(struct check *check, int32_t *zero, int32_t *low, int32_t *high)
{
    *zero = check_between(check, 0, 3) ? check_between(check, 0, 255)
                                       : 255 * check_between(check, 0, 1);
    *low = check_between(check, 0, 1) ? 0 : *zero;
    *high = check_between(check, 0, 2) ? 255 : check_between(check, *low, 255);
}
