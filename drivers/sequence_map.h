/* Pictures of a part of `sequence:` as the camera of the first part would have taken them
 * (drivers/sequence.c). */
#ifndef FOVEA_DRIVERS_SEQUENCE_MAP_H
#define FOVEA_DRIVERS_SEQUENCE_MAP_H

#include "fovea/source.h"

/* Where a pixel comes from: pixels of the part's image times 32, within its border. */
struct fv_sequence_place {
    uint16_t x, y;
};

/* The place of every pixel of camera `i` of `to` in that of `from`, row by row, in memory that the
 * caller frees; NULL where pictures of `from` fit as they are. FOVEA_ERROR_INPUT: neither do they
 * fit, nor are both grey, calibrated and at most 2048 pixels each way; FOVEA_ERROR_SYSTEM: no
 * memory. */
enum fovea_status fv_sequence_map_make(const struct fovea_source_info *to,
                                       const struct fovea_source_info *from, uint32_t i,
                                       struct fv_sequence_place **map, struct fovea_error *error);

/* The picture `from` as the camera `seen` would have taken it, without gaps between rows: bilinear,
 * rounded. */
void fv_sequence_map_apply(const struct fv_sequence_place *map,
                           const struct fovea_source_camera *seen, const struct fovea_image *from,
                           uint8_t *to);

#endif
