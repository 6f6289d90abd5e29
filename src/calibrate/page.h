/* Boards to print. */
#ifndef FOVEA_CALIBRATE_PAGE_H
#define FOVEA_CALIBRATE_PAGE_H

#include "calibrate/calibrate.h"

namespace calibrate
{

/* A PDF page ("a4", "letter", "a3") with the board at exact size, turned to fit, a ruler of 100 mm
 * and a line of text. False, with a line that says what fits, where the board is too large. */
bool page_write(const Board &board, const std::string &page, std::string &pdf, std::string &error);

} // namespace calibrate
#endif
