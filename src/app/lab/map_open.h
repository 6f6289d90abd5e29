/* A map file opened for looking at: its pools in memory of its own. For commands; the heap is used.
 */
#ifndef FOVEA_APP_LAB_MAP_OPEN_H
#define FOVEA_APP_LAB_MAP_OPEN_H

#include "support/canvas.h"
#include "fovea/image.h"
#include "fovea/odometry.h"
#include "map/archive.h"

struct fv_map_open {
    struct fv_archive_info info;
    struct fovea_camera camera; /* of the map */
    struct fv_map map;
    struct fv_bearing_table bearings;
    size_t file_bytes;
    uint64_t hash;                     /* of the file, as a recording names it */
    uint32_t grid_free, grid_occupied; /* cells of its grid */
    void *memory;
};

/* Read a file and check all of it. Errors are one line that names file and byte. */
enum fovea_status fv_map_open(const char *path, struct fv_map_open *open,
                              struct fovea_error *error);
/* The same of a sealed map in memory; `name` is what errors call it. */
enum fovea_status fv_map_open_bytes(const uint8_t *data, size_t bytes, const char *name,
                                    struct fv_map_open *open, struct fovea_error *error);
void fv_map_open_free(struct fv_map_open *open);

/* Keyframes of one map in the order in which they were made, at most FV_MAP_KEYFRAMES_MAX; returns
 * their number. */
uint32_t fv_map_open_order(const struct fv_map_open *open, uint32_t map_id, uint32_t *slots);
/* The map with most keyframes; false: there is none. */
bool fv_map_open_largest(const struct fv_map_open *open, uint32_t *map_id);
/* The map that a landmark belongs to. */
uint32_t fv_map_open_map_of(const struct fv_map_open *open, const struct fv_landmark *landmark);
/* Where a keyframe's camera stood, in its map's world. */
void fv_map_open_centre(const struct fv_map_open *open, uint32_t slot, double centre[3]);

/* Top and side view of one map as PNG (map_picture.c). */
enum fovea_status fv_map_picture(const struct fv_map_open *open, const char *name, uint32_t map_id,
                                 const char *path, struct fovea_error *error);

#endif
