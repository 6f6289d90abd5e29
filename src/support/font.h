/* A bitmap font of 5 x 8 pixels for pictures that the program draws. */
#ifndef FOVEA_SUPPORT_FONT_H
#define FOVEA_SUPPORT_FONT_H

#include <stdint.h>

enum { FV_FONT_COLUMNS = 5, FV_FONT_ROWS = 8, FV_FONT_ADVANCE = 6 };

/* FV_FONT_ROWS rows from the top, the last below the base line; bit 4 is the left pixel. */
const uint8_t *fv_font_glyph(char character);

#endif
