/* A page of PDF 1.4 (ISO 32000): lengths in points, 72 to an inch, y upwards. */
#include "calibrate/page.h"

#include "calibrate/drawing.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>

namespace calibrate
{
namespace
{

constexpr double POINTS_PER_MM = 72 / 25.4;
constexpr double MARGIN_MM = 6;  /* most printers leave 4 to 5 mm white */
constexpr double FOOTER_MM = 18; /* text and ruler, below the board */
constexpr double RULER_MM = 100;

struct Size {
    double width_mm, height_mm;
};

bool size_of(const std::string &page, Size &size)
{
    if (page == "a4") size = {297, 210};
    if (page == "letter") size = {279.4, 215.9};
    if (page == "a3") size = {420, 297};
    return page == "a4" || page == "letter" || page == "a3";
}

__attribute__((format(printf, 2, 3))) void put(std::string &text, const char *format, ...)
{
    char line[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    text += line;
}

void put_rectangle(std::string &text, double x_mm, double y_mm, double width_mm, double height_mm)
{
    put(text, "%.4f %.4f %.4f %.4f re\n", x_mm * POINTS_PER_MM, y_mm * POINTS_PER_MM,
        width_mm * POINTS_PER_MM, height_mm * POINTS_PER_MM);
}

void put_ruler(std::string &text)
{
    constexpr double line_mm = .2, y_mm = MARGIN_MM + 6;
    put_rectangle(text, MARGIN_MM, y_mm, RULER_MM, line_mm);
    for (int mm = 0; mm <= (int)RULER_MM; mm += 5)
        put_rectangle(text,
                      MARGIN_MM + mm -
                          (mm == 0          ? 0
                           : mm == RULER_MM ? line_mm
                                            : line_mm / 2),
                      y_mm, line_mm, mm % 10 == 0 ? 4 : 2.5);
    put(text, "f\n");
}

/* A circle of four Bezier curves. */
void put_circle(std::string &text, double x_mm, double y_mm, double radius_mm)
{
    constexpr double handle = .5522847498; /* 4 / 3 tan(pi / 8) */
    const double x = x_mm * POINTS_PER_MM, y = y_mm * POINTS_PER_MM, r = radius_mm * POINTS_PER_MM;
    const double h = handle * r;
    put(text, "%.4f %.4f m\n", x + r, y);
    put(text, "%.4f %.4f %.4f %.4f %.4f %.4f c\n", x + r, y + h, x + h, y + r, x, y + r);
    put(text, "%.4f %.4f %.4f %.4f %.4f %.4f c\n", x - h, y + r, x - r, y + h, x - r, y);
    put(text, "%.4f %.4f %.4f %.4f %.4f %.4f c\n", x - r, y - h, x - h, y - r, x, y - r);
    put(text, "%.4f %.4f %.4f %.4f %.4f %.4f c\n", x + h, y - r, x + r, y - h, x + r, y);
}

/* What is measured on the print: a side or a distance, beside the ruler. */
const char *measured(Pattern pattern)
{
    switch (pattern) {
    case Pattern::aprilgrid:
        return "a tag %.9g mm wide";
    case Pattern::circles:
        return "circles %.9g mm from centre to centre";
    case Pattern::asymmetric_circles:
        return "rows of circles %.9g mm apart";
    default:
        return "a square %.9g mm wide";
    }
}

std::string contents(const Board &board, const Drawing &drawing, const Size &size)
{
    const double wide_mm = 1000 * drawing.width_m, high_mm = 1000 * drawing.height_m;
    const double left_mm = .5 * (size.width_mm - wide_mm);
    const double top_mm =
        size.height_mm - MARGIN_MM - .5 * (size.height_mm - FOOTER_MM - 2 * MARGIN_MM - high_mm);
    char size_text[80];
    std::string text = "0 g\n";
    for (const Shape &shape : drawing.shapes) {
        const double x = left_mm + 1000 * shape.x, y = top_mm - 1000 * shape.y;
        if (shape.circle)
            put_circle(text, x, y, 500 * shape.width);
        else
            put_rectangle(text, x, y - 1000 * shape.height, 1000 * shape.width,
                          1000 * shape.height);
    }
    put(text, "f\n");
    put_ruler(text);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral" /* one of the texts above */
    snprintf(size_text, sizeof size_text, measured(board.pattern), 1000 * board.square_m);
#pragma GCC diagnostic pop
    put(text,
        "BT /F 9 Tf %.4f %.4f Td (%s   Print at 100 %%. The ruler must be 100 mm long, %s.) Tj ET\n",
        MARGIN_MM * POINTS_PER_MM, (MARGIN_MM + 1) * POINTS_PER_MM, board.text().c_str(),
        size_text);
    return text;
}

/* The page upright or lying, as the drawing is. */
bool fits(const Drawing &drawing, Size &size)
{
    if (drawing.height_m > drawing.width_m) std::swap(size.width_mm, size.height_mm);
    return 1000 * drawing.width_m <= size.width_mm - 2 * MARGIN_MM &&
           1000 * drawing.height_m <= size.height_mm - 2 * MARGIN_MM - FOOTER_MM;
}

} // namespace

bool page_write(const Board &board, const std::string &page, std::string &pdf, std::string &error)
{
    Size size;
    Drawing drawing;
    if (!size_of(page, size)) {
        error = "--page: found '" + page + "', expected a4, letter or a3";
        return false;
    }
    if (!draw(board, drawing, error)) return false;
    if (!fits(drawing, size)) {
        const double scale =
            std::min((size.width_mm - 2 * MARGIN_MM) / (1000 * drawing.width_m),
                     (size.height_mm - 2 * MARGIN_MM - FOOTER_MM) / (1000 * drawing.height_m));
        char text[240];
        snprintf(text, sizeof text,
                 "--target: found a board of %.4g x %.4g m, expected at most %.4f times that size "
                 "to fit the page %s (%.4f m in place of %.9g)",
                 drawing.width_m, drawing.height_m, scale, page.c_str(), scale * board.square_m,
                 board.square_m);
        error = text;
        return false;
    }
    const std::string stream = contents(board, drawing, size);
    std::string objects[5];
    objects[0] = "<< /Type /Catalog /Pages 2 0 R >>";
    objects[1] = "<< /Type /Pages /Kids [3 0 R] /Count 1 >>";
    put(objects[2],
        "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 %.4f %.4f] /Contents 4 0 R /Resources << /Font << "
        "/F 5 0 R >> >> >>",
        size.width_mm * POINTS_PER_MM, size.height_mm * POINTS_PER_MM);
    objects[3] =
        "<< /Length " + std::to_string(stream.size()) + " >>\nstream\n" + stream + "endstream";
    objects[4] = "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>";
    pdf = "%PDF-1.4\n";
    std::string table = "xref\n0 6\n0000000000 65535 f \n";
    for (int i = 0; i < 5; i++) {
        put(table, "%010zu 00000 n \n", pdf.size());
        pdf += std::to_string(i + 1) + " 0 obj\n" + objects[i] + "\nendobj\n";
    }
    const size_t table_at = pdf.size();
    pdf += table + "trailer\n<< /Size 6 /Root 1 0 R >>\nstartxref\n" + std::to_string(table_at) +
           "\n%%EOF\n";
    return true;
}

} // namespace calibrate
