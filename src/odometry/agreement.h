/* Agreement of the pictures with the map: whether what is matched without the map fits it.
 *
 * Every landmark of a map fits it, because what did not fit is gone. A map that hangs on things
 * that move, or that began bent, therefore looks well from inside. So each keyframe is matched with
 * the one before by descriptors alone, and the matches are held against the relative pose that the
 * map gives the two. Where the map is right their errors are noise, and the rest (mismatches,
 * things that move) is far off; where it is wrong, errors of all sizes occur. Three measures, of
 * counts that fall by .7 per keyframe, in pixels of the match's level:
 *
 *   near   of the matches within 4 px of their epipolar place, those within 1 px. Right maps of the
 *          recordings have .84 and more, of sim:road .8; wrong ones fall below
 *   fit    of all matches, those within 4 px: fewer, and a good part of the picture moves another
 *          way than the map says. Right maps of the recordings have .8 and more
 *   known  of all matches, those of which the later feature sees a landmark. Where a map hangs on a
 *          car that drives along, the world's landmarks are lost from keyframe to keyframe, though
 *          epipolar lines, which are the same for both, say nothing. Few known and near not high
 *          are a doubt (tools/evaluate/sim_road.md)
 *
 * And by the same matches whether the map's motion is off alike from pair to pair (motion_bias.h):
 * what is bent between the world and a thing that moves looks well by all three.
 *
 * In doubt no pose is `tracking`. Where near or fit are low or the motion is biased, after three
 * keyframes, the map is given up, and where near or fit stay in doubt for four: all of it while it
 * is young, later the keyframes since the measures were last good and without a hint of a bias.
 * They leave the map one per unit, and are not entered again meanwhile.
 *
 * A map is suspect, and its poses are withheld, where it follows one given up, since what misled
 * one misleads the next, and where its first keyframe agrees less clearly than on the recordings
 * (near below .9, or doubt). It is published with its first pose that is confident by all else,
 * after two keyframes that leave no doubt and no hint of a bias; or after three of these that agree
 * clearly (near of .93).
 *
 * By one camera alone a map is unsure where three poses in a row were weak, for whatever reason,
 * and near is below .88: then weak poses are withheld until one is confident or near is higher. So
 * are those in what is left of a map that was given up, until it is checked. On odd seeds of
 * sim:road maps beyond the bars of error fell from 15 to 6 by that, on even ones from 20 to 13, on
 * fifty fresh ones from 11 to 7; poses by 4 to 5 %, and by 7.5 % on the fresh ones, all of them
 * weak. What else measures (distances, a gyro) holds a map where its pictures do not.
 *
 * A job in units: FV_AGREEMENT_UNIT features are matched in each. Two more fit the pair's motion,
 * after all other work on the map; where the next keyframe comes before, as on a road, the fit goes
 * on beside the matching of that, a quarter in a unit, and is done before that pair is judged.
 * Real-time safe, no addresses in the state.
 */
#ifndef FOVEA_ODOMETRY_AGREEMENT_H
#define FOVEA_ODOMETRY_AGREEMENT_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "kernels/kernels.h"
#include "odometry/motion_bias.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_AGREEMENT_UNIT = 64 };

/* A pair of keyframes in work, and the measure. */
struct fv_agreement_state {
    bool busy;
    uint32_t slot, generation, before, before_generation;
    uint32_t next;                 /* sampled feature of the earlier one */
    float near, about, all, known; /* faded counts: within 1 px and 4 px, all, of landmarks */
    uint32_t checks;               /* of this map */
    uint32_t doubts;   /* of the last checks, how many in a row had near or fit too low */
    uint64_t bad_from; /* keyframes from this number on came after the measure was last good */
    bool fresh;        /* made from several views, and not checked yet */
    bool left;         /* keyframes of it were given up, and the rest was not checked since */
    bool suspect;      /* its poses are withheld until it is confirmed */
    uint32_t weak;     /* of the last poses, how many in a row were not confident; at most 3 */
    bool dropping;     /* keyframes of drop_map from number drop_from on are to go */
    uint32_t drop_map;
    uint64_t drop_from;
    uint32_t matches; /* of the pair whose motion is being fitted; 0: there is none */
    struct fv_motion_bias_state motion_bias;
};

struct fv_agreement {
    uint32_t *nearest, *second; /* job part: by sampled feature, as hamming_two_u8 leaves them */
    uint16_t *distance;         /* job part: by feature of the later keyframe */
    struct fv_motion_bias_match *matches; /* job part: of the last pair matched */
};

enum fv_agreement_verdict { FV_AGREEMENT_GOOD, FV_AGREEMENT_WEAK, FV_AGREEMENT_CONTRADICTED };

struct fv_odometry;

void fv_agreement_carve(struct fv_agreement *agreement, uint32_t features_max,
                        struct fv_arena *job);

/* What the keyframes of this map say so far; good while there are none. */
enum fv_agreement_verdict fv_agreement_verdict(const struct fv_agreement_state *state);
/* Enough keyframes agree well: what pulls at single poses moves, and the map is not bent. */
bool fv_agreement_settled(const struct fv_agreement_state *state);
/* A pose of this map is confident by all else; or it is weak. */
void fv_agreement_confirm(struct fv_agreement_state *state);
void fv_agreement_note_weak(struct fv_agreement_state *state);
/* Whether poses are to be withheld, since the map is suspect. */
bool fv_agreement_withholds(struct fv_agreement_state *state);
/* Whether poses are weak, and have been for long, and the pictures do not agree clearly. */
bool fv_agreement_unsure(const struct fv_agreement_state *state);
/* Another map: nothing is known of it. */
void fv_agreement_forget(struct fv_agreement_state *state);
/* The same for a map that was just made from several views: its first check counts. */
void fv_agreement_begin(struct fv_agreement_state *state);

/* A keyframe was finished: to be checked against its parent. Replaces one that still waits. */
void fv_odometry_agreement_queue(struct fv_odometry *odometry, uint32_t keyframe);
/* Whether there is work, whether what is left of a pair can wait for all other work on the map, and
 * one unit. */
bool fv_odometry_agreement_waiting(const struct fv_odometry *odometry);
bool fv_odometry_agreement_fits(const struct fv_odometry *odometry);
void fv_odometry_agreement_unit(struct fv_odometry *odometry, const struct fv_kernels *kernels);

/* The map is contradicted: the camera is lost, and keyframes begin to go. */
void fv_odometry_give_up(struct fv_odometry *odometry);
/* Whether a keyframe is on its way out. */
bool fv_odometry_given_up(const struct fv_odometry *odometry, uint32_t slot);

#ifdef __cplusplus
}
#endif
#endif
