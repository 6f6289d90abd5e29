/* What a calibration leaves: the camera file, the verdict as JSON and as text. */
#ifndef FOVEA_CALIBRATE_REPORT_H
#define FOVEA_CALIBRATE_REPORT_H

#include "calibrate/calibrate.h"
#include "calibrate/verdict.h"

namespace calibrate
{

struct Compared {
    Model model;
    bool solved;
    double rms_px, held_out_px; /* held out negative: not known */
};

struct Report {
    Board board;
    std::vector<View> views;
    Solution solution;
    Verdict verdict;
    double held_out_px = -1;
    /* Of projection, between the cameras of every second view and of the others: worst where
     * corners were seen, with their rotation taken out; NaN: not known. */
    double cross_solve_px = NAN;
    std::vector<Compared> compared;
    std::string camera_name, date; /* date: ISO 8601, UTC */
    std::string camera_id;         /* where the pictures come from, as --source names it */
};

/* Of parameter_name's order. */
double parameter(const fovea_camera &camera, int i);

/* RMS of a view's corners that are used; NaN where there are none. */
double view_rms_px(const Solution &solution, size_t view);

/* Fovea's own camera file: ROS camera_info YAML, and a mapping `calibration` with date, errors and
 * standard deviations, which other readers ignore. */
fovea_status report_camera(const Report &report, const char *path, fovea_error *error);
fovea_status report_json(const Report &report, const char *path, fovea_error *error);
/* The verdict on stdout. */
void report_print(const Report &report);
void print_verdict(const Verdict &verdict); /* its last lines */

} // namespace calibrate
#endif
