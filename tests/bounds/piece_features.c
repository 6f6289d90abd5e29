/* Of the image: grey levels and the pyramid; corners, their spread, and what is made of them. */
#include "features/spread.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"
#include "features/mask.h"
#include "features/refine.h"
#include "image/pyramid.h"

struct finding {
    struct fovea *rt;
    struct fovea_image image;
    const struct fv_pyramid *pyramid;
    struct fv_spread *spread;
    uint8_t *pixels, *scores, *thresholds;
    uint16_t *columns;
    int32_t width;
    uint32_t count; /* of corners, in the front end's list */
};

static void take_image(void *context)
{
    struct finding *f = context;
    fv_front_end_take(&f->rt->front_end, &f->rt->kernels, &f->image);
}

static void measure_noise(void *context)
{
    struct finding *f = context;
    (void)fv_front_end_noise(&f->rt->front_end);
}

/* The format that costs most. Noise is measured in the picture of the last one, which is random. */
static void of_images(struct finding *f)
{
    const size_t pixels = (size_t)f->image.width * (size_t)f->image.height;
    uint8_t *data = malloc(8 * pixels);
    for (size_t i = 0; i < 8 * pixels; i++)
        data[i] = (uint8_t)(i * 2654435761u >> 13);
    f->image.data = data;
    f->image.size_bytes = 8 * pixels;
    for (int format = FOVEA_PIXEL_FORMAT_COUNT; format-- > 0;) { /* grey stays */
        if (format == FOVEA_PIXEL_MJPEG) continue;
        f->image.format = (enum fovea_pixel_format)format;
        f->image.stride_bytes = fovea_image_stride_min(f->image.format, f->image.width);
        NOTE(pixel_taken, take_image, f, (double)pixels);
    }
    NOTE(noise_measured, measure_noise, f, 1);
    free(data);
}

/* ---- FAST ------------------------------------------------------------------------------------ */

static void score_row(void *context)
{
    struct finding *f = context;
    f->rt->kernels.fast_score_u8(f->scores, f->pixels + 3 * 4096 + 8, 4096, f->thresholds,
                                 f->width);
}

static void find_peaks(void *context)
{
    struct finding *f = context;
    (void)f->rt->kernels.fast_peaks_u8(f->columns, f->pixels + 64, f->scores + 64,
                                       f->pixels + 4096 + 64, 0, f->width);
}

static void walk_level(void *context)
{
    struct finding *f = context;
    struct fv_fast fast;
    fv_fast_begin(&fast, &f->rt->kernels, fv_pyramid_level(f->pyramid, 0), FV_FEATURES_BORDER_PX, 7,
                  &f->rt->front_end.features.fast);
    while (fv_fast_next(&fast))
        f->count += (uint32_t)fast.count;
}

/* A row that rises, under and over brighter ones: nearly every pixel passes the first tests. Then
 * scores of which every second is a peak. */
static void of_fast(struct finding *f)
{
    memset(f->pixels, 255, 8 * 4096);
    memset(f->thresholds, 7, 4096);
    for (int i = 0; i < 4096; i++)
        f->pixels[3 * 4096 + i] = (uint8_t)(i * 3 % 245);
    double row = (double)counter_of(score_row, f);
    memset(f->pixels, 0, 8 * 4096);
    for (int i = 0; i < 4096; i++)
        f->scores[i] = (uint8_t)(i % 2 == 0 ? 100 : 50);
    row += (double)counter_of(find_peaks, f);
    piece_note(PIECE_pixel_scored, row / f->width);
    const struct fv_plane *level = fv_pyramid_level(f->pyramid, 0);
    for (int32_t y = 0; y < level->height; y++)
        memset(fv_plane_row(level, y), 128, (size_t)level->width);
    double walk = (double)counter_of(walk_level, f);
    memset(f->pixels, 128, 8 * 4096);
    memset(f->scores, 0, 4096);
    for (int32_t y = 0; y < level->height; y++)
        walk -= (double)counter_of(score_row, f);
    piece_note(PIECE_row_walked, walk / level->height);
}

/* ---- the spread ------------------------------------------------------------------------------ */

static void begin(void *context)
{
    struct finding *f = context;
    const struct fovea_features_config *config = &f->rt->config.features;
    fv_spread_begin(f->spread, config->count_max, (uint8_t)config->threshold,
                    (uint8_t)config->per_cell);
}

static void offer(void *context)
{
    struct finding *f = context;
    const int32_t x = (int32_t)(f->count % 600) + 20;
    fv_spread_offer(f->spread, 0, x % f->width, 20, (uint8_t)(50 + f->count % 200));
}

static void need(void *context)
{
    struct finding *f = context;
    fv_spread_thresholds(f->spread, 0, (int32_t)f->count, 7, f->thresholds);
}

static void pick(void *context)
{
    struct finding *f = context;
    f->count = fv_spread_pick(f->spread, f->rt->front_end.features.corners);
}

static void rank_all(void *context)
{
    struct finding *f = context;
    struct ranking ranking;
    for (uint32_t i = 0; i < f->spread->levels; i++)
        rank(&f->spread->level[i], f->spread->threshold, FV_SPREAD_KEPT, &ranking);
}

/* Corners at every `step` pixels of every level, of one score or of many. */
static void offer_all(struct finding *f, int32_t step, uint32_t scores)
{
    begin(f);
    for (uint32_t level = f->spread->levels; level-- > 0;) {
        const struct fv_plane *plane = fv_pyramid_level(f->pyramid, level);
        uint32_t n = 0;
        for (int32_t y = FV_FEATURES_BORDER_PX; y < plane->height - FV_FEATURES_BORDER_PX;
             y += step)
            for (int32_t x = FV_FEATURES_BORDER_PX; x < plane->width - FV_FEATURES_BORDER_PX;
                 x += step, n++)
                fv_spread_offer(f->spread, level, x, y, (uint8_t)(100 + n * 7919 % scores));
    }
}

static void of_spread(struct finding *f)
{
    static const struct {
        int32_t step;
        uint32_t scores;
    } layouts[] = {{2, 1}, {2, 150}, {3, 1}, {8, 150}, {16, 1}, {30, 150}};
    NOTE(corners_begin, begin, f, 1);
    for (f->count = 0; f->count < 64; f->count++)
        NOTE(corner_offered, offer, f, 1);
    for (size_t i = 0; i < sizeof layouts / sizeof layouts[0]; i++) {
        offer_all(f, layouts[i].step, layouts[i].scores);
        for (f->count = 20; f->count < 20 + 64; f->count++) /* all fields are looked at */
            NOTE(row_needed, need, f, 1);
        NOTE(corners_ranked, rank_all, f, 1);
        NOTE(corners_picked, pick, f, 1);
    }
    offer_all(f, 2, 150);
    pick(f);
}

/* ---- corners --------------------------------------------------------------------------------- */

static void refine_all(void *context)
{
    struct finding *f = context;
    struct fv_features *features = &f->rt->front_end.features;
    fv_refine_corners(&f->rt->kernels, f->pyramid, features->corners, f->count, features->list);
}

static void describe_all(void *context)
{
    struct finding *f = context;
    fv_orb_describe(&f->rt->front_end.orb, &f->rt->kernels, f->pyramid,
                    f->rt->front_end.features.corners, f->count);
}

static void of_corners(struct finding *f)
{
    struct fv_corner *corners = f->rt->front_end.features.corners;
    double pixels = 0;
    const double first = (double)counter_of(describe_all, f),
                 all = (double)counter_of(describe_all, f);
    piece_note(PIECE_patterns_turned, first - all);
    /* All at one place: the smoothing of its rows is then next to nothing. */
    const uint32_t count = f->count;
    NOTE(corner_refined, refine_all, f, count);
    for (uint32_t i = 0; i < count; i++)
        corners[i] = (struct fv_corner){.x = 40, .y = 40, .score = 100};
    const double crowded = (double)counter_of(describe_all, f);
    f->count = 1;
    const double one = (double)counter_of(describe_all, f);
    piece_note(PIECE_corner_described, (crowded - one) / (count - 1));
    for (uint32_t i = 0; i < f->pyramid->levels; i++)
        pixels += (double)f->pyramid->level[i].width * f->pyramid->level[i].height;
    piece_note(PIECE_row_smoothed, (all - piece_costs[PIECE_corner_described] * count) / pixels);
}

/* ---- masks ----------------------------------------------------------------------------------- */

static void compose(void *context)
{
    struct finding *f = context;
    static struct fv_mask_box boxes[FOVEA_INPUT_BOXES_MAX];
    for (uint32_t i = 0; i < f->count; i++)
        boxes[i] = (struct fv_mask_box){0, 0, 1e4f, 1e4f};
    fv_mask_compose(&f->rt->boxes.mask, NULL, boxes, f->count);
}

void pieces_of_features(struct fovea *rt)
{
    const struct fovea_camera *camera = &rt->config.rig.cameras[0].camera;
    struct finding f = {.rt = rt,
                        .image = {.width = camera->width, .height = camera->height},
                        .pyramid = &rt->front_end.images.main,
                        .spread = &rt->front_end.features.spread,
                        .pixels = calloc(9, 4096),
                        .scores = calloc(2, 4096),
                        .thresholds = calloc(2, 4096),
                        .columns = calloc(4096, sizeof *f.columns),
                        .width = camera->width};
    of_images(&f);
    of_spread(&f);
    of_corners(&f);
    of_fast(&f);
    f.count = 0;
    NOTE(mask_begun, compose, &f, 1);
    f.count = 2;
    const double two = (double)counter_of(compose, &f);
    piece_note(PIECE_box_masked, (two - piece_costs[PIECE_mask_begun]) / 2);
    free(f.columns);
    free(f.thresholds);
    free(f.scores);
    free(f.pixels);
}
