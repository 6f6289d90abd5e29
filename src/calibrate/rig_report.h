/* What `fovea-calibrate rig` leaves: the camchain, the verdict as JSON, HTML and text. */
#ifndef FOVEA_CALIBRATE_RIG_REPORT_H
#define FOVEA_CALIBRATE_RIG_REPORT_H

#include <optional>

#include "calibrate/inertial_report.h"
#include "calibrate/rig.h"
#include "fovea/status.h"

namespace calibrate
{

struct RigReport {
    Board board;
    std::vector<RigInput> inputs;
    RigSolution solution; /* without cameras: not solved */
    Verdict verdict;
    double epipolar_px = -1, held_out_px = -1; /* negative: not known */
    std::optional<Inertial> inertial;          /* with --imu */
    std::string date;                          /* ISO 8601, UTC */
};

/* T_first_cam of a camera, row by row: its place where the first camera is the body. */
std::array<double, 12> T_first_cam(const RigCamera &camera);

/* A camchain; with an inertial sensor that is placed it holds T_cam_imu and the time shift.
 * `kalibr`: FOVEA_ERROR_UNSUPPORTED where Kalibr's format cannot hold a lens. */
fovea_status rig_chain(const RigReport &report, bool kalibr, std::string &text, fovea_error *error);
std::string rig_json(const RigReport &report);
std::string rig_html(const RigReport &report);
void rig_print(const RigReport &report); /* on stdout */

} // namespace calibrate
#endif
