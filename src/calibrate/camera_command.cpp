/* fovea-calibrate camera: pictures of a board to a camera file and a verdict. */
#include "calibrate/command.h"
#include "calibrate/choose_model.h"
#include "calibrate/live_page.h"
#include "calibrate/report_html.h"
#include "calibrate/text_file.h"
#include "calibrate/outputs.h"
#include "support/text.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr int VIEWS_MAX_DEFAULT = 40;

struct Given {
    std::string source, target, model = "auto", out, json, report, bend = "no", views,
                                corners = "own", name;
    PageOptions page;
};

int check(const Given &given, std::vector<Model> &models, Board &board, int64_t &views_max)
{
    int status = source_check("camera", given.source, given.target, board);
    if (status != FV_EXIT_OK) return status;
    if (!models_of(given.model, models))
        return fv_say_wrong("--model: found '%s', expected auto, radtan, rational or equidistant",
                            given.model.c_str());
    if (given.bend != "no" && given.bend != "yes")
        return fv_say_wrong("--bend: found '%s', expected yes or no", given.bend.c_str());
    if (given.corners != "own" && given.corners != "opencv")
        return fv_say_wrong("--corners: found '%s', expected own or opencv", given.corners.c_str());
    status = views_check(given.views, VIEWS_MAX_DEFAULT, 2, views_max);
    if (status != FV_EXIT_OK) return status;
    fovea_error error;
    if (!given.page.port.empty() &&
        expect_guidance(given.source, (int)views_max, &error) != FOVEA_OK)
        return fv_say_wrong("--page: %s", error.text);
    return files_check({{"--out", given.out, false},
                        {"--json", given.json, false},
                        {"--report", given.report, false}},
                       {{"--source", given.source, true},
                        {"--token", given.page.token, false},
                        {"--certificate", given.page.certificate, false},
                        {"--certificate-key", given.page.certificate_key, false}});
}

int write(const Given &given, const Report &report)
{
    fovea_error error;
    if (!given.json.empty() && report_json(report, given.json.c_str(), &error) != FOVEA_OK)
        return fv_say_failed("%s", error.text);
    if (!given.report.empty()) {
        const int status = write_text(given.report, report_html(report));
        if (status != FV_EXIT_OK) return status;
    }
    if (report.solution.corners_used == 0 || !result_wanted(given.out, report.verdict.grade))
        return FV_EXIT_OK;
    if (report_camera(report, given.out.c_str(), &error) != FOVEA_OK)
        return fv_say_failed("%s", error.text);
    return FV_EXIT_OK;
}

} // namespace

int source_check(const char *command, const std::string &source, const std::string &target,
                 Board &board)
{
    std::string error;
    if (source.empty())
        return fv_say_wrong("fovea-calibrate %s: found no --source, expected a folder of pictures "
                            "or the URI of a camera ('fovea cameras' lists them)",
                            command);
    if (target.empty())
        return fv_say_wrong("fovea-calibrate %s: found no --target, expected the board: %s",
                            command, board_forms);
    if (!board_parse(target, board, error)) return fv_say_wrong("%s", error.c_str());
    return FV_EXIT_OK;
}

int command_camera(int argc, char **argv)
{
    Given given;
    const std::vector<Option> options = {
        {"source", "URI|FOLDER", &given.source,
         "camera or recording, feed:SOCKET for the pictures of a run on this host (its key "
         "web.socket), which keeps its camera, or folder of PNG, JPEG and BMP files"},
        {"target", "BOARD", &given.target,
         "board, as chessboard:9x6:0.025; see --man for the others"},
        {"model", "MODEL", &given.model, "auto (default), radtan, rational or equidistant"},
        {"out", "FILE", &given.out, "write the camera file; not when the verdict is fail"},
        {"json", "FILE", &given.json, "write the verdict with all its numbers"},
        {"report", "FILE", &given.report, "write the verdict with pictures as one HTML file"},
        {"name", "NAME", &given.name, "name of the camera in its file"},
        {"views", "N", &given.views,
         "most pictures to take from a URI (default 40); fewer where the camera is certain before"},
        {"page", "PORT", &given.page.port,
         "serve picture, guidance and verdict as a page at this port of 127.0.0.1"},
        {"address", "ADDRESS", &given.page.address, "serve the page at this IPv4 address instead"},
        {"host", "HOST", &given.page.name,
         "a further name by which browsers call this host, such as robot.local"},
        {"token", "FILE", &given.page.token,
         "the page asks for a token of this file, which is made where there is none"},
        {"certificate", "FILE", &given.page.certificate,
         "serve the page by HTTPS with this certificate (PEM), as 'fovea-web --make-certificate' "
         "makes one"},
        {"certificate-key", "FILE", &given.page.certificate_key,
         "the key of the certificate (PEM)"},
        {"bend", "yes|no", &given.bend, "estimate how the board is bent (default no)"},
        {"corners", "own|opencv", &given.corners,
         "refinement of corners; opencv: cornerSubPix of 11, as OpenCV's calibration program"},
    };
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "", 0, operands, &status)) return status;
    std::vector<Model> models;
    int64_t views_max;
    Report report;
    status = check(given, models, report.board, views_max);
    LivePage page;
    if (status == FV_EXIT_OK) status = page.open(given.page, (int)views_max);
    if (status != FV_EXIT_OK) return status;
    Collection collection;
    fovea_error why;
    const Refinement refinement = given.corners == "own" ? Refinement::OWN : Refinement::OPENCV_11;
    Guidance guidance;
    guidance.models = models;
    if (!given.page.port.empty()) guidance.observer = &page;
    if (collect_guided(given.source, report.board, refinement, (int)views_max, guidance, collection,
                       &why) != FOVEA_OK)
        return fv_say_wrong("%s", why.text);
    report.camera_name = given.name;
    report.camera_id = given.source;
    report.date = now_text();
    SolveOptions how;
    how.bend = given.bend == "yes";
    page.solving();
    solve_and_judge(collection, models, how, report);
    const Interruption interruption; /* the verdict is printed and written in any case */
    page.done(report);
    report_print(report);
    status = write(given, report);
    page.linger(interruption);
    if (status != FV_EXIT_OK) return status;
    return report.verdict.grade == Grade::fail ? FV_EXIT_FAILED : FV_EXIT_OK;
}

} // namespace calibrate
