#include "calibrate/report.h"

#include "calibrate/outputs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fovea/fovea.h"
#include "support/calibration.h"
extern "C" {
#include "support/json.h"
#include "support/output.h"
}

namespace calibrate
{
namespace
{

void number(FILE *file, double value)
{
    if (std::isfinite(value))
        fprintf(file, "%.6g", value);
    else
        fprintf(file, "null");
}

void write_parameters(const Report &report, FILE *file)
{
    const Solution &solution = report.solution;
    fprintf(file, "  \"parameters\": {");
    for (int i = 0; parameter_name(solution.model, i) != nullptr; i++)
        fprintf(file, "%s\n    \"%s\": {\"value\": %.12g, \"stdev\": %.6g}", i == 0 ? "" : ",",
                parameter_name(solution.model, i), parameter(solution.camera, i),
                solution.stdev[(size_t)i]);
    fprintf(file, "\n  },\n");
}

void write_views(const Report &report, FILE *file)
{
    const Solution &solution = report.solution;
    fprintf(file, "  \"views\": [");
    for (size_t v = 0; v < report.views.size(); v++) {
        fprintf(file, "%s\n    {\"name\": ", v == 0 ? "" : ",");
        fv_json_text(file, report.views[v].name.c_str());
        const bool used = v < solution.left_out.size() && solution.left_out[v].empty();
        fprintf(file, ", \"used\": %s", used ? "true" : "false");
        if (used) {
            fprintf(file, ", \"rms_px\": ");
            number(file, view_rms_px(solution, v));
        } else {
            fprintf(file, ", \"reason\": ");
            fv_json_text(file, v < solution.left_out.size() ? solution.left_out[v].c_str()
                                                            : report.views[v].left_out.c_str());
        }
        if (!report.views[v].corners.empty())
            fprintf(file, ", \"edge_px\": %.2f", report.views[v].edge_px);
        fprintf(file, "}");
    }
    fprintf(file, "\n  ],\n  \"corners_left_out\": [");
    for (size_t i = 0; i < solution.corners_left_out.size(); i++) {
        const LeftOut &corner = solution.corners_left_out[i];
        fprintf(file, "%s\n    {\"view\": ", i == 0 ? "" : ",");
        fv_json_text(file, report.views[(size_t)corner.view].name.c_str());
        fprintf(file, ", \"column\": %d, \"row\": %d, \"error_px\": ",
                corner.corner % report.board.point_columns(),
                corner.corner / report.board.point_columns());
        number(file, corner.error_px);
        fprintf(file, "}");
    }
    fprintf(file, "\n  ],\n");
}

void write_uncertainty(const Uncertainty &map, FILE *file)
{
    fprintf(file, "  \"projection_stdev_px\": [");
    for (int j = 0; j < map.rows; j++) {
        fprintf(file, "%s\n    [", j == 0 ? "" : ",");
        for (int i = 0; i < map.columns; i++) {
            if (i > 0) fprintf(file, ", ");
            number(file, map.stdev_px[(size_t)(j * map.columns + i)]);
        }
        fprintf(file, "]");
    }
    fprintf(file, "\n  ],\n");
}

void write_json(const Report &report, FILE *file)
{
    const Solution &solution = report.solution;
    const Verdict &verdict = report.verdict;
    fprintf(file, "{\n  \"verdict\": \"%s\",\n  \"reasons\": [", grade_name(verdict.grade));
    for (size_t i = 0; i < verdict.reasons.size(); i++) {
        fprintf(file, "%s\n    {\"grade\": \"%s\", \"text\": ", i == 0 ? "" : ",",
                grade_name(verdict.reasons[i].grade));
        fv_json_text(file, verdict.reasons[i].text.c_str());
        fprintf(file, "}");
    }
    fprintf(file, "\n  ],\n  \"date\": \"%s\",\n", report.date.c_str());
    if (solution.corners_used > 0) {
        fprintf(file,
                "  \"model\": \"%s\",\n  \"width\": %d,\n  \"height\": %d,\n  \"rms_px\": %.6g,\n"
                "  \"noise_px\": %.6g,\n  \"held_out_rms_px\": ",
                model_name(solution.model), solution.camera.width, solution.camera.height,
                solution.rms_px, solution.noise_px);
        number(file, report.held_out_px >= 0 ? report.held_out_px : NAN);
        fprintf(file, ",\n  \"cross_solve_px\": ");
        number(file, report.cross_solve_px);
        fprintf(file,
                ",\n  \"views_used\": %d,\n  \"corners_used\": %d,\n  \"coverage\": %.3f,\n"
                "  \"tilt_rad\": %.4f,\n  \"projection_stdev_seen_px\": %.6g,\n",
                verdict.views_used, solution.corners_used, verdict.coverage, verdict.tilt_rad,
                verdict.uncertainty_seen_px);
        fprintf(file, "  \"residual_pattern\": ");
        number(file, verdict.residual_pattern);
        fprintf(file, ",\n");
        write_parameters(report, file);
        write_uncertainty(solution.uncertainty, file);
    }
    write_views(report, file);
    fprintf(file, "  \"compared\": [");
    for (size_t i = 0; i < report.compared.size(); i++) {
        const Compared &one = report.compared[i];
        fprintf(file, "%s\n    {\"model\": \"%s\", \"solved\": %s, \"rms_px\": ", i == 0 ? "" : ",",
                model_name(one.model), one.solved ? "true" : "false");
        number(file, one.solved ? one.rms_px : NAN);
        fprintf(file, ", \"held_out_rms_px\": ");
        number(file, one.solved && one.held_out_px >= 0 ? one.held_out_px : NAN);
        fprintf(file, "}");
    }
    fprintf(file, "\n  ]\n}\n");
}

fv_calibration_record record_of(const Report &report)
{
    const Solution &solution = report.solution;
    fv_calibration_record record = {};
    snprintf(record.program, sizeof record.program, "fovea-calibrate %s", FOVEA_VERSION);
    snprintf(record.date, sizeof record.date, "%s", report.date.c_str());
    snprintf(record.verdict, sizeof record.verdict, "%s", grade_name(report.verdict.grade));
    snprintf(record.camera_id, sizeof record.camera_id, "%s", report.camera_id.c_str());
    snprintf(record.board, sizeof record.board, "%s", report.board.text().c_str());
    record.views = report.verdict.views_used;
    record.corners = solution.corners_used;
    record.rms_px = solution.rms_px;
    record.noise_px = solution.noise_px;
    record.held_out_rms_px = std::max(0., report.held_out_px);
    record.projection_stdev_px = report.verdict.uncertainty_seen_px;
    for (int i = 0; parameter_name(solution.model, i) != nullptr; i++)
        record.stdev[i] = solution.stdev[(size_t)i];
    return record;
}

template <typename Write> fovea_status write_file(const char *path, fovea_error *error, Write write)
{
    fv_output output;
    const fovea_status status = fv_output_open(&output, path, FV_OUTPUT_WHOLE, error);
    if (status != FOVEA_OK) return status;
    FILE *stream = fv_output_stream(&output);
    if (stream == nullptr) {
        fv_output_discard(&output);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: out of memory", path);
    }
    write(stream);
    return fv_output_close(&output, error);
}

} // namespace

double parameter(const fovea_camera &camera, int i)
{
    const double first[4] = {camera.fx, camera.fy, camera.cx, camera.cy};
    return i < 4 ? first[i] : camera.k[i - 4];
}

double view_rms_px(const Solution &solution, size_t view)
{
    double squares = 0;
    int count = 0;
    for (size_t c = 0; c < solution.errors_px[view].size(); c++) {
        bool used = true;
        for (const LeftOut &corner : solution.corners_left_out)
            used &= corner.view != (int)view || corner.corner != (int)c;
        if (!used) continue;
        squares += solution.errors_px[view][c] * solution.errors_px[view][c];
        count++;
    }
    return count > 0 ? std::sqrt(squares / count) : NAN;
}

fovea_status report_camera(const Report &report, const char *path, fovea_error *error)
{
    fv_calibration calibration = {};
    calibration.camera = report.solution.camera;
    snprintf(calibration.name, sizeof calibration.name, "%s", report.camera_name.c_str());
    calibration.record = record_of(report);
    return fv_calibration_write(path, FV_CALIBRATION_ROS, &calibration, nullptr, error);
}

fovea_status report_json(const Report &report, const char *path, fovea_error *error)
{
    return write_file(path, error, [&](FILE *file) { write_json(report, file); });
}

void report_print(const Report &report)
{
    const Solution &solution = report.solution;
    print_left_out(pictures_left_out(report.views, solution.left_out));
    for (const LeftOut &corner : solution.corners_left_out)
        printf("left out  %s: corner %d of row %d, %.2f px off\n",
               report.views[(size_t)corner.view].name.c_str(),
               corner.corner % report.board.point_columns() + 1,
               corner.corner / report.board.point_columns() + 1, corner.error_px);
    if (solution.corners_used > 0) {
        printf("model     %s, %d x %d, %d pictures, %d corners\n", model_name(solution.model),
               solution.camera.width, solution.camera.height, report.verdict.views_used,
               solution.corners_used);
        for (int i = 0; parameter_name(solution.model, i) != nullptr; i++)
            printf("%-9s %12.6g +- %.2g\n", parameter_name(solution.model, i),
                   parameter(solution.camera, i), solution.stdev[(size_t)i]);
        printf("error     %.3f px RMS", solution.rms_px);
        if (report.held_out_px >= 0) printf(", %.3f px in pictures held out", report.held_out_px);
        printf("\nprojection within %.2f px (one standard deviation) where corners were seen\n",
               report.verdict.uncertainty_seen_px);
        if (std::isfinite(report.cross_solve_px))
            printf("halves    project up to %.2f px apart, solved each by itself\n",
                   report.cross_solve_px);
    }
    print_verdict(report.verdict);
}

void print_verdict(const Verdict &verdict)
{
    for (const Reason &reason : verdict.reasons)
        printf("%-9s %s\n", grade_name(reason.grade), reason.text.c_str());
    printf("verdict   %s\n", grade_name(verdict.grade));
}

} // namespace calibrate
