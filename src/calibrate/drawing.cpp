#include "calibrate/drawing.h"

#include <algorithm>

#include "calibrate/detect.h"

namespace calibrate
{
namespace
{

void add_square(double x, double y, double side, Drawing &drawing)
{
    drawing.shapes.push_back({false, x, y, side, side});
}

/* The black cells of a marker of `side_m`, joined along its rows. */
void add_marker(int dictionary, int id, int border, double x, double y, double side_m,
                Drawing &drawing)
{
    int side;
    const std::vector<uint8_t> white = marker_cells(dictionary, id, border, side);
    const double cell = side_m / side;
    for (int j = 0; j < side; j++) {
        for (int i = 0; i < side;) {
            int end = i;
            while (end < side && !white[(size_t)(j * side + end)])
                end++;
            if (end > i)
                drawing.shapes.push_back(
                    {false, x + i * cell, y + j * cell, (end - i) * cell, cell});
            i = end + 1;
        }
    }
}

void draw_squares(const Board &board, int columns, int rows, Drawing &drawing)
{
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < columns; i++)
            if ((i + j) % 2 == (board.white_first ? 1 : 0))
                add_square(i * board.square_m, j * board.square_m, board.square_m, drawing);
    drawing.width_m = columns * board.square_m;
    drawing.height_m = rows * board.square_m;
    drawing.x_m = drawing.y_m = board.square_m;
}

bool draw_charuco(const Board &board, Drawing &drawing)
{
    const double margin = .5 * (board.square_m - board.marker_m);
    int id = 0;
    draw_squares(board, board.columns, board.rows, drawing);
    for (int j = 0; j < board.rows; j++) {
        for (int i = 0; i < board.columns; i++) {
            if ((i + j) % 2 == (board.white_first ? 1 : 0)) continue;
            if (id >= marker_count(board.dictionary)) return false;
            add_marker(board.dictionary, id++, 1, i * board.square_m + margin,
                       j * board.square_m + margin, board.marker_m, drawing);
        }
    }
    return true;
}

/* Tags from the bottom left on; a black square of the gap's side at each corner of each tag. */
bool draw_aprilgrid(const Board &board, Drawing &drawing)
{
    const double gap = board.marker_m, pitch = board.square_m + gap;
    if (board.columns * board.rows > marker_count(APRILGRID_DICTIONARY)) return false;
    for (int j = 0; j <= board.rows; j++)
        for (int i = 0; i <= board.columns; i++)
            add_square(i * pitch, j * pitch, gap, drawing);
    for (int id = 0; id < board.columns * board.rows; id++)
        add_marker(APRILGRID_DICTIONARY, id, APRILGRID_BORDER, id % board.columns * pitch + gap,
                   (board.rows - 1 - id / board.columns) * pitch + gap, board.square_m, drawing);
    drawing.width_m = board.columns * pitch + gap;
    drawing.height_m = board.rows * pitch + gap;
    drawing.x_m = drawing.y_m = gap;
    return true;
}

void draw_circles(const Board &board, Drawing &drawing)
{
    /* As large as neighbours allow, of which those of an asymmetric grid are nearer. */
    const double radius = (board.pattern == Pattern::circles ? .3 : .4) * board.square_m;
    for (const Point &point : board.points()) {
        drawing.shapes.push_back({true, point[0] + radius, point[1] + radius, 2 * radius, 0});
        drawing.width_m = std::max(drawing.width_m, point[0] + 2 * radius);
        drawing.height_m = std::max(drawing.height_m, point[1] + 2 * radius);
    }
    drawing.x_m = drawing.y_m = radius;
}

} // namespace

bool draw(const Board &board, Drawing &drawing, std::string &error)
{
    bool whole = true;
    drawing = {};
    if (board.pattern == Pattern::chessboard)
        draw_squares(board, board.columns + 1, board.rows + 1, drawing);
    else if (board.pattern == Pattern::charuco)
        whole = draw_charuco(board, drawing);
    else if (board.pattern == Pattern::aprilgrid)
        whole = draw_aprilgrid(board, drawing);
    else
        draw_circles(board, drawing);
    if (!whole)
        error = "--target: found more markers than the dictionary has, " +
                std::to_string(marker_count(board.pattern == Pattern::aprilgrid
                                                ? (int)APRILGRID_DICTIONARY
                                                : board.dictionary)) +
                ", expected fewer columns and rows";
    return whole;
}

} // namespace calibrate
