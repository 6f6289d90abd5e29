#include "calibrate/report_page.h"

#include <cmath>

#include "calibrate/html.h"
#include "fovea/fovea.h"

namespace calibrate
{
namespace
{

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

} // namespace

std::string section(const char *id, const char *title, const std::string &content)
{
    return formatted("<section id=\"%s\">\n<h2>%s</h2>\n", id, title) + content + "</section>\n";
}

std::string figure(const std::string &drawing, const std::string &caption)
{
    return "<figure>\n" + drawing + "<figcaption>" + caption + "</figcaption>\n</figure>\n";
}

std::string verdict_header(const std::string &title, const Verdict &verdict,
                           const std::string &next, const std::string &origin)
{
    const char *grade = grade_name(verdict.grade);
    std::string text = formatted("<header class=\"verdict %s\">\n<h1>", grade) + escaped(title);
    text += formatted(": <span class=\"grade %s\" id=\"grade\">%s</span></h1>\n", grade, grade);
    if (!verdict.reasons.empty()) text += "<ul id=\"reasons\">\n";
    for (const Reason &reason : verdict.reasons) {
        const char *its = grade_name(reason.grade);
        text += formatted("<li><span class=\"grade %s\">%s</span>: ", its, its);
        text += escaped(reason.text) + "</li>\n";
    }
    if (!verdict.reasons.empty()) text += "</ul>\n";
    text += "<p id=\"next\">" + escaped(next) + "</p>\n";
    text += "<p class=\"soft\">" + escaped(origin) +
            ". Program: fovea-calibrate " FOVEA_VERSION ".</p>\n";
    return text + "</header>\n";
}

std::string value_row(const std::string &what, const char *name, double value, double stdev,
                      const char *shown, const std::string &lead)
{
    const std::string deviation = std::string(name) + "-stdev";
    return "<tr>" + lead + "<td>" + escaped(what) + "</td><td class=\"number\">" +
           datum(name, value, shown) + "</td><td class=\"number\">" +
           (std::isfinite(stdev) ? datum(deviation.c_str(), stdev, "%.2g") : "") + "</td></tr>\n";
}

std::string place_rows(const Pose &place, const std::array<double, 6> &stdev,
                       const std::string &lead)
{
    static const char *const names[] = {"turn about x, degrees",
                                        "turn about y, degrees",
                                        "turn about z, degrees",
                                        "x, mm",
                                        "y, mm",
                                        "z, mm"};
    constexpr double degree = 57.29577951308232;
    std::string rows;
    for (size_t i = 0; i < 6; i++) {
        const double unit = i < 3 ? degree : 1e3;
        rows += value_row(names[i], "place", unit * place[i], unit * stdev[i], "%.3f", lead);
    }
    return rows;
}

std::string values_table(const std::string &rows, const char *lead_head)
{
    return std::string("<div class=\"wide\"><table>\n<tr>") + lead_head +
           "<th>what</th><th class=\"number\">value</th>"
           "<th class=\"number\">standard deviation</th></tr>\n" +
           rows + "</table></div>\n";
}

std::string html_page(Grade grade, const std::string &content)
{
    std::string page =
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
        "style-src 'unsafe-inline'\"/>\n<title>Calibration: ";
    page += grade_name(grade);
    page += std::string("</title>\n<style>\n") + style + "</style>\n</head>\n<body>\n<main>\n";
    return page + content + "</main>\n</body>\n</html>\n";
}

} // namespace calibrate
