/* The plug-in fovea-text.so: letters by FreeType, from DejaVu Sans or another font of the system.
 */
#include <stddef.h>

#include <ft2build.h>
#include FT_FREETYPE_H

#include "support/lettering.h"

static FT_Library library;
static FT_Face face;

static bool open_font(void)
{
    static const char *const files[] = {
        "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
        "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
        "/usr/share/fonts/TTF/DejaVuSans.ttf",
        "/usr/share/fonts/truetype/noto/NotoSans-Regular.ttf",
        "/usr/share/fonts/truetype/liberation/LiberationSans-Regular.ttf",
        "/usr/share/fonts/truetype/freefont/FreeSans.ttf",
    };
    if (FT_Init_FreeType(&library) != 0) return false;
    for (size_t i = 0; i < sizeof files / sizeof *files; i++)
        if (FT_New_Face(library, files[i], 0, &face) == 0) return true;
    FT_Done_FreeType(library);
    return false;
}

static bool letter_draw(int size, uint32_t code, struct fv_letter *letter)
{
    if (FT_Set_Pixel_Sizes(face, 0, (FT_UInt)size) != 0) return false;
    const FT_UInt index = FT_Get_Char_Index(face, code);
    if (index == 0 || FT_Load_Glyph(face, index, FT_LOAD_RENDER | FT_LOAD_TARGET_LIGHT) != 0)
        return false;
    const FT_GlyphSlot slot = face->glyph;
    *letter = (struct fv_letter){
        .width = (int)slot->bitmap.width,
        .height = (int)slot->bitmap.rows,
        .left = slot->bitmap_left,
        .top = slot->bitmap_top,
        .advance = (int)(slot->advance.x + 32) / 64,
        .stride = slot->bitmap.pitch,
        .coverage = slot->bitmap.buffer,
    };
    return slot->bitmap.pixel_mode == FT_PIXEL_MODE_GRAY;
}

__attribute__((visibility("default")))
const struct fv_lettering fovea_lettering = {FV_LETTERING_VERSION, open_font, letter_draw};
