/* What a seed of the campaign of fault schedules stands for: a source, the faults upon it, and the
 * row of the report that it counts in. Everything follows from the seed.
 *
 * Seeds go round the kinds of faults (seed modulo their number; the last is two kinds at once,
 * each by a schedule of its own; of ten rounds in twenty that turn is the stamps' that stand still,
 * a kind that came later: all other seeds stand for what they always stood for), and for each kind
 * round the sources: six in ten simulated, three recordings of the simulated camera, whose truth is
 * that of the same camera played beside, and one a real recording, whose truth is known to
 * centimetres only and which is not judged by it. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_PLAN_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_PLAN_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/fault/fault.h"

enum {
    FAULTS_FRAMES = 200,
    FAULTS_WIDTH = 320,
    FAULTS_HEIGHT = 240,
    FAULTS_KIND_MIXED = FV_FAULT_OF_CALLS, /* a call that stalls harms no frame */
    FAULTS_KIND_HOLD,                      /* FV_FAULT_hold */
    FAULTS_KINDS,
    FAULTS_TEXT = 1024
};

enum faults_origin { FAULTS_SIMULATED, FAULTS_RECORDED, FAULTS_REAL };

struct faults_plan {
    uint64_t seed;
    uint32_t kind; /* enum fv_fault_kind up to FAULTS_KIND_MIXED, or one of those above */
    enum faults_origin origin;
    char source[FAULTS_TEXT]; /* URI without faults */
    char twin[FAULTS_TEXT];   /* of a recording: the simulated camera with its truth; "": none */
    bool wheels;              /* wheel odometry gives the scale */
    uint32_t count;           /* of faults */
    char options[2][256];     /* of each, the inner one first */
    char uri[FAULTS_TEXT + 600];
};

/* `folder` holds the recordings. */
void faults_plan_draw(uint64_t seed, const char *folder, struct faults_plan *plan);
const char *faults_kind_name(uint32_t kind);

/* The recordings of the simulated camera, by number: the name of the file, and the URI to record
 * it from. False: there is none of this number. */
bool faults_recording(uint32_t number, char name[64], char uri[256]);

#endif
