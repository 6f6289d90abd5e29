/* A map as a file: written in units while the loop runs, read and checked before it starts.
 *
 * Layout, all little-endian, numbers as IEEE 754 and two's complement:
 *
 *     header     FV_ARCHIVE_HEADER_BYTES: magic, version, byte order mark, size, calibration,
 *                counts
 *     landmarks  each FV_ARCHIVE_LANDMARK_BYTES and 4 bytes per observer (keyframe slot, feature)
 *     keyframes  each FV_ARCHIVE_KEYFRAME_BYTES and FV_ARCHIVE_FEATURE_BYTES per feature, cell by
 *                cell of the grid; in version 4 FV_ARCHIVE_DISTANCE_BYTES more: the feature's
 *                measured inverse distance and its weight, on which a landmark that one keyframe
 *                sees stands
 *     edges      of closures, 16 bytes each
 *     scales     of maps whose unit is known in metres, FV_ARCHIVE_SCALE_BYTES each
 *     gravities  in versions 7 to 10, which are 3 to 6 with it: of maps in which gravity's
 *                direction is known, FV_ARCHIVE_GRAVITY_BYTES each
 *     grid       in versions 5, 6, 9 and 10: what was known of the floor, FV_ARCHIVE_GRID_BYTES
 *                and a byte for each cell
 *     checksum   8 bytes, FNV-1a of all before
 *
 * The version is the least that has what the map has, so that a map without gravity is read by
 * programs that know of none. A map is metric where it has a scale, and upright where it has
 * gravity: a scale is metres per unit of the map's points, gravity the unit vector in which things
 * fall in the map's own axes, and the standard deviation of its direction in rad.
 *
 * Bearings, grids, redundancy and the place index are not stored: they follow from the rest.
 *
 * Writing: the map's jobs rest while it goes on, so that poses and points stay as they are, but
 * frames may still add and remove keyframes and landmarks. So links are stored from both ends with
 * the generations of their slots, and reading keeps those that agree. Without a buffer the units
 * pass all the same: what becomes of the bytes does not touch the state.
 *
 * Reading trusts nothing: every number is checked before it is used, errors name the byte. */
#ifndef FOVEA_MAP_ARCHIVE_H
#define FOVEA_MAP_ARCHIVE_H

#include <stddef.h>

#include "fovea/camera.h"
#include "fovea/status.h"
#include "geometry/bearing.h"
#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_ARCHIVE_VERSION = 3, /* 1 had no scales, 2 features in any order and descriptors twice */
    FV_ARCHIVE_VERSION_LAST = 10,
    /* What a file of a version has, by the bits of what it is more than FV_ARCHIVE_VERSION. */
    FV_ARCHIVE_HAS_DISTANCES = 1, /* its features may have measured distances */
    FV_ARCHIVE_HAS_GRID = 2,
    FV_ARCHIVE_HAS_GRAVITY = 4,
    FV_ARCHIVE_HEADER_BYTES = 192,
    FV_ARCHIVE_LANDMARK_BYTES = 64,
    FV_ARCHIVE_OBSERVER_BYTES = 4,
    FV_ARCHIVE_KEYFRAME_BYTES = 144,
    FV_ARCHIVE_FEATURE_BYTES = 44,
    FV_ARCHIVE_DISTANCE_BYTES = 8,
    FV_ARCHIVE_EDGE_BYTES = 16,
    FV_ARCHIVE_SCALE_BYTES = 24,
    FV_ARCHIVE_SCALES_MAX = FV_MAP_WORLDS_MAX + 1, /* as many gravities */
    FV_ARCHIVE_GRAVITY_BYTES = 40,
    FV_ARCHIVE_GRID_BYTES = 120,
    FV_ARCHIVE_GRID_SIDE_MIN = 16,
    FV_ARCHIVE_GRID_SIDE_MAX = 512,
    FV_ARCHIVE_CHECKSUM_BYTES = 8,
    FV_ARCHIVE_UNIT_LANDMARKS = 512, /* slots read in a unit */
    FV_ARCHIVE_UNIT_FEATURES = 1024  /* written in a unit */
};

/* Most bytes that a map within these limits takes, whatever grid it holds. */
size_t fv_archive_bytes_max(const struct fv_map_limits *limits);
/* Those of a grid. */
static inline size_t fv_archive_grid_bytes(uint32_t side)
{
    return FV_ARCHIVE_GRID_BYTES + (size_t)side * side;
}

/* A grid of what was known of the floor (fovea/grid.h), saved with the map that it belongs to. Its
 * cells follow row by row, x first: percent occupied, 0 to 34 or 66 to 100, or -1: not known. No
 * padding. */
struct fv_archive_grid {
    uint32_t map_id;     /* of the map */
    uint32_t side;       /* cells along each side; 0: there is no grid */
    double resolution_m; /* side of a cell */
    /* Takes points of the grid to the map's own frame and unit, which are those of its keyframes:
     * metres from the outer corner of cell (0, 0), x along a row, z up from the floor. */
    struct fv_sim3 S_map_grid;
};
/* Whether a byte is one of a cell. */
static inline bool fv_archive_cell(int8_t percent)
{
    return percent >= -1 && percent <= 100 && (percent < 35 || percent > 65);
}

/* ---- writing --------------------------------------------------------------------------------- */

enum fv_archive_phase {
    FV_ARCHIVE_IDLE = 0,
    FV_ARCHIVE_LANDMARKS = 1,
    FV_ARCHIVE_KEYFRAMES = 2,
    FV_ARCHIVE_EDGES = 3,
    FV_ARCHIVE_DONE = 4, /* all is written; fv_archive_take ends it */
    FV_ARCHIVE_GRID = 5  /* where one was asked for: its owner writes it, between 3 and 4 */
};

struct fv_archive_state {
    uint64_t at;           /* bytes so far */
    uint64_t record_at;    /* where the keyframe in work begins */
    uint64_t frame_number; /* when it began */
    enum fv_archive_phase phase;
    uint32_t slot, feature; /* next */
    uint32_t generation;    /* of the keyframe in work */
    uint32_t features;      /* that its record promises */
    uint32_t landmarks, keyframes, edges, scales, gravities;
    uint32_t with_grid, has_grid; /* asked for; written */
};

void fv_archive_begin(struct fv_archive_state *archive, uint64_t frame_number);
static inline bool fv_archive_busy(const struct fv_archive_state *archive)
{
    return archive->phase != FV_ARCHIVE_IDLE && archive->phase != FV_ARCHIVE_DONE;
}
/* One unit: a part of the map goes into `out`, which may be NULL; nothing beyond `capacity`.
 * Real-time safe.
 */
void fv_archive_unit(struct fv_archive_state *archive, const struct fv_map *map,
                     const struct fovea_camera *camera, uint8_t *out, size_t capacity);
/* After fv_archive_begin: the phase FV_ARCHIVE_GRID comes, in which the owner of a grid writes its
 * head once and then all its cells, in pieces, or nothing; the next fv_archive_unit ends it. */
void fv_archive_want_grid(struct fv_archive_state *archive);
void fv_archive_grid_head(struct fv_archive_state *archive, const struct fv_archive_grid *grid,
                          uint8_t *out, size_t capacity);
void fv_archive_grid_cells(struct fv_archive_state *archive, const int8_t *cells, uint32_t count,
                           uint8_t *out, size_t capacity);
/* When all is written: bytes of the file, and idle again; 0 else. */
size_t fv_archive_take(struct fv_archive_state *archive);
/* Put the checksum at the end of a written file. A pass over all bytes: not for the loop. */
void fv_archive_seal(uint8_t *data, size_t bytes);

/* ---- reading --------------------------------------------------------------------------------- */

/* What a file says of itself. */
struct fv_archive_info {
    uint32_t version;
    struct fovea_camera camera;
    uint32_t landmarks, keyframes, edges, scales, gravities;
    uint32_t landmark_slots, keyframe_slots, features_max; /* that reading it needs */
    uint32_t map_id, map_next;
    uint64_t keyframe_number, frame_number;
    struct fv_archive_grid grid; /* filled by fv_archive_read */
    size_t grid_at;              /* where its cells begin in the file */
};

/* What the first bytes of a file of `bytes` bytes state, at least FV_ARCHIVE_HEADER_BYTES of them.
 * False: it is no map of these versions, or it is cut. */
struct fv_archive_outline {
    uint32_t landmarks;
    bool has_grid;
};
bool fv_archive_outline(const uint8_t *header, uint64_t bytes, struct fv_archive_outline *outline);

/* Check size, magic, version, byte order and checksum, and read the header. `name` is for errors,
 * which are FOVEA_ERROR_INPUT and name the byte. Init-only. */
enum fovea_status fv_archive_info(const uint8_t *data, size_t bytes, const char *name,
                                  struct fv_archive_info *info, struct fovea_error *error);

/* Fill the map from a file that was made with its camera. FOVEA_ERROR_INPUT: the file is damaged,
 * from another camera, or needs more than the map's limits; the map is empty then. Init-only. */
enum fovea_status fv_archive_read(const uint8_t *data, size_t bytes, const char *name,
                                  struct fv_map *map, struct fv_archive_info *info,
                                  struct fovea_error *error);

/* ---- between the files of the archive -------------------------------------------------------- */

/* After all records are read: links that both ends agree on are kept, and what follows from them is
 * made. */
void fv_archive_mend(struct fv_map *map);

#ifdef __cplusplus
}
#endif
#endif
