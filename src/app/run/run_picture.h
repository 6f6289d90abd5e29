/* The picture of a run: the path beside the truth, the map from above, the tracks and the timings,
 * on one sheet. Off the loop thread; the heap is used.
 *
 * The path is seen along the direction in which it extends least; the tracks are drawn as where
 * across the image each was, over time, one colour per class; the map is the one with most
 * keyframes. What a run does not have is left out. */
#ifndef FOVEA_APP_RUN_RUN_PICTURE_H
#define FOVEA_APP_RUN_RUN_PICTURE_H

#include "support/canvas.h"
#include "app/run/report.h"
#include "app/run/trails.h"
#include "app/run/trajectory.h"

struct fv_run_picture {
    const struct fv_report *report;
    const struct fv_trajectory_summary *path;
    const struct fv_trails *trails;
};

/* FOVEA_ERROR_SYSTEM: the picture could not be written, or there is no memory for it. `rt` has
 * ended its last call. */
enum fovea_status fv_run_picture(const char *path, const struct fv_run_picture *picture,
                                 struct fovea *rt, const struct fovea_config *config,
                                 struct fovea_error *error);

enum {
    FV_PATH_PANEL_WIDTH = 760,
    FV_PATH_PANEL_HEIGHT = 830,
    FV_REPORT_PANEL_WIDTH = 1000,
    FV_REPORT_PANEL_HEIGHT = 620
};

/* ---- parts, one file each: on a canvas that they make, to be freed by the caller.
 * FOVEA_ERROR_SYSTEM: no memory. ---- */

enum fovea_status fv_path_panel(struct fv_canvas *canvas, const char *name,
                                const struct fv_trajectory_summary *summary);
enum fovea_status fv_report_panel(struct fv_canvas *canvas, const struct fv_report *report);

#endif
