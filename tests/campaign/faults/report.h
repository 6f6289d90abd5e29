/* The verdicts of all runs: a table by kind of fault, and whether the bars hold. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_REPORT_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_REPORT_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "child.h"
#include "judge.h"

/* What the map was good for that the run left behind, on the same place without faults. */
enum faults_map {
    FAULTS_MAP_NONE, /* the run never had a pose: there is no map */
    FAULTS_MAP_LOCALISES,
    FAULTS_MAP_TRACKS, /* not found again in it within 60 frames, but a run with it loaded tracks */
    FAULTS_MAP_USELESS
};

struct faults_result {
    uint64_t seed;
    uint32_t kind;
    uint32_t end;  /* enum faults_end; nothing below is known unless FAULTS_WELL */
    uint32_t bare; /* tracking frames of the same source without faults; 0: not known */
    uint32_t map;  /* enum faults_map */
    uint32_t endless;
    int32_t descriptors;
    uint64_t heap_calls;
    struct faults_verdict verdict;
};

/* What a campaign judges. A sample judges all runs together, false confidence by `wrong_max` and
 * the other shares with one run more that may miss, and no rates of single kinds. */
struct faults_bars {
    bool sample;
    double wrong_max; /* of judged frames */
};

/* Write the table to `out` as Markdown; `bare` holds the runs without faults. True: all bars hold;
 * lines say which do not. */
bool faults_report(FILE *out, const struct faults_result *results, uint32_t count,
                   const struct faults_verdict *bare, const struct faults_bars *bars);

#endif
