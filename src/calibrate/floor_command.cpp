/* fovea-calibrate floor: height and tilt of a camera over the floor. */
#include <cstdio>

#include "calibrate/floor.h"
#include "calibrate/html.h"
#include "calibrate/json_text.h"
#include "calibrate/known_command.h"
#include "calibrate/outputs.h"
#include "calibrate/report.h"
#include "calibrate/report_page.h"
#include "support/text.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr int VIEWS_MAX_DEFAULT = 10;
constexpr double DEGREE = 57.29577951308232;

struct Given : KnownGiven {
    std::string thickness = "0";
};

struct FloorReport : KnownReport {
    FloorSolution solution;
};

int check(const Given &given, Board &board, double &thickness_m, int64_t &views_max)
{
    int status = known_check("floor", given, board);
    if (status != FV_EXIT_OK) return status;
    if (!fv_text_number(given.thickness.c_str(), &thickness_m) || thickness_m < 0 ||
        thickness_m > 1)
        return fv_say_wrong("--thickness: found '%s', expected metres from 0 to 1",
                            given.thickness.c_str());
    status = views_check(given.views, VIEWS_MAX_DEFAULT, 1, views_max);
    return status == FV_EXIT_OK ? known_files(given) : status;
}

/* Keys of Fovea's configuration. */
std::string configuration(const FloorReport &report)
{
    const FloorSolution &s = report.solution;
    return formatted(
               "# The camera over the floor, by fovea-calibrate floor of %s: %s.\n"
               "# Height +- %.4f m, tilt +- %.3f degrees, roll +- %.3f degrees. The body is on the "
               "floor\n# right below the camera: x ahead, y left, z up.\n",
               report.date.c_str(), grade_name(report.verdict.grade), s.height_stdev_m,
               DEGREE * s.tilt_stdev_rad, DEGREE * s.roll_stdev_rad) +
           T_body_cam_key(s.T_body_cam) +
           formatted("scale:\n  source: camera_height\n  camera_height_m: %.17g\n", s.height_m);
}

std::string json(const FloorReport &report)
{
    const FloorSolution &s = report.solution;
    std::string text = known_json(report);
    if (s.views_used > 0)
        text += ",\n  \"camera_height_m\": {\"value\": " + json_number(s.height_m) +
                ", \"stdev\": " + json_number(s.height_stdev_m) +
                "},\n  \"tilt_rad\": {\"value\": " + json_number(s.tilt_rad) +
                ", \"stdev\": " + json_number(s.tilt_stdev_rad) +
                "},\n  \"roll_rad\": {\"value\": " + json_number(s.roll_rad) +
                ", \"stdev\": " + json_number(s.roll_stdev_rad) +
                "},\n  \"T_body_cam\": " + json_numbers(s.T_body_cam.data(), 12) +
                ",\n  \"rms_px\": " + json_number(s.rms_px) +
                ",\n  \"alone_rms_px\": " + json_number(s.alone_rms_px) +
                formatted(",\n  \"views_used\": %d,\n  \"corners_used\": %d", s.views_used,
                          s.corners_used);
    text += ",\n";
    return text + json_left_out(pictures_left_out(report.views, s.left_out));
}

std::string html(const FloorReport &report)
{
    const FloorSolution &s = report.solution;
    std::string page = known_header(report, "The camera over the floor", "keys");
    if (s.views_used > 0)
        page += section(
            "floor", "Height and tilt",
            "<p>Height " + datum("camera_height_m", s.height_m, "%.4f") + " m +- " +
                datum("camera_height_m-stdev", s.height_stdev_m, "%.2g") +
                ", tilt below the horizon " + datum("tilt_degrees", DEGREE * s.tilt_rad, "%.3f") +
                " degrees +- " + datum("tilt_degrees-stdev", DEGREE * s.tilt_stdev_rad, "%.2g") +
                ", roll to the right " + datum("roll_degrees", DEGREE * s.roll_rad, "%.3f") +
                " degrees +- " + datum("roll_degrees-stdev", DEGREE * s.roll_stdev_rad, "%.2g") +
                ".</p>\n<p>RMS error " + datum("rms_px", s.rms_px) + " px over " +
                datum("views_used", s.views_used, "%.0f") +
                " pictures with all boards on one plane, " + datum("alone_rms_px", s.alone_rms_px) +
                " px with each by itself.</p>\n");
    page += left_out_section(pictures_left_out(report.views, s.left_out));
    return html_page(report.verdict.grade, page);
}

void print(const FloorReport &report)
{
    const FloorSolution &s = report.solution;
    print_left_out(pictures_left_out(report.views, s.left_out));
    if (s.views_used > 0)
        printf("height    %.4f m +- %.2g\ntilt      %.3f degrees below the horizon +- %.2g\n"
               "roll      %.3f degrees to the right +- %.2g\n"
               "error     %.3f px RMS in %d pictures, %.3f px with each board by itself\n",
               s.height_m, s.height_stdev_m, DEGREE * s.tilt_rad, DEGREE * s.tilt_stdev_rad,
               DEGREE * s.roll_rad, DEGREE * s.roll_stdev_rad, s.rms_px, s.views_used,
               s.alone_rms_px);
    print_verdict(report.verdict);
}

} // namespace

int command_floor(int argc, char **argv)
{
    Given given;
    const std::vector<Option> options =
        known_options(given,
                      {{"thickness", "METRES", &given.thickness,
                        "of the board: its printed side over the floor (default 0)"}},
                      "write keys of Fovea's configuration; not when the verdict is fail",
                      "pictures to take from a URI (default 10)");
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "", 0, operands, &status)) return status;
    FloorReport report;
    double thickness_m;
    int64_t views_max;
    status = check(given, report.board, thickness_m, views_max);
    if (status != FV_EXIT_OK) return status;
    Collection collection;
    fovea_camera camera;
    status =
        collect_known(given.source, given.camera, report.board, (int)views_max, collection, camera);
    if (status != FV_EXIT_OK) return status;
    known_begin(given, collection, report);
    std::string error;
    if (solve_floor(report.board, report.views, camera, thickness_m, report.solution, error))
        report.verdict = judge_floor(report.views, report.solution);
    else
        add_reason(report.verdict, Grade::fail, "%s", error.c_str());
    print(report);
    return known_write(given, report, json(report), html(report), configuration(report));
}

} // namespace calibrate
