/* From views to the verdict. */
#ifndef FOVEA_CALIBRATE_CHOOSE_MODEL_H
#define FOVEA_CALIBRATE_CHOOSE_MODEL_H

#include "calibrate/pictures.h"
#include "calibrate/report.h"

namespace calibrate
{

/* Solve by each of `models`, keep the one with the least error in pictures held out, and judge it.
 * Fills what `report` has of views, solution and verdict; its board is given. */
void solve_and_judge(const Collection &collection, const std::vector<Model> &models,
                     const SolveOptions &options, Report &report);

} // namespace calibrate
#endif
