#include "calibrate/report_html.h"

#include <algorithm>

#include "calibrate/html.h"
#include "calibrate/report_drawings.h"
#include "fovea/fovea.h"

namespace calibrate
{
namespace
{

/* Pictures of each kind, used and left out, that are shown. */
constexpr size_t PICTURES_MAX = 60;

/* clang-format off */
const char style[] =
    ":root{color-scheme:light dark;--back:#fff;--text:#1c2024;--soft:#5d6670;--line:#d5dae0;--bar:#3b6fb6;"
    "--pass:#1a7f37;--doubtful:#9a6700;--fail:#c62828}\n"
    "@media(prefers-color-scheme:dark){:root{--back:#14171a;--text:#e6e9ec;--soft:#9aa4ae;--line:#333a41;"
    "--bar:#6ea0e6;--pass:#4cc267;--doubtful:#e0a93b;--fail:#ff6b63}}\n"
    "*{box-sizing:border-box}\n"
    "body{margin:0;background:var(--back);color:var(--text);font:16px/1.5 system-ui,sans-serif}\n"
    "main{max-width:66rem;margin:0 auto;padding:1rem}\n"
    "h1{font-size:1.4rem;margin:.2rem 0}h2{font-size:1.15rem;margin:2rem 0 .5rem}p{margin:.5rem 0}\n"
    "h1,h2,p,li,figcaption,.bars td:first-child{overflow-wrap:anywhere}\n"
    ".soft,figcaption{color:var(--soft);font-size:.9rem}\n"
    ".verdict{border-left:.5rem solid;padding:.2rem 1rem}.grade{font-weight:700}\n"
    ".pass{border-color:var(--pass)}.doubtful{border-color:var(--doubtful)}.fail{border-color:var(--fail)}\n"
    ".grade.pass{color:var(--pass)}.grade.doubtful{color:var(--doubtful)}.grade.fail{color:var(--fail)}\n"
    "table{border-collapse:collapse}th,td{text-align:left;padding:.15rem .8rem .15rem 0;vertical-align:top}\n"
    "td.number,th.number{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}\n"
    ".wide{overflow-x:auto}\n"
    ".bars{width:100%;table-layout:fixed}.bars td:first-child{width:34%}.bars td:last-child{width:5.5rem}\n"
    ".bar{height:.8rem;margin-top:.4rem;background:var(--bar);min-width:1px}\n"
    ".grid{display:grid;gap:1rem;grid-template-columns:repeat(auto-fit,minmax(min(100%,20rem),1fr))}\n"
    ".views{display:grid;gap:.8rem;grid-template-columns:repeat(auto-fill,minmax(min(100%,13rem),1fr))}\n"
    "figure{margin:0}svg{display:block;width:100%;height:auto}\n"
    "svg text{fill:var(--text)}.frame{fill:none;stroke:var(--line);stroke-width:.4%}\n"
    ".coverage circle{fill:var(--bar)}.hull{fill:var(--bar);fill-opacity:.12;stroke:var(--bar)}\n"
    ".coverage,.uncertainty,.scale{max-width:44rem}.directions{max-width:20rem;margin:0 auto}.even{fill:none;stroke:var(--text);stroke-dasharray:4 4}\n"
    ".outermost{fill:none;stroke:#fff;stroke-width:.5%}.hatch{fill:#000;fill-opacity:.55}\n"
    "svg text.label{fill:#fff;stroke:#000;stroke-width:.15em;paint-order:stroke;text-anchor:middle;"
    "dominant-baseline:middle}\n"
    ".view image{width:100%}.view .used{fill:#2ee66b}.view .out{fill:none;stroke:#ff4136;stroke-width:1.5}\n";
/* clang-format on */

std::string section(const char *id, const char *title, const std::string &content)
{
    return formatted("<section id=\"%s\">\n<h2>%s</h2>\n", id, title) + content + "</section>\n";
}

std::string figure(const std::string &drawing, const std::string &caption)
{
    return "<figure>\n" + drawing + "<figcaption>" + caption + "</figcaption>\n</figure>\n";
}

bool solved(const Report &report)
{
    return report.solution.corners_used > 0;
}

/* Why a view is left out; empty: it is used. */
std::string reason_of(const Report &report, size_t v)
{
    return v < report.solution.left_out.size() ? report.solution.left_out[v]
                                               : report.views[v].left_out;
}

bool used(const Report &report, size_t v)
{
    return solved(report) && reason_of(report, v).empty();
}

const char *next_step(Grade grade)
{
    switch (grade) {
    case Grade::pass:
        return "Use the camera file. When the lens, its focus or its mount was touched, judge the file "
               "by new pictures with 'fovea-calibrate check'.";
    case Grade::doubtful:
        return "Do what the reasons ask for and calibrate again. Until then use the camera file only "
               "where its errors do not matter.";
    default:
        return "No camera file was written. Do what the reasons ask for and calibrate again.";
    }
}

std::string verdict_section(const Report &report)
{
    const char *grade = grade_name(report.verdict.grade);
    std::string text = formatted("<header class=\"verdict %s\">\n<h1>Calibration of ", grade);
    text += escaped(report.camera_name.empty() ? report.camera_id : report.camera_name);
    text += formatted(": <span class=\"grade %s\" id=\"grade\">%s</span></h1>\n", grade, grade);
    if (!report.verdict.reasons.empty()) text += "<ul id=\"reasons\">\n";
    for (const Reason &reason : report.verdict.reasons) {
        const char *its = grade_name(reason.grade);
        text += formatted("<li><span class=\"grade %s\">%s</span>: ", its, its);
        text += escaped(reason.text) + "</li>\n";
    }
    if (!report.verdict.reasons.empty()) text += "</ul>\n";
    text += formatted("<p id=\"next\">%s</p>\n", next_step(report.verdict.grade));
    text += "<p class=\"soft\">Pictures: " + escaped(report.camera_id) +
            ". Board: " + escaped(report.board.text()) + ". Date: " + escaped(report.date) +
            ". Program: fovea-calibrate " FOVEA_VERSION ".</p>\n";
    return text + "</header>\n";
}

std::string parameters_section(const Report &report)
{
    const Solution &solution = report.solution;
    std::string text =
        formatted("<p>Model <b id=\"model\">%s</b>, %d x %d pixels.</p>\n",
                  model_name(solution.model), solution.camera.width, solution.camera.height);
    text += "<div class=\"wide\"><table>\n<tr><th>parameter</th><th class=\"number\">value</th>"
            "<th class=\"number\">standard deviation</th></tr>\n";
    for (int i = 0; parameter_name(solution.model, i) != nullptr; i++) {
        const char *name = parameter_name(solution.model, i);
        text += formatted("<tr><td>%s</td><td class=\"number\">", name) +
                datum(name, parameter(solution.camera, i), "%.6g") + "</td><td class=\"number\">" +
                datum((std::string(name) + "-stdev").c_str(), solution.stdev[(size_t)i], "%.2g") +
                "</td></tr>\n";
    }
    return section("parameters", "Parameters", text + "</table></div>\n");
}

std::string compared_table(const Report &report)
{
    if (report.compared.size() < 2) return "";
    std::string text =
        "<div class=\"wide\"><table>\n<tr><th>model</th><th class=\"number\">RMS, px</th>"
        "<th class=\"number\">in pictures held out, px</th></tr>\n";
    for (const Compared &one : report.compared)
        text +=
            formatted("<tr><td>%s</td><td class=\"number\">", model_name(one.model)) +
            datum("compared-rms", one.solved ? one.rms_px : NAN) + "</td><td class=\"number\">" +
            datum("compared-held-out", one.solved && one.held_out_px >= 0 ? one.held_out_px : NAN) +
            "</td></tr>\n";
    return text + "</table></div>\n";
}

std::string errors_section(const Report &report)
{
    const Solution &solution = report.solution;
    std::string text =
        "<p>RMS " + datum("rms_px", solution.rms_px) + " px over " +
        datum("views_used", report.verdict.views_used) + " pictures and " +
        datum("corners_used", solution.corners_used, "%.0f") + " corners; in pictures held out " +
        datum("held_out_rms_px", report.held_out_px >= 0 ? report.held_out_px : NAN) +
        " px. Noise of one coordinate " + datum("noise_px", solution.noise_px) + " px.</p>\n" +
        compared_table(report);
    double worst = 0;
    for (size_t v = 0; v < report.views.size(); v++)
        if (used(report, v)) worst = std::max(worst, view_rms_px(solution, v));
    text += "<table class=\"bars\">\n";
    for (size_t v = 0; v < report.views.size(); v++) {
        text += "<tr><td>" + escaped(report.views[v].name) + "</td><td>";
        if (used(report, v)) {
            const double rms = view_rms_px(solution, v);
            text += formatted("<div class=\"bar\" style=\"width:%.1f%%\"></div></td><td "
                              "class=\"number\">",
                              worst > 0 ? 100 * rms / worst : 0) +
                    datum("view_rms_px", rms) + " px";
        } else {
            text += "</td><td class=\"soft\">left out";
        }
        text += "</td></tr>\n";
    }
    return section("errors", "Errors", text + "</table>\n");
}

std::string coverage_section(const Report &report)
{
    constexpr double degree = 57.29577951308232;
    return section(
        "coverage", "Coverage",
        figure(draw_coverage(report.views, report.solution),
               "Corners that are used. They cover " +
                   datum("coverage", report.verdict.coverage, "%.2f") +
                   " of the image that the lens sees. The boards' tilts differ by up to " +
                   formatted("%.0f degrees.", report.verdict.tilt_rad * degree)));
}

std::string residuals_section(const Report &report)
{
    const ResidualPattern pattern = residual_pattern(report.views, report.solution);
    return section(
        "residual-directions", "Residual directions",
        "<div class=\"grid\">\n" +
            figure(
                draw_residuals(pattern, report.solution),
                "Mean residual (predicted less found) in parts of the image. An arrow as long as a "
                "cell is high or wide is " +
                    formatted("%.3g px.", report.solution.rms_px)) +
            figure(draw_directions(pattern), "Residuals by direction; even ones fill the circle.") +
            "</div>\n<p>Neighbours with the same direction and colour mean that the model does not fit "
            "the lens, or that the board is not flat. Their mean square is " +
            datum("residual_pattern", report.verdict.residual_pattern) +
            " times that of independent noise.</p>\n");
}

std::string uncertainty_section(const Report &report)
{
    std::string table = "<details><summary>Numbers</summary>\n<div class=\"wide\"><table>\n";
    const Uncertainty &map = report.solution.uncertainty;
    for (int j = 0; j < map.rows; j++) {
        table += "<tr>";
        for (int i = 0; i < map.columns; i++) {
            const double value = map.stdev_px[(size_t)(j * map.columns + i)];
            table += "<td class=\"number\">" +
                     (std::isfinite(value) ? datum("projection_stdev_px", value, "%.2f")
                                           : std::string("no ray")) +
                     "</td>";
        }
        table += "</tr>\n";
    }
    return section(
        "projection-uncertainty", "Uncertainty of projection",
        figure(
            draw_uncertainty(report.views, report.solution) + draw_uncertainty_scale(),
            "Standard deviation, in pixels, of where a far point is seen, in its worst direction. "
            "White line: the outermost corners. Hatched: extrapolated. Grey: no ray, the model sees "
            "nothing there. Where corners were seen it is at most " +
                datum("projection_stdev_seen_px", report.verdict.uncertainty_seen_px) + " px.") +
            table + "</table></div>\n</details>\n");
}

std::string view_figure(const Report &report, size_t v)
{
    static const std::vector<Pixel> none;
    const View &view = report.views[v];
    std::string caption = "<b>" + escaped(view.name) + "</b>";
    if (used(report, v))
        caption += formatted(", %.3g px RMS", view_rms_px(report.solution, v));
    else if (const std::string reason = reason_of(report, v); !reason.empty())
        caption += ": " + escaped(reason);
    if (!view.corners.empty()) caption += formatted(", edges %.1f px wide", view.edge_px);
    if (!view.note.empty()) caption += ", " + escaped(view.note);
    return figure(view.thumbnail.width > 0
                      ? draw_view(view, used(report, v) ? report.solution.residuals_px[v] : none)
                      : "",
                  caption);
}

std::string view_figures(const Report &report, const std::vector<size_t> &which)
{
    std::string text = "<div class=\"views\">\n";
    for (size_t i = 0; i < which.size() && i < PICTURES_MAX; i++)
        text += view_figure(report, which[i]);
    text += "</div>\n";
    if (which.size() > PICTURES_MAX)
        text += formatted("<p class=\"soft\">%zu more are not shown.</p>\n",
                          which.size() - PICTURES_MAX);
    return text;
}

std::string views_sections(const Report &report)
{
    std::vector<size_t> taken, out;
    for (size_t v = 0; v < report.views.size(); v++)
        (used(report, v) ? taken : out).push_back(v);
    std::stable_sort(taken.begin(), taken.end(), [&](size_t a, size_t b) {
        return view_rms_px(report.solution, a) > view_rms_px(report.solution, b);
    });
    std::string text;
    if (!taken.empty())
        text += section(
            "views", "Pictures that are used, the worst first",
            "<p class=\"soft\">Green: corners that are used. Red rings: corners that are left "
            "out.</p>\n" +
                view_figures(report, taken));
    if (!out.empty())
        text +=
            section("left-out", solved(report) ? "Pictures that are left out, and why" : "Pictures",
                    view_figures(report, out));
    return text;
}

std::string corners_section(const Report &report)
{
    const std::vector<LeftOut> &corners = report.solution.corners_left_out;
    if (corners.empty()) return "";
    std::string text =
        "<div class=\"wide\"><table>\n<tr><th>picture</th><th class=\"number\">column</th>"
        "<th class=\"number\">row</th><th class=\"number\">error, px</th></tr>\n";
    for (const LeftOut &corner : corners)
        text += "<tr><td>" + escaped(report.views[(size_t)corner.view].name) +
                formatted("</td><td class=\"number\">%d</td><td class=\"number\">%d</td><td "
                          "class=\"number\">",
                          corner.corner % report.board.point_columns() + 1,
                          corner.corner / report.board.point_columns() + 1) +
                datum("corner_error_px", corner.error_px) + "</td></tr>\n";
    return section("corners-left-out", "Corners that are left out", text + "</table></div>\n");
}

} // namespace

std::string report_html(const Report &report)
{
    std::string page =
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
        "style-src 'unsafe-inline'\"/>\n<title>Calibration: ";
    page += grade_name(report.verdict.grade);
    page += std::string("</title>\n<style>\n") + style + "</style>\n</head>\n<body>\n<main>\n";
    page += verdict_section(report);
    if (solved(report))
        page += parameters_section(report) + errors_section(report) + coverage_section(report) +
                residuals_section(report) + uncertainty_section(report);
    page += views_sections(report);
    if (solved(report)) page += corners_section(report);
    return page + "</main>\n</body>\n</html>\n";
}

} // namespace calibrate
