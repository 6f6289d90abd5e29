#include "calibrate/rig_report.h"

#include "calibrate/compare.h"
#include "calibrate/html.h"
#include "calibrate/json_text.h"
#include "calibrate/outputs.h"
#include "calibrate/report.h"
#include "calibrate/report_page.h"
#include "calibrate/rigid.h"
#include "fovea/fovea.h"
#include "support/calibration.h"

namespace calibrate
{
namespace
{

constexpr double DEGREE = 57.29577951308232;

/* Root of the sum of the squares of three deviations. */
double size_of(const double stdev[3])
{
    return std::sqrt(stdev[0] * stdev[0] + stdev[1] * stdev[1] + stdev[2] * stdev[2]);
}

bool is_placed(const RigReport &report)
{
    return report.inertial.has_value() && report.inertial->solved;
}

fv_calibration calibration_of(const RigReport &report, size_t k)
{
    const RigCamera &camera = report.solution.cameras[k];
    fv_calibration calibration = {};
    fv_calibration_record &record = calibration.record;
    calibration.camera = camera.camera;
    calibration.has_T_body_cam = true;
    const std::array<double, 12> T = T_first_cam(camera);
    std::copy(T.begin(), T.end(), calibration.T_body_cam);
    std::copy(camera.stdev.begin(), camera.stdev.end(), record.place_stdev);
    snprintf(record.program, sizeof record.program, "fovea-calibrate %s", FOVEA_VERSION);
    snprintf(record.date, sizeof record.date, "%s", report.date.c_str());
    snprintf(record.verdict, sizeof record.verdict, "%s", grade_name(report.verdict.grade));
    snprintf(record.camera_id, sizeof record.camera_id, "%s", report.inputs[k].source.c_str());
    snprintf(record.board, sizeof record.board, "%s", report.board.text().c_str());
    if (is_placed(report)) {
        const InertialSolution &found = report.inertial->solution;
        const Rigid T_first_cam = rigid_of(camera.T_cam_first).inverse();
        const std::array<double, 12> T_imu_cam = rows_of(found.T_cam_imu.inverse() * T_first_cam);
        const std::array<double, 6> stdev = place_stdev(found, T_first_cam, camera.stdev);
        std::copy(T_imu_cam.begin(), T_imu_cam.end(), calibration.T_body_cam);
        std::copy(stdev.begin(), stdev.end(), record.place_stdev);
        calibration.has_time_shift = true;
        calibration.time_shift_s = found.time_shift_s;
        record.time_shift_stdev_s = found.time_shift_stdev_s;
    }
    record.views = camera.views_used;
    record.corners = camera.corners_used;
    record.rms_px = camera.rms_px;
    record.noise_px = report.solution.noise_px;
    for (int i = 0; parameter_name(camera.model, i) != nullptr; i++)
        record.stdev[i] = camera.lens_stdev[(size_t)i];
    return calibration;
}

std::string camera_json(const RigReport &report, size_t k)
{
    const RigCamera &camera = report.solution.cameras[k];
    std::string text = "\n    {\"source\": " + json_string(report.inputs[k].source) +
                       formatted(", \"model\": \"%s\", \"lens_held\": %s,\n     \"parameters\": {",
                                 model_name(camera.model), camera.held ? "true" : "false");
    for (int i = 0; parameter_name(camera.model, i) != nullptr; i++)
        text += formatted("%s\"%s\": {\"value\": ", i > 0 ? ", " : "",
                          parameter_name(camera.model, i)) +
                json_number(parameter(camera.camera, i)) +
                ", \"stdev\": " + json_number(camera.lens_stdev[(size_t)i]) + "}";
    const std::array<double, 12> T = T_first_cam(camera);
    text += "},\n     \"T_cam0_cam\": " + json_numbers(T.data(), T.size()) +
            ",\n     \"rotation_stdev_rad\": " + json_numbers(camera.stdev.data(), 3) +
            ", \"translation_stdev_m\": " + json_numbers(camera.stdev.data() + 3, 3) +
            ",\n     \"transfer_stdev_px\": " + json_number(camera.transfer_px) +
            ",\n     \"rms_px\": " + json_number(camera.rms_px) +
            ", \"alone_rms_px\": " + json_number(camera.alone_rms_px) +
            formatted(", \"views_used\": %d, \"views_shared\": %d, \"corners_used\": %d,",
                      camera.views_used, camera.views_shared, camera.corners_used);
    text += "\n     \"left_out\": [";
    bool first = true;
    for (size_t v = 0; v < report.solution.left_out[k].size(); v++) {
        if (report.solution.left_out[k][v].empty()) continue;
        text += std::string(first ? "" : ", ") +
                "{\"name\": " + json_string(report.inputs[k].views[v].name) +
                ", \"reason\": " + json_string(report.solution.left_out[k][v]) + "}";
        first = false;
    }
    return text + "]}";
}

std::string cameras_section(const RigReport &report)
{
    std::string text = "<div class=\"wide\"><table>\n<tr><th>camera</th><th>pictures</th>"
                       "<th>model</th><th class=\"number\">focal length, px</th>"
                       "<th class=\"number\">RMS, px</th><th class=\"number\">by itself, px</th>"
                       "<th class=\"number\">shared pictures</th></tr>\n";
    for (size_t k = 0; k < report.solution.cameras.size(); k++) {
        const RigCamera &camera = report.solution.cameras[k];
        text += formatted("<tr><td>cam%zu</td><td>", k) + escaped(report.inputs[k].source) +
                formatted("</td><td>%s%s</td><td class=\"number\">", model_name(camera.model),
                          camera.held ? ", from its file" : "") +
                datum("fx", camera.camera.fx, "%.6g") + "</td><td class=\"number\">" +
                datum("camera_rms_px", camera.rms_px) + "</td><td class=\"number\">" +
                datum("alone_rms_px", camera.alone_rms_px) + "</td><td class=\"number\">" +
                datum("views_shared", camera.views_shared, "%.0f") + "</td></tr>\n";
    }
    return section("cameras", "Cameras", text + "</table></div>\n");
}

std::string places_section(const RigReport &report)
{
    std::string rows;
    for (size_t k = 1; k < report.solution.cameras.size(); k++) {
        const RigCamera &camera = report.solution.cameras[k];
        rows += place_rows(pose_of(rigid_of(camera.T_cam_first).inverse()), camera.stdev,
                           formatted("<td>cam%zu</td>", k));
    }
    return section("places", "Places",
                   "<p>Places before cam0 (x right, y down, z forward). Standard deviations of "
                   "turns are about the camera's own axes.</p>\n" +
                       values_table(rows, "<th>camera</th>"));
}

LeftOutPictures rig_left_out(const RigReport &report)
{
    LeftOutPictures all;
    for (size_t k = 0; k < report.solution.left_out.size(); k++)
        for (const auto &picture :
             pictures_left_out(report.inputs[k].views, report.solution.left_out[k],
                               "cam" + std::to_string(k) + ", "))
            all.push_back(picture);
    return all;
}

} // namespace

std::array<double, 12> T_first_cam(const RigCamera &camera)
{
    return rows_of(rigid_of(camera.T_cam_first).inverse());
}

fovea_status rig_chain(const RigReport &report, bool kalibr, std::string &text, fovea_error *error)
{
    std::vector<fv_calibration> cameras;
    for (size_t k = 0; k < report.solution.cameras.size(); k++)
        cameras.push_back(calibration_of(report, k));
    std::vector<char> written(FV_CALIBRATION_CHAIN_BYTES_MAX);
    const fovea_status status = fv_calibration_chain_text(
        cameras.data(), cameras.size(), is_placed(report), kalibr, written.data(), error);
    if (status == FOVEA_OK) text = written.data();
    return status;
}

std::string rig_json(const RigReport &report)
{
    std::string text = "{\n" + json_verdict(report.verdict, report.date) +
                       "  \"board\": " + json_string(report.board.text());
    if (!report.solution.cameras.empty())
        text += ",\n  \"rms_px\": " + json_number(report.solution.rms_px) +
                ",\n  \"noise_px\": " + json_number(report.solution.noise_px) +
                ",\n  \"epipolar_rms_px\": " +
                json_number(report.epipolar_px >= 0 ? report.epipolar_px : NAN) +
                ",\n  \"held_out_epipolar_rms_px\": " +
                json_number(report.held_out_px >= 0 ? report.held_out_px : NAN) +
                formatted(",\n  \"corners_used\": %d", report.solution.corners_used);
    if (report.inertial) text += ",\n  \"imu\": " + inertial_json(*report.inertial);
    text += ",\n  \"cameras\": [";
    for (size_t k = 0; k < report.solution.cameras.size(); k++)
        text += (k > 0 ? "," : "") + camera_json(report, k);
    return text + "\n  ]\n}\n";
}

std::string rig_html(const RigReport &report)
{
    const bool solved = !report.solution.cameras.empty();
    const char *next =
        report.verdict.grade == Grade::pass
            ? "Use the file. When a camera or its mount was touched, calibrate again."
        : report.verdict.grade == Grade::doubtful
            ? "Do what the reasons ask for and calibrate again. Until then use the file "
              "only where its errors do not matter."
            : "No file was written. Do what the reasons ask for and calibrate again.";
    std::string text = verdict_header("Calibration of a rig", report.verdict, next,
                                      "Board: " + report.board.text() + ". Date: " + report.date);
    if (!solved) return html_page(report.verdict.grade, text);
    if (report.solution.cameras.size() > 1)
        text += section(
            "errors", "Errors",
            "<p>RMS " + datum("rms_px", report.solution.rms_px) + " px over " +
                datum("corners_used", report.solution.corners_used, "%.0f") +
                " corners. Distance from the epipolar lines " +
                datum("epipolar_rms_px", report.epipolar_px >= 0 ? report.epipolar_px : NAN) +
                " px RMS, in pictures held out " +
                datum("held_out_epipolar_rms_px",
                      report.held_out_px >= 0 ? report.held_out_px : NAN) +
                " px. Noise of one coordinate " + datum("noise_px", report.solution.noise_px) +
                " px.</p>\n");
    text += cameras_section(report);
    if (report.solution.cameras.size() > 1) text += places_section(report);
    if (report.inertial) text += inertial_section(*report.inertial);
    text += left_out_section(rig_left_out(report));
    return html_page(report.verdict.grade, text);
}

void rig_print(const RigReport &report)
{
    const RigSolution &solution = report.solution;
    print_left_out(rig_left_out(report));
    for (size_t k = 0; k < solution.cameras.size(); k++) {
        const RigCamera &camera = solution.cameras[k];
        printf("cam%zu      %s: %s%s, focal length %.6g", k, report.inputs[k].source.c_str(),
               model_name(camera.model), camera.held ? " from its file" : "", camera.camera.fx);
        if (!camera.held) printf(" +- %.2g", camera.lens_stdev[0]);
        printf(", %d pictures, %.3f px RMS\n", camera.views_used, camera.rms_px);
        if (k == 0) continue;
        const Pose place = pose_of(rigid_of(camera.T_cam_first).inverse());
        printf("          at %.2f %.2f %.2f mm (+- %.2g) before cam0, turned by %.3f %.3f %.3f "
               "degrees (+- %.2g)\n",
               1e3 * place[3], 1e3 * place[4], 1e3 * place[5], 1e3 * size_of(&camera.stdev[3]),
               DEGREE * place[0], DEGREE * place[1], DEGREE * place[2],
               DEGREE * size_of(camera.stdev.data()));
    }
    if (report.epipolar_px >= 0) {
        printf("epipolar  %.3f px RMS from the lines", report.epipolar_px);
        if (report.held_out_px >= 0) printf(", %.3f px in pictures held out", report.held_out_px);
        printf("\n");
    }
    if (report.inertial) inertial_print(*report.inertial);
    print_verdict(report.verdict);
}

} // namespace calibrate
