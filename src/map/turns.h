/* The turns that a gyro measured between keyframes, for the window (window.h).
 *
 * Turns from frame to frame are joined until a frame becomes a keyframe; the last FV_TURNS_MAX of
 * what then stands between two keyframes are kept by their numbers, so that they outlast keyframes
 * that are given up. A frame to which no measured turn leads breaks the chain, and until turns are
 * measured again none is used. Turns by samples of another clock are forgotten. A change of the map
 * does not matter to them.
 *
 * State, no addresses. Real-time safe: a call takes at most FV_TURNS_MAX joins of some 100
 * multiplications. */
#ifndef FOVEA_MAP_TURNS_H
#define FOVEA_MAP_TURNS_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/turn.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_TURNS_MAX = 64 };

/* What is known of the gyro: its bias in the camera's axes, rad/s, with one standard deviation. */
struct fv_gyro_known {
    double bias[3], bias_sigma; /* 0: nothing is */
    struct fv_turn_doubt doubt;
    int64_t moved_ns; /* by which the samples' clock was moved */
};

struct fv_turns {
    struct fv_gyro_known gyro; /* at the last measured turn */
    struct fv_turn since;      /* from the last keyframe to the last frame */
    uint64_t joined;           /* all turns between these two were measured */
    uint64_t number;           /* of that keyframe */
    uint64_t first, count;     /* a ring, oldest first */
    struct fv_turn_link {
        uint64_t from, to; /* numbers of keyframes */
        struct fv_turn turn;
    } links[FV_TURNS_MAX];
};

/* Forget all. */
void fv_turns_forget(struct fv_turns *turns);
/* A frame; NULL: no measured turn leads there from the frame before. */
void fv_turns_follow(struct fv_turns *turns, const struct fv_turn *since_last,
                     const struct fv_gyro_known *gyro);
/* The last frame became the keyframe of this number. */
void fv_turns_keyframe(struct fv_turns *turns, uint64_t number);
/* From one keyframe to a later one. False: not measured, or no longer known. */
bool fv_turns_between(const struct fv_turns *turns, uint64_t from, uint64_t to,
                      struct fv_turn *turn);

#ifdef __cplusplus
}
#endif
#endif
