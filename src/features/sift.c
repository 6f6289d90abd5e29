#include "features/sift.h"

#include <string.h>

#include "base/elementary.h"
#include "features/quadratic.h"

enum { BORDER_PX = 5, STEPS_MAX = 5 };

void fv_sift_carve(struct fv_sift *sift, const struct fovea_extract_config *config, int32_t width,
                   int32_t height, struct fv_arena *arena)
{
    fv_scale_space_carve(&sift->space, width, height, config->doubled != 0, config->levels, arena);
    const size_t stride = (size_t)sift->space.octave[0].stride + 2 * FV_SCALE_PAD;
    sift->count_max = config->count_max;
    sift->room = config->count_max + config->count_max / 4 + 16;
    sift->contrast = config->contrast;
    sift->edge_ratio = config->edge_ratio;
    sift->upright = config->upright != 0;
    sift->extremes = fv_arena_take(arena, sift->room, sizeof *sift->extremes);
    sift->pending =
        fv_arena_take(arena, sift->room, (FV_SIFT_ORIENTATIONS_MAX - 1) * sizeof *sift->pending);
    sift->marks = fv_arena_take(arena, stride, sizeof *sift->marks);
    sift->peaks = fv_arena_take(arena, 2 * FV_SCALE_DIFFERENCES * stride, sizeof *sift->peaks);
    sift->tables = fv_arena_take(arena, 1, fv_sift_tables_bytes());
    if (sift->tables != NULL) fv_sift_tables_fill(sift->tables);
    sift->features = fv_arena_take(arena, sift->count_max, sizeof *sift->features);
    sift->descriptors = fv_arena_take(arena, sift->count_max, FV_SIFT_BYTES);
}

double fv_sift_sigma(const struct fv_sift_extreme *extreme)
{
    return FV_SCALE_SIGMA * fv_pow(2, (double)extreme->layer / FV_SCALE_LAYERS);
}

/* Whether a goes before b: the stronger, and of equals the finer, then the earlier. */
static bool before(const struct fv_sift_extreme *a, const struct fv_sift_extreme *b)
{
    if (a->response != b->response) return a->response > b->response;
    if (a->octave != b->octave) return a->octave < b->octave;
    if (a->at_layer != b->at_layer) return a->at_layer < b->at_layer;
    if (a->at_y != b->at_y) return a->at_y < b->at_y;
    return a->at_x < b->at_x;
}

/* Let the element at `at` sink in a heap whose first element goes after all others. */
static void sink(struct fv_sift_extreme *heap, uint32_t count, uint32_t at)
{
    const struct fv_sift_extreme moved = heap[at];
    for (uint32_t child; (child = 2 * at + 1) < count; at = child) {
        if (child + 1 < count && before(&heap[child], &heap[child + 1])) child++;
        if (!before(&moved, &heap[child])) break;
        heap[at] = heap[child];
    }
    heap[at] = moved;
}

static void keep(struct fv_sift *sift, const struct fv_sift_extreme *extreme)
{
    struct fv_sift_extreme *heap = sift->extremes;
    if (sift->extreme_count == sift->room) {
        if (!before(extreme, &heap[0])) return;
        heap[0] = *extreme;
        sink(heap, sift->room, 0);
        return;
    }
    uint32_t at = sift->extreme_count++;
    for (; at > 0 && before(&heap[(at - 1) / 2], extreme); at = (at - 1) / 2)
        heap[at] = heap[(at - 1) / 2];
    heap[at] = *extreme;
}

/* Sort the heap, the strongest first, and leave out what was found twice. */
static void sort(struct fv_sift *sift)
{
    struct fv_sift_extreme *list = sift->extremes;
    for (uint32_t left = sift->extreme_count; left > 1; left--) {
        const struct fv_sift_extreme last = list[0];
        list[0] = list[left - 1];
        list[left - 1] = last;
        sink(list, left - 1, 0);
    }
    uint32_t count = 0;
    for (uint32_t i = 0; i < sift->extreme_count; i++)
        if (i == 0 || before(&list[count - 1], &list[i])) list[count++] = list[i];
    sift->extreme_count = count;
}

/* Differences of Gaussians around a position of an octave: [layer][row][column], grey levels. */
struct cube {
    double d[3][3][3];
};

static void cube_take(const struct fv_scale_octave *octave, int32_t layer, int32_t x, int32_t y,
                      struct cube *cube)
{
    for (int32_t s = 0; s < 3; s++)
        for (int32_t r = 0; r < 3; r++) {
            const uint16_t *low = fv_scale_row(octave, layer + s - 1, y + r - 1) + x - 1;
            const uint16_t *high = fv_scale_row(octave, layer + s, y + r - 1) + x - 1;
            for (int c = 0; c < 3; c++)
                cube->d[s][r][c] = (high[c] - low[c]) / 128.;
        }
}

/* The step to the next pixel or layer: -1, 0 or 1. */
static int32_t step_of(double offset)
{
    return (offset > .5) - (offset < -.5);
}

/* Move to where the quadratic says that the extreme is; false when it leaves the octave or does not
 * converge. */
static bool converge(const struct fv_scale_octave *octave, int32_t *layer, int32_t *x, int32_t *y,
                     struct cube *cube, struct fv_quadratic *q, double at[3])
{
    for (int step = 0; step < STEPS_MAX; step++) {
        cube_take(octave, *layer, *x, *y, cube);
        fv_quadratic_fit((const double(*)[3][3])cube->d, q);
        if (!fv_quadratic_extreme(q, at)) return false;
        const int32_t dx = step_of(at[0]), dy = step_of(at[1]), ds = step_of(at[2]);
        if (dx == 0 && dy == 0 && ds == 0) return true;
        *x += dx;
        *y += dy;
        *layer += ds;
        if (*layer < 1 || *layer > FV_SCALE_LAYERS || *x < BORDER_PX || *y < BORDER_PX ||
            *x >= octave->width - BORDER_PX || *y >= octave->height - BORDER_PX)
            return false;
    }
    return false;
}

static void refine(struct fv_sift *sift, uint32_t octave, int32_t layer, int32_t x, int32_t y,
                   const struct fv_plane *mask)
{
    struct cube cube;
    struct fv_quadratic q;
    double at[3];
    if (!converge(&sift->space.octave[octave], &layer, &x, &y, &cube, &q, at)) return;
    const double value =
        cube.d[1][1][1] +
        (q.gradient[0] * at[0] + q.gradient[1] * at[1] + q.gradient[2] * at[2]) / 2;
    const double response = value < 0 ? -value : value, ratio = (double)sift->edge_ratio;
    const double trace = q.xx + q.yy, determinant = q.xx * q.yy - q.xy * q.xy;
    if (response < (double)sift->contrast || determinant <= 0 ||
        trace * trace * ratio >= (ratio + 1) * (ratio + 1) * determinant)
        return;
    const struct fv_sift_extreme extreme = {
        .x = (float)(x + at[0]),
        .y = (float)(y + at[1]),
        .layer = (float)(layer + at[2]),
        .response = (float)response,
        .at_x = (uint16_t)x,
        .at_y = (uint16_t)y,
        .octave = (uint8_t)octave,
        .at_layer = (uint8_t)layer,
    };
    if (mask->pixels != NULL) {
        const struct fv_scale_space *space = &sift->space;
        const int32_t column = (int32_t)(fv_scale_in_image(space, octave, extreme.x) + .5);
        const int32_t row = (int32_t)(fv_scale_in_image(space, octave, extreme.y) + .5);
        if (fv_plane_row(mask, row < mask->height
                                   ? row
                                   : mask->height -
                                         1)[column < mask->width ? column : mask->width - 1] == 0)
            return;
    }
    keep(sift, &extreme);
}

static void search_row(struct fv_sift *sift, const struct fv_kernels *kernels, uint32_t octave,
                       int32_t y, const struct fv_plane *mask)
{
    const struct fv_scale_octave *from = &sift->space.octave[octave];
    const uint16_t *rows[3 * FV_SCALE_LEVELS];
    for (int32_t i = 0; i < 3 * FV_SCALE_LEVELS; i++)
        rows[i] = fv_scale_row(from, i / 3, y + i % 3 - 1);
    /* Before it is refined, half of the contrast is enough. */
    kernels->scale_peaks_row_u16(sift->marks, rows, from->width, (int32_t)(sift->contrast * 64),
                                 sift->peaks);
    for (int32_t x = BORDER_PX; x < from->width - BORDER_PX;) {
        uint64_t four = 0;
        if (x + 4 <= from->width) memcpy(&four, sift->marks + x, sizeof four);
        if (four == 0 && x + 4 <= from->width) {
            x += 4;
            continue;
        }
        for (int32_t k = 0; k < FV_SCALE_LAYERS; k++)
            if (sift->marks[x] >> k & 1) refine(sift, octave, k + 1, x, y, mask);
        x++;
    }
}

/* Find the extremes of all octaves, the strongest first. */
static void find(struct fv_sift *sift, const struct fv_kernels *kernels,
                 const struct fv_plane *mask)
{
    sift->extreme_count = 0;
    for (uint32_t octave = 0; octave < sift->space.octaves; octave++)
        for (int32_t y = BORDER_PX; y < sift->space.octave[octave].height - BORDER_PX; y++)
            search_row(sift, kernels, octave, y, mask);
    sort(sift);
}

/* ---- features -------------------------------------------------------------------------------- */

/* Whether a goes before b: the stronger, and of equals that of the earlier extreme. */
static bool pending_before(const struct fv_sift_pending *a, const struct fv_sift_pending *b)
{
    if (a->strength != b->strength) return a->strength > b->strength;
    if (a->extreme != b->extreme) return a->extreme < b->extreme;
    return a->angle_rad < b->angle_rad;
}

static void push(struct fv_sift *sift, const struct fv_sift_pending *one)
{
    struct fv_sift_pending *heap = sift->pending;
    uint32_t at = sift->pending_count++;
    for (; at > 0 && pending_before(one, &heap[(at - 1) / 2]); at = (at - 1) / 2)
        heap[at] = heap[(at - 1) / 2];
    heap[at] = *one;
}

static struct fv_sift_pending pop(struct fv_sift *sift)
{
    struct fv_sift_pending *heap = sift->pending;
    const struct fv_sift_pending first = heap[0], moved = heap[--sift->pending_count];
    uint32_t at = 0;
    for (uint32_t child; (child = 2 * at + 1) < sift->pending_count; at = child) {
        if (child + 1 < sift->pending_count && pending_before(&heap[child + 1], &heap[child]))
            child++;
        if (!pending_before(&heap[child], &moved)) break;
        heap[at] = heap[child];
    }
    heap[at] = moved;
    return first;
}

static void add(struct fv_sift *sift, uint32_t *count, uint32_t index, float strength,
                float angle_rad)
{
    const struct fv_sift_extreme *extreme = &sift->extremes[index];
    const double pixel = fv_scale_pixel(&sift->space, extreme->octave);
    sift->features[*count] = (struct fovea_local_feature){
        .x_px = (float)fv_scale_in_image(&sift->space, extreme->octave, extreme->x),
        .y_px = (float)fv_scale_in_image(&sift->space, extreme->octave, extreme->y),
        .size_px = (float)(2 * fv_sift_sigma(extreme) * pixel),
        .angle_rad = angle_rad,
        .response = strength,
        .level = extreme->octave,
    };
    fv_sift_describe(sift, extreme, angle_rad, sift->descriptors + (size_t)*count * FV_SIFT_BYTES);
    ++*count;
}

/* Add the pending orientations that are at least as strong. */
static void add_pending(struct fv_sift *sift, uint32_t *count, float strength)
{
    while (sift->pending_count > 0 && *count < sift->count_max &&
           sift->pending[0].strength >= strength) {
        const struct fv_sift_pending next = pop(sift);
        add(sift, count, next.extreme, next.strength, next.angle_rad);
    }
}

uint32_t fv_sift_run(struct fv_sift *sift, const struct fv_kernels *kernels,
                     const struct fv_plane *image, const struct fv_plane *mask)
{
    uint32_t count = 0;
    fv_scale_space_build(&sift->space, kernels, image);
    find(sift, kernels, mask);
    sift->pending_count = 0;
    for (uint32_t i = 0; i < sift->extreme_count; i++) {
        const struct fv_sift_extreme *extreme = &sift->extremes[i];
        struct fv_sift_orientation found[FV_SIFT_ORIENTATIONS_MAX] = {{0, 1}};
        add_pending(sift, &count, extreme->response);
        if (count == sift->count_max) break;
        const uint32_t made = sift->upright ? 1 : fv_sift_orient(sift, extreme, found);
        if (made > 0) add(sift, &count, i, extreme->response, found[0].angle_rad);
        for (uint32_t k = 1; k < made; k++) {
            const float strength = extreme->response * found[k].share * found[k].share;
            const struct fv_sift_pending one = {strength, found[k].angle_rad, i};
            push(sift, &one);
        }
    }
    add_pending(sift, &count, 0);
    return count;
}
