/* The picture of a run with faults: its path from above beside the truth, and the error of each
 * tracking frame over time in units of its covariance, with the faults behind. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_DRAWING_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_DRAWING_H

#include "judge.h"

void faults_draw(const char *path, const struct faults_plan *plan, const struct faults_play *play,
                 const double nees[FAULTS_GIVEN_MAX], const struct faults_verdict *verdict);

#endif
