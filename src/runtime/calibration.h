/* Whether the calibration still fits: measures of the lens (odometry/lens.h) over frames and
 * windows, the verdict, and its message with the residuals by part of the image.
 *
 * A change is believed when one of two measured frames in a row shows it far beyond its limit and
 * standard deviation and the other agrees, or when FV_CALIBRATION_FRAMES show a smaller one: the
 * map follows a lens that moved within a few frames. It is a lens that moved if the map was
 * steady for FV_CALIBRATION_STEADY measured frames since it was begun, entered or merged: by a
 * wrong calibration a young map is bent, and frames that see it from elsewhere show that as a
 * change too. A mismatch is believed when FV_CALIBRATION_WINDOWS windows in a row say it. A verdict
 * stands until the next reset; of a wrong calibration the largest value is kept. The limits are at
 * the top of calibration.c. */
#ifndef FOVEA_RUNTIME_CALIBRATION_H
#define FOVEA_RUNTIME_CALIBRATION_H

#include "fovea/fovea.h"
#include "odometry/odometry.h"
#include "odometry/lens.h"
#include "runtime/frame_id.h"

enum { FV_CALIBRATION_FRAMES = 3, FV_CALIBRATION_WINDOWS = 3, FV_CALIBRATION_STEADY = 50 };

/* No addresses and no padding: copied and hashed as bytes. */
struct fv_calibration_state {
    struct fv_frame_id frame; /* the last one measured */
    uint64_t frames;          /* measured since the last reset */
    uint64_t looked_newest;   /* newest keyframe of the last window */
    double change[FV_CALIBRATION_FRAMES], sigma[FV_CALIBRATION_FRAMES];
    double mismatch[FV_CALIBRATION_WINDOWS], mismatch_sigma[FV_CALIBRATION_WINDOWS];
    double error2, error2_fitted, points; /* fading sums, as are the next two */
    double part_sum_px[FV_MAP_PARTS][2], part_points[FV_MAP_PARTS];
    double value;              /* of the measure that the verdict stands on */
    uint32_t changes, windows; /* how many of the above hold; the newest last */
    uint32_t map_id, reset_counter;
    uint32_t verdict, cause; /* enum fovea_calibration_state, enum fovea_calibration_cause */
    uint32_t due;            /* a message is to be sent */
    uint32_t steady;         /* measured frames of this map, before a change is believed */
};

struct fv_calibration {
    struct fv_calibration_state *state; /* persistent */
    struct fv_lens_window window;
};

void fv_calibration_carve(struct fv_calibration *calibration, struct fv_arena *persistent,
                          struct fv_arena *job);
/* Forget all frames, windows and the verdict. Real-time safe, as all that follows. */
void fv_calibration_reset(struct fv_calibration *calibration);
/* A frame was processed. */
void fv_calibration_frame(struct fv_calibration *calibration, const struct fv_odometry *odometry,
                          const struct fv_frame_id *frame);
/* Whether a window can be worked on or a message is due, and one unit of the former. */
bool fv_calibration_waiting(const struct fv_calibration *calibration,
                            const struct fv_odometry *odometry);
void fv_calibration_unit(struct fv_calibration *calibration, const struct fv_odometry *odometry);
void fv_calibration_get(const struct fv_calibration *calibration, struct fovea_calibration *found);
/* The message that is due, which then is due no more; returns its bytes. */
uint32_t fv_calibration_encode(struct fv_calibration *calibration, uint8_t *buffer,
                               size_t capacity);

#endif
