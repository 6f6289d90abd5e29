#include "runtime/boxes.h"

#include <string.h>

#include "features/mask.h"

static const float margin_px = 4; /* edges of boxes are not exact, and corners reach over them */
static const float heights_per_s = 1; /* how far a walker gets */

void fv_boxes_carve(struct fv_boxes *boxes, int32_t width, int32_t height,
                    struct fv_arena *persistent, struct fv_arena *frame)
{
    boxes->state = fv_arena_take(persistent, 1, sizeof *boxes->state);
    boxes->mask = (struct fv_plane){fv_arena_take_raw(frame, (size_t)width * (size_t)height, 1),
                                    width, height, width};
}

void fv_boxes_take(struct fv_boxes *boxes, int64_t stamp_ns, const struct fovea_box *list,
                   uint32_t count)
{
    struct fv_boxes_state *state = boxes->state;
    state->stamp_ns = stamp_ns;
    state->count = count < FOVEA_INPUT_BOXES_MAX ? count : FOVEA_INPUT_BOXES_MAX;
    memcpy(state->boxes, list, state->count * sizeof list[0]);
}

const struct fv_plane *fv_boxes_mask(struct fv_boxes *boxes, const struct fv_plane *fixed,
                                     int64_t stamp_ns)
{
    const struct fv_boxes_state *state = boxes->state;
    struct fv_mask_box grown[FOVEA_INPUT_BOXES_MAX];
    if (state == NULL || state->count == 0) return fixed;
    int64_t age_ns;
    if (__builtin_sub_overflow(stamp_ns, state->stamp_ns, &age_ns) ||
        age_ns > FV_BOXES_AGE_MAX_NS || age_ns < -FV_BOXES_AGE_MAX_NS)
        return fixed;
    if (age_ns < 0) age_ns = -age_ns;
    for (uint32_t i = 0; i < state->count; i++) {
        const struct fovea_box *b = &state->boxes[i];
        float by = margin_px + heights_per_s * (b->y_max_px - b->y_min_px) * (float)age_ns * 1e-9f;
        grown[i] = (struct fv_mask_box){b->x_min_px - by, b->y_min_px - by, b->x_max_px + by,
                                        b->y_max_px + by};
    }
    fv_mask_compose(&boxes->mask, fixed, grown, state->count);
    return &boxes->mask;
}
