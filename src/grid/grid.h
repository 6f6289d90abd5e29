/* The grid of free space in pieces of bounded time, for the loop: what include/fovea/grid.h does in
 * one call. The result is the same however the work is divided.
 *
 * struct fv_grid holds sizes and addresses only; the state and the arrays lie in an arena, without
 * addresses. */
#ifndef FOVEA_GRID_GRID_H
#define FOVEA_GRID_GRID_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/grid.h"
#include "geometry/project.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_grid_phase {
    FV_GRID_IDLE = 0,
    FV_GRID_DECAY,
    FV_GRID_POINTS_TAKEN,
    FV_GRID_RAYS,
    FV_GRID_APPLY
};

/* No addresses and no padding: copied and hashed as bytes. */
struct fv_grid_state {
    int64_t stamp_ns;       /* of the last update */
    int64_t decayed_ns[2];  /* until when cells have forgotten: others, movable ones */
    int64_t corner[2];      /* cell (0, 0) in cells of the odometry frame */
    int64_t corner_kept[2]; /* the same modulo the side: where that cell is kept */
    double position_m[2], yaw_rad;
    int64_t cell;       /* of the phases that go over all cells: the next one */
    int32_t left[2];    /* of the decay under way: the part that stays, in 65536ths */
    int32_t ray, step;  /* of the rays: the next one, and its next step; -1: not begun */
    int32_t free;       /* and its first step that is floor and not yet marked as free */
    int32_t scanned;    /* rays of the scan */
    int32_t free_below; /* log-odds in thousandths, as the next */
    int32_t occupied_above;
    uint32_t phase;      /* enum fv_grid_phase */
    uint32_t point;      /* the next one */
    uint32_t begun;      /* an update came since the last fv_grid_forget */
    uint16_t begin;      /* the step at which the ray comes into the image */
    uint8_t made, floor; /* the tables are filled; the ray has shown floor */
};

/* Counts are in FV_GRID_HEIGHT_ONE-ths of a point. No padding. */
struct fv_grid_height {
    int16_t top_mm, next_mm; /* a height that is known; one that would take its place */
    uint16_t top, next;      /* points that say so; below one: none */
};
enum { FV_GRID_HEIGHT_ONE = 256 };

struct fv_grid {
    struct fovea_grid_config config;
    struct fv_grid_state *state;
    int16_t *odds;    /* cell (x, y) of the odometry frame is at (x mod side, y mod side) */
    uint8_t *movable; /* where the last obstacle that was seen may move */
    uint8_t *marks;   /* of the update under way */
    struct fv_grid_height *heights; /* NULL: not wanted */
    double (*rays)[2];              /* cosine, sine */
    int8_t *percent;                /* probability by log-odds, from the least */
};

/* Errors begin with the member: "grid.range_m: ...". */
enum fovea_status fv_grid_check(const struct fovea_grid_config *config, struct fovea_error *error);
/* Take memory, which begins as zeros. Init-only. */
void fv_grid_carve(struct fv_grid *grid, const struct fovea_grid_config *config,
                   struct fv_arena *arena);

/* All that follows is real-time safe. */

/* Every cell becomes unknown; an update under way is dropped. */
void fv_grid_forget(struct fv_grid *grid);

/* Begin an update; false: the view is not usable, as fovea_grid_update says. */
bool fv_grid_begin(struct fv_grid *grid, const struct fovea_grid_view *view);
/* A piece of it: up to FV_GRID_LOOKUPS labels or FV_GRID_CELLS cells. `view` is the one that it
 * began with. True: the update is complete. */
enum { FV_GRID_LOOKUPS = 1200, FV_GRID_CELLS = 6144 };
bool fv_grid_advance(struct fv_grid *grid, const struct fovea_grid_view *view);

/* Begin a scan, then fill `ranges_m` in pieces of up to FV_GRID_SCAN_STEPS steps of rays; true: it
 * is complete. */
enum { FV_GRID_SCAN_STEPS = 7680 };
void fv_grid_scan_begin(struct fv_grid *grid);
bool fv_grid_scan_advance(struct fv_grid *grid, float *ranges_m);

/* A view made ready to look up what its mask shows. */
struct fv_grid_look {
    const struct fovea_grid_view *view;
    double from[2];            /* below the camera */
    double R[3][3], up[3];     /* of the camera from the odometry frame; a floor point at `from` */
    struct fv_project project; /* of the camera; its pixels are those of the mask */
    double inverse_height;     /* of the camera over the floor below it */
    double beside[2];          /* of the camera from the body */
    double outside;            /* (x^2 + y^2) / z^2 from which on nothing is in the image */
    uint8_t of[256];           /* label of a byte of the mask */
    uint8_t least;             /* confidence of floor, 0 to 255, below which it is FV_GRID_UNSURE */
};

/* A label beside enum fovea_grid_label, and no byte: floor, perhaps. */
enum { FV_GRID_UNSURE = 256 };

/* With a `least` of 0. */
struct fv_grid_look fv_grid_look_of(const struct fovea_grid_view *view);
/* The label of a point of the camera's frame, whatever the floor of the view; -1: it is not in the
 * image. */
int fv_grid_label(const struct fv_grid_look *look, const double point[3]);

/* Fill rows of cells as fovea_grid_cells does, row_first to row_first + row_count - 1. */
void fv_grid_rows(const struct fv_grid *grid, int64_t row_first, int64_t row_count, int8_t *cells);
/* The same of heights and their counts (NULL: not wanted); grid->heights is not NULL. */
void fv_grid_height_rows(const struct fv_grid *grid, int64_t row_first, int64_t row_count,
                         int16_t *heights_mm, uint8_t *counts);
struct fovea_grid_place fv_grid_place(const struct fv_grid *grid);

#ifdef __cplusplus
}
#endif
#endif
