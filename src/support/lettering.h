/* Letters for pictures that the program draws. A plug-in (src/support/plugin/freetype.c, built
 * where FreeType is installed) draws them from a font of the system; without it, or without a font,
 * the bitmap font of font.h is used. */
#ifndef FOVEA_SUPPORT_LETTERING_H
#define FOVEA_SUPPORT_LETTERING_H

#include <stdbool.h>
#include <stdint.h>

struct fv_letter {
    int width, height;       /* of its picture, pixels */
    int left, top;           /* from the pen on the base line to its top left corner; top is up */
    int advance;             /* of the pen, pixels */
    int stride;              /* bytes from row to row */
    const uint8_t *coverage; /* 0 to 255; valid until the next call */
};

enum { FV_LETTERING_VERSION = 1 };

/* What the plug-in exports as fovea_lettering. */
struct fv_lettering {
    int version; /* FV_LETTERING_VERSION */
    /* Open a font. False: none was found. Once. */
    bool (*open)(void);
    /* The letter of a Unicode code point at `size` pixels per em. False: the font has none. */
    bool (*letter)(int size, uint32_t code, struct fv_letter *letter);
};

/* From now on canvases use `lettering`, which was opened; NULL: the bitmap font. */
void fv_canvas_use_lettering(const struct fv_lettering *lettering);

#endif
