/* fovea-calibrate rig: pictures of a board by several cameras to their places and a verdict. */
#include "calibrate/command.h"
#include "calibrate/compare.h"
#include "calibrate/choose_model.h"
#include "calibrate/heard.h"
#include "calibrate/inertial_command.h"
#include "calibrate/outputs.h"
#include "calibrate/pictures.h"
#include "calibrate/rig_report.h"
#include "calibrate/text_file.h"
#include "fovea/rig.h"
#include "support/text.h"
extern "C" {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow" /* it has a struct and a function of one name */
#include "support/files.h"
#pragma GCC diagnostic pop
#include "support/say.h"
}

#include <algorithm>

namespace calibrate
{
namespace
{

constexpr int VIEWS_MAX_DEFAULT = 40, FOLDS = 5;

struct Given {
    std::string target, model = "auto", format = "rig", out, json, report, views;
    std::vector<std::string> sources, cameras;
    InertialGiven imu;
};

int check(const Given &given, Board &board, std::vector<Model> &models, int64_t &views_max)
{
    const std::string first = given.sources.empty() ? "" : given.sources[0];
    int status = source_check("rig", first, given.target, board);
    if (status != FV_EXIT_OK) return status;
    if (given.sources.size() > FOVEA_CAMERAS_MAX)
        return fv_say_wrong("fovea-calibrate rig: found --source %zu times, expected at most %d "
                            "cameras",
                            given.sources.size(), FOVEA_CAMERAS_MAX);
    for (size_t i = 0; i < given.sources.size(); i++)
        for (size_t j = 0; j < i; j++)
            if (given.sources[i] == given.sources[j] ||
                fv_files_same(given.sources[i].c_str(), given.sources[j].c_str(), true))
                return fv_say_wrong("--source: found %s twice, expected one for each camera",
                                    given.sources[i].c_str());
    if (!models_of(given.model, models))
        return fv_say_wrong("--model: found '%s', expected auto, radtan, rational or equidistant",
                            given.model.c_str());
    if (given.format != "rig" && given.format != "kalibr")
        return fv_say_wrong("--format: found '%s', expected rig or kalibr", given.format.c_str());
    if (given.format == "kalibr") {
        models.erase(std::remove(models.begin(), models.end(), Model::rational), models.end());
        if (models.empty())
            return fv_say_wrong("--model: found rational with --format kalibr, expected auto, "
                                "radtan or equidistant: Kalibr has no such lens");
    }
    status = check_inertial(given.imu, given.sources);
    if (status != FV_EXIT_OK) return status;
    status = views_check(given.views, VIEWS_MAX_DEFAULT, 2, views_max);
    if (status != FV_EXIT_OK) return status;
    std::vector<NamedFile> read;
    for (const std::string &source : given.sources)
        read.push_back({"--source", source, true});
    for (const std::string &camera : given.cameras)
        read.push_back({"--camera", camera, false});
    if (!given.imu.file.empty()) read.push_back({"--imu-file", given.imu.file, false});
    return files_check({{"--out", given.out, false},
                        {"--imu-out", given.imu.out, false},
                        {"--json", given.json, false},
                        {"--report", given.report, false}},
                       read);
}

/* Whether Kalibr's files can hold the lens. */
bool kalibr_has(const RigInput &input)
{
    const double *k = input.camera.k;
    return input.model == Model::equidistant || (k[4] == 0 && k[5] == 0 && k[6] == 0 && k[7] == 0);
}

/* Whether files are given for all cameras of the rig, or for none. */
fovea_status expect_cameras(const Given &given, size_t cameras, fovea_error *error)
{
    if (given.cameras.empty() || given.cameras.size() == cameras) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "fovea-calibrate rig: found --camera %zu times, expected once for each "
                           "of %zu cameras, or not at all",
                           given.cameras.size(), cameras);
}

/* The lens of each camera from its file, where files are given. */
int read_cameras(const Given &given, std::vector<RigInput> &inputs)
{
    fovea_error error;
    if (given.cameras.empty()) return FV_EXIT_OK;
    if (expect_cameras(given, inputs.size(), &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    for (size_t k = 0; k < inputs.size(); k++) {
        RigInput &input = inputs[k];
        const int status =
            read_camera(given.cameras[k], input.camera.width, input.camera.height, input.camera);
        if (status != FV_EXIT_OK) return status;
        input.model = model_of(input.camera);
        if (given.format == "kalibr" && !kalibr_has(input))
            return fv_say_wrong("--format: found kalibr with the lens of %s, which has k3 to k6, "
                                "expected rig",
                                given.cameras[k].c_str());
        input.held = true;
    }
    return FV_EXIT_OK;
}

/* A lens from a file against the camera's own pictures, where these know it well enough to say.
 * Returns its error in them. */
double judge_file(const Board &board, const Collection &collection, const RigInput &input, size_t k,
                  Verdict &lenses)
{
    const Comparison comparison = compare(input.camera, board, collection.views);
    if (!comparison.solved || comparison.uncertainty_px > PROJECTION_PASS_PX)
        return comparison.rms_px;
    for (const Reason &reason : comparison.verdict.reasons)
        add_reason(lenses, reason.grade, "cam%zu: %s", k, reason.text.c_str());
    return comparison.rms_px;
}

/* A camera by itself, as the only one of a rig. */
RigCamera camera_alone(const fovea_camera &lens, Model model, double rms_px)
{
    RigCamera camera;
    camera.camera = lens;
    camera.model = model;
    camera.rms_px = camera.alone_rms_px = std::max(0., rms_px);
    return camera;
}

/* The best model of each camera whose lens is not known, from its own pictures. The verdict on each
 * lens is a part of the rig's. Returns the cameras by themselves; width 0: not solved. */
std::vector<RigCamera> choose_models(const std::vector<Model> &models,
                                     const std::vector<Collection> &collections, RigReport &report,
                                     Verdict &lenses)
{
    std::vector<RigCamera> cameras;
    for (size_t k = 0; k < report.inputs.size(); k++) {
        RigInput &input = report.inputs[k];
        if (input.held) {
            const double rms_px = judge_file(report.board, collections[k], input, k, lenses);
            cameras.push_back(camera_alone(input.camera, input.model, rms_px));
            cameras.back().held = true;
            continue;
        }
        Report alone;
        SolveOptions options;
        options.four_coefficients = input.four_coefficients;
        alone.board = report.board;
        solve_and_judge(collections[k], models, options, alone);
        input.model = alone.solution.model;
        for (const Reason &reason : alone.verdict.reasons)
            add_reason(lenses, reason.grade, "cam%zu: %s", k, reason.text.c_str());
        const Solution &found = alone.solution;
        cameras.push_back(camera_alone(found.camera, found.model, found.rms_px));
        cameras.back().lens_stdev = found.stdev;
        cameras.back().corners_used = found.corners_used;
        cameras.back().views_used = alone.verdict.views_used;
    }
    return cameras;
}

/* One camera is the rig, whose inertial sensor is to be placed. */
void take_alone(RigReport &report, const RigCamera &alone, const Verdict &lens)
{
    report.verdict = lens;
    if (alone.camera.width > 0) report.solution.cameras = {alone};
    report.solution.left_out.resize(1);
    report.solution.rms_px = alone.rms_px;
    report.solution.corners_used = alone.corners_used;
}

void solve_and_judge_rig(RigReport &report, const Verdict &lenses)
{
    std::string error;
    if (!solve_rig(report.board, report.inputs, report.solution, error)) {
        report.solution = RigSolution();
        report.verdict = lenses;
        add_reason(report.verdict, Grade::fail, "%s", error.c_str());
        return;
    }
    report.epipolar_px = epipolar_rms_px(report.inputs, report.solution, {});
    report.held_out_px = held_out_epipolar_px(report.board, report.inputs, report.solution, FOLDS);
    report.verdict = judge_rig(report.inputs, report.solution, report.held_out_px);
    for (const Reason &reason : lenses.reasons)
        add_reason(report.verdict, reason.grade, "%s", reason.text.c_str());
}

int write(const Given &given, const RigReport &report)
{
    int status = write_verdict(given.json, rig_json(report), given.report, rig_html(report));
    const bool placed = report.inertial && report.inertial->solved;
    if (status == FV_EXIT_OK && placed && result_wanted(given.imu.out, report.verdict.grade))
        status = write_text(given.imu.out,
                            inertial_file(*report.inertial, report.verdict.grade, report.date));
    if (status != FV_EXIT_OK || !result_wanted(given.out, report.verdict.grade)) return status;
    std::string text;
    fovea_error error;
    if (rig_chain(report, given.format == "kalibr", text, &error) != FOVEA_OK)
        return fv_say_wrong("%s: %s", given.out.c_str(), error.text);
    return write_text(given.out, text);
}

int collect_pictures(const Given &given, int views_max, RigReport &report, Moving &moving,
                     std::vector<Collection> &collections)
{
    fovea_error why;
    if (given.imu.wanted()) {
        report.inertial.emplace();
        return collect_inertial(given.imu, given.sources[0], report.board, views_max, moving,
                                collections, *report.inertial);
    }
    const auto as_many = [&](const std::vector<Collection> &sizes, fovea_error *error) {
        return expect_cameras(given, sizes.size(), error);
    };
    if (given.sources.size() > 1 && expect_cameras(given, given.sources.size(), &why) != FOVEA_OK)
        return fv_say_wrong("%s", why.text);
    if (collect_rig(given.sources, report.board, views_max, collections, &why, as_many) != FOVEA_OK)
        return fv_say_wrong("%s", why.text);
    return FV_EXIT_OK;
}

} // namespace

int command_rig(int argc, char **argv)
{
    Given given;
    const std::vector<Option> options = {
        {"source", "URI|FOLDER", nullptr,
         "source with several cameras; or, once for each camera, a folder or a recording",
         &given.sources},
        {"target", "BOARD", &given.target,
         "board, as chessboard:9x6:0.025; see --man for the others", nullptr},
        {"camera", "FILE", nullptr,
         "once for each camera, in their order: its camera file; its lens is kept", &given.cameras},
        {"model", "MODEL", &given.model,
         "of cameras without a file: auto (default), radtan, rational or equidistant", nullptr},
        {"out", "FILE", &given.out, "write the camchain; not when the verdict is fail", nullptr},
        {"format", "FORMAT", &given.format,
         "of --out: rig (default: a camchain with all coefficients), or kalibr, which has no k3 to "
         "k6",
         nullptr},
        {"json", "FILE", &given.json, "write the verdict with all its numbers", nullptr},
        {"report", "FILE", &given.report, "write the verdict as one HTML file", nullptr},
        {"views", "N", &given.views, "pictures to take of each camera from a URI (default 40)",
         nullptr},
        {"imu", "SENSOR", &given.imu.sensor,
         "place an inertial sensor too, which moves with the cameras before the board: source (its "
         "samples come with the pictures), iio:NAME or lcm:CHANNEL",
         nullptr},
        {"imu-file", "FILE", &given.imu.file,
         "noise densities and rate of the sensor, as 'fovea-calibrate imu' writes them (default: "
         "what the source states)",
         nullptr},
        {"imu-out", "FILE", &given.imu.out,
         "write the sensor's file for the key imu_file; not when the verdict is fail", nullptr},
        {"seconds", "N", &given.imu.seconds,
         "with --imu, of a live source: how long pictures are taken (default 60)", nullptr},
        {"lcm-url", "URL", &given.imu.lcm_url, lcm_url_help, nullptr},
        {"listen", "WHOM", &given.imu.listen, listen_help, nullptr},
    };
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "", 0, operands, &status)) return status;
    RigReport report;
    std::vector<Model> models;
    int64_t views_max;
    status = check(given, report.board, models, views_max);
    if (status != FV_EXIT_OK) return status;
    std::vector<Collection> collections;
    Moving moving;
    status = collect_pictures(given, (int)views_max, report, moving, collections);
    if (status != FV_EXIT_OK) return status;
    for (size_t k = 0; k < collections.size(); k++) {
        RigInput input;
        input.source = given.sources.size() > 1 ? given.sources[k] : given.sources[0];
        if (collections[k].width == 0)
            return fv_say_wrong("%s: found no board in its pictures, expected %s",
                                input.source.c_str(), report.board.text().c_str());
        leave_out_blurred(collections[k].views);
        input.camera.width = collections[k].width;
        input.camera.height = collections[k].height;
        input.views = collections[k].views;
        input.four_coefficients = given.format == "kalibr";
        report.inputs.push_back(input);
    }
    status = read_cameras(given, report.inputs);
    if (status != FV_EXIT_OK) return status;
    report.date = now_text();
    Verdict lenses;
    const std::vector<RigCamera> alone = choose_models(models, collections, report, lenses);
    if (alone.size() == 1)
        take_alone(report, alone[0], lenses);
    else
        solve_and_judge_rig(report, lenses);
    if (report.inertial) place_inertial(moving, report);
    rig_print(report);
    status = write(given, report);
    if (status != FV_EXIT_OK) return status;
    return report.verdict.grade == Grade::fail ? FV_EXIT_FAILED : FV_EXIT_OK;
}

} // namespace calibrate
