/* A page of PDF 1.4 (ISO 32000): lengths in points, 72 to an inch, y upwards. */
#include "calibrate/page.h"

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

std::string contents(const Board &board, const Size &size)
{
    const double side_mm = 1000 * board.square_m;
    const double left_mm = .5 * (size.width_mm - (board.columns + 1) * side_mm);
    const double bottom_mm =
        FOOTER_MM + MARGIN_MM +
        .5 * (size.height_mm - FOOTER_MM - 2 * MARGIN_MM - (board.rows + 1) * side_mm);
    std::string text = "0 g\n";
    for (int j = 0; j <= board.rows; j++)
        for (int i = j % 2; i <= board.columns; i += 2)
            put_rectangle(text, left_mm + i * side_mm, bottom_mm + j * side_mm, side_mm, side_mm);
    put(text, "f\n");
    put_ruler(text);
    put(text,
        "BT /F 9 Tf %.4f %.4f Td (chessboard:%dx%d:%.9g   Print at 100 %%. The ruler must be 100 mm "
        "long, a square %.9g mm wide.) Tj ET\n",
        MARGIN_MM * POINTS_PER_MM, (MARGIN_MM + 1) * POINTS_PER_MM, board.columns, board.rows,
        board.square_m, side_mm);
    return text;
}

} // namespace

bool page_write(const Board &board, const std::string &page, std::string &pdf, std::string &error)
{
    Size size;
    if (!size_of(page, size)) {
        error = "--page: found '" + page + "', expected a4, letter or a3";
        return false;
    }
    const double wide = (size.width_mm - 2 * MARGIN_MM) / (board.columns + 1);
    const double high = (size.height_mm - 2 * MARGIN_MM - FOOTER_MM) / (board.rows + 1);
    if (board.columns < board.rows) {
        error = "--target: found more rows than columns, expected columns first: it is the same "
                "board, turned";
        return false;
    }
    if (1000 * board.square_m > std::min(wide, high)) {
        char text[200];
        snprintf(text, sizeof text,
                 "--target: found squares of %.9g m, expected at most %.4f m to fit the page %s",
                 board.square_m, std::min(wide, high) / 1000, page.c_str());
        error = text;
        return false;
    }
    const std::string stream = contents(board, size);
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
