/* The picture of a run on one sheet: what it was, the states of the pose over time, a frame with
 * features and objects, the map with the path and the truth, the objects over time and the timings.
 * What a run does not have is left out, and the rest takes its place. Off the loop thread; the heap
 * is used. */
#ifndef FOVEA_APP_RUN_RUN_PICTURE_H
#define FOVEA_APP_RUN_RUN_PICTURE_H

#include "app/run/pose_watch.h"
#include "app/run/report.h"
#include "app/run/snapshot.h"
#include "app/run/trails.h"
#include "app/run/trajectory.h"
#include "support/canvas.h"

struct fv_run_picture {
    const struct fv_report *report;
    const struct fv_trajectory_summary *path;
    const struct fv_trails *trails;
    const struct fv_watch *watch;             /* closed */
    const struct fv_snapshot_frame *snapshot; /* NULL: none */
};

/* FOVEA_ERROR_SYSTEM: the picture could not be written, or there is no memory for it. `rt` has
 * ended its last call. */
enum fovea_status fv_run_picture(const char *path, const struct fv_run_picture *picture,
                                 struct fovea *rt, const struct fovea_config *config,
                                 struct fovea_error *error);

/* ---- parts, one file each, drawn into an area of the sheet ----------------------------------- */

struct fv_area {
    int left, top, width, height;
};

enum {
    FV_PICTURE_INK = 0x222222,
    FV_PICTURE_PALE = 0x777777,
    FV_PICTURE_GRID = 0xe6e6e6,
    FV_PICTURE_OURS = 0x1f5fa8,
    FV_PICTURE_TRUTH = 0xe08214,
    FV_PICTURE_TITLE_PX = 17, /* of letters */
    FV_PICTURE_TEXT_PX = 13
};

/* The head of a part: its title, and below it what is left of the area. */
struct fv_area fv_picture_title(struct fv_canvas *canvas, const struct fv_area *area,
                                const char *title);
/* One entry of a legend, a square and its text, from `left` on; returns where the next begins. */
int fv_picture_legend(struct fv_canvas *canvas, int left, int base, uint32_t colour,
                      const char *text);
/* Distance between grid lines: 1, 2 or 5 times a power of ten, at most `lines` of them up to
 * `range`. */
double fv_picture_tick(double range, int lines);
/* Colour of an object, by its class. */
uint32_t fv_picture_class_colour(int32_t class_id);

void fv_picture_frame(struct fv_canvas *canvas, const struct fv_area *area,
                      const struct fv_run_picture *picture, const struct fovea *rt);
enum fovea_status fv_picture_map(struct fv_canvas *canvas, const struct fv_area *area,
                                 const struct fv_run_picture *picture, struct fovea *rt,
                                 const struct fovea_config *config);
void fv_picture_objects(struct fv_canvas *canvas, const struct fv_area *area,
                        const struct fv_run_picture *picture, const struct fovea *rt);
void fv_picture_times(struct fv_canvas *canvas, const struct fv_area *area,
                      const struct fv_run_picture *picture);

#endif
