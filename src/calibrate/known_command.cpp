#include "calibrate/known_command.h"

#include "calibrate/html.h"
#include "calibrate/json_text.h"
#include "calibrate/outputs.h"
#include "calibrate/report_page.h"
#include "calibrate/text_file.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{

std::vector<Option> known_options(KnownGiven &given, const std::vector<Option> &own,
                                  const char *out_help, const char *views_help)
{
    std::vector<Option> options = {
        {"source", "URI|FOLDER", &given.source,
         "camera or recording, or folder of PNG, JPEG and BMP files"},
        {"target", "BOARD", &given.target,
         "board, as chessboard:9x6:0.025; see --man for the others"},
        {"camera", "FILE", &given.camera, "camera file of the camera"},
    };
    options.insert(options.end(), own.begin(), own.end());
    options.insert(options.end(),
                   {{"out", "FILE", &given.out, out_help},
                    {"json", "FILE", &given.json, "write the verdict with all its numbers"},
                    {"report", "FILE", &given.report, "write the verdict as one HTML file"},
                    {"views", "N", &given.views, views_help}});
    return options;
}

int known_check(const char *command, const KnownGiven &given, Board &board)
{
    const int status = source_check(command, given.source, given.target, board);
    if (status != FV_EXIT_OK || !given.camera.empty()) return status;
    return fv_say_wrong("fovea-calibrate %s: found no --camera, expected the camera's file "
                        "('fovea-calibrate camera' makes one)",
                        command);
}

int known_files(const KnownGiven &given, const std::vector<NamedFile> &more)
{
    std::vector<NamedFile> read = {{"--source", given.source, true},
                                   {"--camera", given.camera, false}};
    read.insert(read.end(), more.begin(), more.end());
    return files_check({{"--out", given.out, false},
                        {"--json", given.json, false},
                        {"--report", given.report, false}},
                       read);
}

void known_begin(const KnownGiven &given, const Collection &collection, KnownReport &report)
{
    report.views = collection.views;
    report.camera = given.camera;
    report.source = given.source;
    report.date = now_text();
}

std::string known_json(const KnownReport &report)
{
    return "{\n" + json_verdict(report.verdict, report.date) +
           "  \"camera\": " + json_string(report.camera) +
           ",\n  \"board\": " + json_string(report.board.text());
}

std::string known_header(const KnownReport &report, const char *title, const char *keys,
                         const std::string &origin)
{
    const std::string next =
        report.verdict.grade == Grade::fail
            ? "No file was written. Do what the reasons ask for and calibrate again."
            : formatted("Put the %s of the file into the configuration. When the camera's mount "
                        "was touched, calibrate again.",
                        keys);
    return verdict_header(title, report.verdict, next,
                          "Pictures: " + report.source + "." + origin +
                              " Camera: " + report.camera + ". Board: " + report.board.text() +
                              ". Date: " + report.date);
}

std::string T_body_cam_key(const std::array<double, 12> &T)
{
    std::string text = "T_body_cam:\n";
    for (size_t i = 0; i < 12; i += 4)
        text += formatted("- [%.17g, %.17g, %.17g, %.17g]\n", T[i], T[i + 1], T[i + 2], T[i + 3]);
    return text;
}

int known_write(const KnownGiven &given, const KnownReport &report, const std::string &json,
                const std::string &html, const std::string &configuration)
{
    int status = write_verdict(given.json, json, given.report, html);
    if (status == FV_EXIT_OK && result_wanted(given.out, report.verdict.grade))
        status = write_text(given.out, configuration);
    if (status != FV_EXIT_OK) return status;
    return report.verdict.grade == Grade::fail ? FV_EXIT_FAILED : FV_EXIT_OK;
}

} // namespace calibrate
