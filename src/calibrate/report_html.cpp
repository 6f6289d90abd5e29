#include "calibrate/report_html.h"

#include <algorithm>

#include "calibrate/html.h"
#include "calibrate/report_drawings.h"
#include "calibrate/report_page.h"

namespace calibrate
{
namespace
{

/* Pictures of each kind, used and left out, that are shown. */
constexpr size_t PICTURES_MAX = 60;

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
    return verdict_header("Calibration of " +
                              (report.camera_name.empty() ? report.camera_id : report.camera_name),
                          report.verdict, next_step(report.verdict.grade),
                          "Pictures: " + report.camera_id + ". Board: " + report.board.text() +
                              ". Date: " + report.date);
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
        " px. Cameras of the two halves of the pictures project up to " +
        datum("cross_solve_px", report.cross_solve_px) + " px apart. Noise of one coordinate " +
        datum("noise_px", solution.noise_px) + " px.</p>\n" + compared_table(report);
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
    std::string page = verdict_section(report);
    if (solved(report))
        page += parameters_section(report) + errors_section(report) + coverage_section(report) +
                residuals_section(report) + uncertainty_section(report);
    page += views_sections(report);
    if (solved(report)) page += corners_section(report);
    return html_page(report.verdict.grade, page);
}

} // namespace calibrate
