/* Boards in pictures. */
#ifndef FOVEA_CALIBRATE_DETECT_H
#define FOVEA_CALIBRATE_DETECT_H

#include <cstdint>

#include "calibrate/calibrate.h"

namespace calibrate
{

struct Grey {
    const uint8_t *pixels;
    int width, height, stride_bytes;
};

/* How corners are placed between pixels. OPENCV_11 is cornerSubPix of 11 x 11 about each side, eps
 * 0.1, as OpenCV's calibration sample has it: for comparison with published results alone. */
enum class Refinement { OWN, OPENCV_11 };

/* Find the points of a board, row by row, with columns and rows turning as x and y of the image do;
 * fills corners, edge_px and note, or left_out; shown_columns and shown_rows where its search met a
 * chessboard of another size. Boards with markers may be partly hidden. */
void detect_board(const Grey &image, const Board &board, Refinement refinement, View &view);

/* Why a picture may show another board: fills shown_columns, shown_rows and mirrored, and left_out
 * where that explains it. After detect_board; where no board was found, or the squares may go on
 * beyond it, it takes some 50 ms. */
void explain_board(const Grey &image, const Board &board, View &view);

/* A marker in a picture: its corners in the order in which they are printed, from the top left one
 * on to the right and round. */
struct Marker {
    int id;
    std::array<Pixel, 4> corners;
};

/* Markers of OpenCV's dictionary of that number, with a black border of `border` bits. The search
 * ends when `enough` with numbers below `ids` are found. */
std::vector<Marker> find_markers(const Grey &image, int dictionary, int border, int ids,
                                 size_t enough);

/* Cells of a marker as printed, with its border: side times side, row by row, 1 is white. */
std::vector<uint8_t> marker_cells(int dictionary, int id, int border, int &side);
int marker_count(int dictionary); /* of a dictionary */

enum { APRILGRID_DICTIONARY = 20, APRILGRID_BORDER = 2 }; /* tag36h11, as Kalibr prints them */

/* detect_board for boards with markers, from those of the picture. */
void detect_by_markers(const Grey &image, const Board &board, const std::vector<Marker> &markers,
                       View &view);

} // namespace calibrate
#endif
