/* The path after all optimisation: every posed frame hangs on a keyframe, and where that keyframe
 * ends up is known at the end only.
 *
 * Frames go through a wait-free ring to the watching thread and from there to a temporary file. A
 * keyframe that leaves the map is remembered relative to the nearest one that stays, so that
 * corrections still reach it; at the end all are put in place, last left first. Each map (worlds
 * differ after a reset) gets its own scale (fovea_map_scale_get), or where it is gone the one that
 * was known with its last frame. Memory beside the ring: 128
 * bytes per keyframe that ever was. */
#ifndef FOVEA_APP_RUN_FINAL_PATH_H
#define FOVEA_APP_RUN_FINAL_PATH_H

#include <stdbool.h>

#include "app/run/trajectory.h"
#include "fovea/fovea.h"

struct fv_final;

/* FOVEA_ERROR_INPUT: `path` cannot be written. FOVEA_ERROR_SYSTEM: no temporary file. Init-only.
 * Every other function takes NULL for "not asked for". */
enum fovea_status fv_final_open(const char *path, struct fv_final **final,
                                struct fovea_error *error);

/* A posed frame, whose published sample is given too. Loop thread, real-time safe; what there is no
 * room for is counted. */
void fv_final_frame(struct fv_final *final, const struct fovea_pose *pose,
                    const struct fv_trajectory_sample *published);
/* Look at the map's keyframes; after every step and every work. Loop thread, real-time safe. */
void fv_final_observe(struct fv_final *final, const struct fovea *rt);
/* Whether there is room for an iteration. Loop thread. */
bool fv_final_room(struct fv_final *final);

/* Take what has come. The thread that opened it; at least four times a second. */
void fv_final_drain(struct fv_final *final);

/* The loop has ended: let the runtime's jobs come to an end, put all in place, write the file and
 * sum up as fv_trajectory_finish does. */
void fv_final_finish(struct fv_final *final, struct fovea *rt,
                     struct fv_trajectory_summary *summary);
void fv_final_close(struct fv_final *final);

#endif
