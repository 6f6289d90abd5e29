#include "sequence_map.h"

#include <stdbool.h>
#include <stdlib.h>

#include "fovea/camera.h"

enum { FRACTION_BITS = 5, PLACE_MAX = 1 << (16 - FRACTION_BITS) };

static bool same_camera(const struct fovea_source_info *a, const struct fovea_source_info *b,
                        uint32_t i)
{
    const struct fovea_camera *p = &a->rig.cameras[i].camera, *q = &b->rig.cameras[i].camera;
    if (a->cameras[i].width != b->cameras[i].width ||
        a->cameras[i].height != b->cameras[i].height || a->format != b->format)
        return false;
    if (!a->rig.cameras[i].calibrated || !b->rig.cameras[i].calibrated) return true;
    for (size_t k = 0; k < sizeof p->k / sizeof p->k[0]; k++)
        if (p->k[k] != q->k[k]) return false;
    return p->lens == q->lens && p->fx == q->fx && p->fy == q->fy && p->cx == q->cx &&
           p->cy == q->cy;
}

static uint16_t fixed(double place, int32_t size)
{
    const double most = size - 1;
    return (uint16_t)((place < 0 ? 0 : place > most ? most : place) * (1 << FRACTION_BITS) + 0.5);
}

enum fovea_status fv_sequence_map_make(const struct fovea_source_info *to,
                                       const struct fovea_source_info *from, uint32_t i,
                                       struct fv_sequence_place **map, struct fovea_error *error)
{
    *map = NULL;
    if (same_camera(to, from, i)) return FOVEA_OK;
    if (!to->rig.cameras[i].calibrated || !from->rig.cameras[i].calibrated ||
        to->format != FOVEA_PIXEL_GREY8 || from->format != FOVEA_PIXEL_GREY8 ||
        from->cameras[i].width > PLACE_MAX || from->cameras[i].height > PLACE_MAX)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "sequence: found a part of %d x %d pixels after one of %d x %d, expected the same or grey pictures of known cameras, at most %d each way",
            from->cameras[i].width, from->cameras[i].height, to->cameras[i].width,
            to->cameras[i].height, PLACE_MAX);
    *map = malloc((size_t)to->cameras[i].width * (size_t)to->cameras[i].height * sizeof **map);
    if (*map == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sequence: out of memory");
    const struct fovea_camera *seen = &to->rig.cameras[i].camera,
                              *taken = &from->rig.cameras[i].camera;
    struct fv_sequence_place *at = *map;
    for (int32_t y = 0; y < to->cameras[i].height; y++)
        for (int32_t x = 0; x < to->cameras[i].width; x++, at++) {
            const double pixel[2] = {x, y};
            double bearing[3], place[2] = {0, 0};
            *at = (struct fv_sequence_place){0, 0}; /* where the lens sees nothing: the corner */
            if (fovea_camera_unproject(seen, pixel, bearing, NULL) != FOVEA_OK ||
                fovea_camera_project(taken, bearing, place, NULL) != FOVEA_OK)
                continue;
            *at = (struct fv_sequence_place){fixed(place[0], from->cameras[i].width),
                                             fixed(place[1], from->cameras[i].height)};
        }
    return FOVEA_OK;
}

void fv_sequence_map_apply(const struct fv_sequence_place *map,
                           const struct fovea_source_camera *seen, const struct fovea_image *from,
                           uint8_t *to)
{
    const int32_t one = 1 << FRACTION_BITS;
    const size_t count = (size_t)seen->width * (size_t)seen->height;
    for (size_t i = 0; i < count; i++) {
        const int32_t x = map[i].x >> FRACTION_BITS, y = map[i].y >> FRACTION_BITS;
        const int32_t u = map[i].x & (one - 1), v = map[i].y & (one - 1);
        const uint8_t *row = from->data + (size_t)y * (size_t)from->stride_bytes + x;
        const uint8_t *below = v > 0 ? row + from->stride_bytes : row;
        const int32_t right = u > 0;
        const int32_t upper = row[0] * (one - u) + row[right] * u,
                      lower = below[0] * (one - u) + below[right] * u;
        to[i] = (uint8_t)((upper * (one - v) + lower * v + one * one / 2) >> (2 * FRACTION_BITS));
    }
}
