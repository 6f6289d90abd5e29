/* fovea-calibrate check: an old camera file against new pictures. */
#include <cmath>
#include <cstdio>

#include "calibrate/command.h"
#include "calibrate/compare.h"
#include "calibrate/pictures.h"
#include "calibrate/report.h"
#include "calibrate/outputs.h"
#include "support/calibration.h"
extern "C" {
#include "support/json.h"
#include "support/output.h"
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr int VIEWS_MAX = 40;

void print(const std::string &file, const fv_calibration &calibration,
           const std::vector<View> &views, const Comparison &comparison)
{
    const Solution &fresh = comparison.fresh;
    print_left_out(
        pictures_left_out(views, comparison.solved ? fresh.left_out : std::vector<std::string>()));
    printf("camera    %s: %s, %d x %d", file.c_str(), model_name(model_of(calibration.camera)),
           calibration.camera.width, calibration.camera.height);
    if (calibration.record.date[0] != '\0') printf(", of %s", calibration.record.date);
    if (calibration.record.rms_px > 0) printf(", %.3f px RMS then", calibration.record.rms_px);
    printf("\n");
    if (comparison.solved) {
        printf("pictures  %d of %zu used\n", comparison.verdict.views_used, views.size());
        printf("error     %.3f px RMS by the file, %.3f px by a camera fitted to these pictures\n",
               comparison.rms_px, fresh.rms_px);
        printf("change    focal length %+.2f %%, projection up to %.2f px (+- %.2f) where corners "
               "were seen\n",
               100 * comparison.focal_change, comparison.difference_px,
               comparison.difference_stdev_px);
    }
    print_verdict(comparison.verdict);
}

std::string number(double value)
{
    char text[40];
    snprintf(text, sizeof text, "%.6g", value);
    return std::isfinite(value) ? text : "null";
}

int write_json(const std::string &path, const std::string &file, const Comparison &comparison)
{
    fv_output output;
    fovea_error error;
    if (fv_output_open(&output, path.c_str(), FV_OUTPUT_WHOLE, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    FILE *stream = fv_output_stream(&output);
    if (stream == nullptr) {
        fv_output_discard(&output);
        return fv_say_failed("%s: out of memory", path.c_str());
    }
    fprintf(stream,
            "{\n  \"verdict\": \"%s\",\n  \"camera\": ", grade_name(comparison.verdict.grade));
    fv_json_text(stream, file.c_str());
    fprintf(stream, ",\n  \"reasons\": [");
    for (size_t i = 0; i < comparison.verdict.reasons.size(); i++) {
        const Reason &reason = comparison.verdict.reasons[i];
        fprintf(stream, "%s\n    {\"grade\": \"%s\", \"text\": ", i == 0 ? "" : ",",
                grade_name(reason.grade));
        fv_json_text(stream, reason.text.c_str());
        fprintf(stream, "}");
    }
    fprintf(stream, "\n  ],\n  \"solved\": %s", comparison.solved ? "true" : "false");
    if (comparison.solved)
        fprintf(stream,
                ",\n  \"views_used\": %d,\n  \"rms_px\": %s,\n  \"fresh_rms_px\": %s,\n"
                "  \"difference_px\": %s,\n  \"difference_stdev_px\": %s,\n  \"focal_change\": %s",
                comparison.verdict.views_used, number(comparison.rms_px).c_str(),
                number(comparison.fresh.rms_px).c_str(), number(comparison.difference_px).c_str(),
                number(comparison.difference_stdev_px).c_str(),
                number(comparison.focal_change).c_str());
    fprintf(stream, "\n}\n");
    if (fv_output_close(&output, &error) != FOVEA_OK) return fv_say_failed("%s", error.text);
    return FV_EXIT_OK;
}

} // namespace

int command_check(int argc, char **argv)
{
    std::string source, target, json, which;
    const std::vector<Option> options = {
        {"source", "URI|FOLDER", &source,
         "camera or recording, or folder of PNG, JPEG and BMP files"},
        {"target", "BOARD", &target, "board, as chessboard:9x6:0.025; see --man for the others"},
        {"which", "CAMERA", &which, "camera of a file with several, as cam1 (default: the first)"},
        {"json", "FILE", &json, "write the verdict with its numbers"},
    };
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "CAMERA", 1, operands, &status)) return status;
    Board board;
    fv_calibration calibration;
    fovea_error error;
    Collection collection;
    status = source_check("check", source, target, board);
    if (status != FV_EXIT_OK) return status;
    const std::string &file = operands[0];
    if (fv_calibration_read(file.c_str(), which.empty() ? nullptr : which.c_str(), &calibration,
                            &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    if (collect(source, board, Refinement::OWN, VIEWS_MAX, collection, &error,
                size_of(calibration.camera, file)) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    if (collection.width == 0)
        return fv_say_wrong("%s: found no board in its pictures, expected %s", source.c_str(),
                            board.text().c_str());
    if (fv_calibration_fit(&calibration.camera, collection.width, collection.height, false,
                           file.c_str(), &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    leave_out_blurred(collection.views);
    const Comparison comparison = compare(calibration.camera, board, collection.views);
    print(file, calibration, collection.views, comparison);
    if (!json.empty() && (status = write_json(json, file, comparison)) != FV_EXIT_OK) return status;
    return comparison.verdict.grade == Grade::fail ? FV_EXIT_FAILED : FV_EXIT_OK;
}

} // namespace calibrate
