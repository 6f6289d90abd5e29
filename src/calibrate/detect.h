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

/* Find the corners of a chessboard, row by row, with columns and rows turning as x and y of the
 * image do; fills corners and edge_px, or left_out. */
void detect_chessboard(const Grey &image, const Board &board, Refinement refinement, View &view);

} // namespace calibrate
#endif
