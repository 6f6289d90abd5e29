/* Boards, and the names of models and parameters. */
#include "calibrate/calibrate.h"

#include <cstdio>

#include "support/text.h"

namespace calibrate
{

std::vector<Point> Board::points() const
{
    std::vector<Point> points;
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < columns; i++)
            points.push_back({i * square_m, j * square_m, 0});
    return points;
}

bool board_parse(const std::string &text, Board &board, std::string &error)
{
    constexpr int corners_min = 3, corners_max = 50;
    constexpr double square_max_m = 10;
    int64_t columns, rows;
    double square;
    const std::string kind = "chessboard:";
    const size_t cross = text.find('x'), colon = text.rfind(':');
    if (text.compare(0, kind.size(), kind) == 0 && cross != std::string::npos && colon > cross &&
        fv_text_integer(text.substr(kind.size(), cross - kind.size()).c_str(), &columns) &&
        fv_text_integer(text.substr(cross + 1, colon - cross - 1).c_str(), &rows) &&
        fv_text_number(text.substr(colon + 1).c_str(), &square) && columns >= corners_min &&
        columns <= corners_max && rows >= corners_min && rows <= corners_max && square > 0 &&
        square <= square_max_m) {
        board = {(int)columns, (int)rows, square};
        return true;
    }
    char quoted[FV_TEXT_QUOTED_BYTES];
    error =
        std::string("--target: found ") + fv_text_quote(text.c_str(), quoted, sizeof quoted) +
        ", expected chessboard:COLUMNSxROWS:SQUARE with inner corners (3 to 50) and the side of "
        "a square in metres, as chessboard:9x6:0.025";
    return false;
}

const char *model_name(Model model)
{
    return model == Model::radtan     ? "radtan"
           : model == Model::rational ? "rational"
                                      : "equidistant";
}

int coefficient_count(Model model)
{
    return model == Model::radtan ? 5 : model == Model::rational ? 8 : 4;
}

const char *parameter_name(Model model, int parameter)
{
    static const char *const radtan[] = {"fx", "fy", "cx", "cy", "k1", "k2",
                                         "p1", "p2", "k3", "k4", "k5", "k6"};
    static const char *const equidistant[] = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
    if (parameter < 0 || parameter >= 4 + coefficient_count(model)) return nullptr;
    return model == Model::equidistant ? equidistant[parameter] : radtan[parameter];
}

} // namespace calibrate
