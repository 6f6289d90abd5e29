#include "features/fast.h"

#include <string.h>

enum {
    PAD = FV_CACHE_LINE_BYTES
}; /* before column 0 and after the last, for neighbours and whole vectors */

void fv_fast_carve(struct fv_fast_scratch *scratch, int32_t width, struct fv_arena *frame)
{
    scratch->row_bytes = (width + 2 * PAD + PAD - 1) / PAD * PAD;
    scratch->scores = fv_arena_take(frame, 3, (size_t)scratch->row_bytes);
    scratch->thresholds = fv_arena_take(frame, 1, (size_t)scratch->row_bytes);
    scratch->columns = fv_arena_take(frame, (size_t)width / 2 + 1, sizeof *scratch->columns);
}

static uint8_t *score_row(const struct fv_fast *fast, int32_t y)
{
    return fast->scratch.scores + y % 3 * fast->scratch.row_bytes + PAD;
}

/* Scores reach one pixel further than corners, since suppression looks at neighbours, but never
 * closer than 3 to the edge; what lies beyond counts as zero. */
static int32_t margin(const struct fv_fast *fast)
{
    return fast->border_px > FV_FAST_BORDER_MIN_PX ? fast->border_px - 1 : FV_FAST_BORDER_MIN_PX;
}

static void score(struct fv_fast *fast, int32_t y)
{
    uint8_t *row = score_row(fast, y);
    const int32_t from = margin(fast), count = fast->image.width - 2 * from;
    if (y < from || y >= fast->image.height - from) {
        memset(row - 1, 0, (size_t)fast->image.width + 2);
        return;
    }
    const uint8_t *pixels = fv_plane_row(&fast->image, y) + from;
    fast->kernels->fast_score_u8(row + from, pixels, fast->image.stride,
                                 fast->scratch.thresholds + from, count);
    row[from - 1] = 0;
    row[from + count] = 0;
}

void fv_fast_begin(struct fv_fast *fast, const struct fv_kernels *kernels,
                   const struct fv_plane *image, int32_t border_px, int32_t threshold,
                   const struct fv_fast_scratch *scratch)
{
    *fast = (struct fv_fast){.kernels = kernels,
                             .image = *image,
                             .border_px = border_px > FV_FAST_BORDER_MIN_PX ? border_px
                                                                            : FV_FAST_BORDER_MIN_PX,
                             .scratch = *scratch,
                             .columns = scratch->columns};
    fast->y = fast->border_px - 1;
    fast->scored = fast->border_px - 2;
    memset(scratch->thresholds, threshold, (size_t)scratch->row_bytes);
}

bool fv_fast_next(struct fv_fast *fast)
{
    const int32_t border = fast->border_px;
    fast->count = 0;
    if (fast->image.width <= 2 * border || fast->y + 1 >= fast->image.height - border) return false;
    fast->y++;
    while (fast->scored < fast->y + 1)
        score(fast, ++fast->scored);
    fast->scores = score_row(fast, fast->y);
    fast->count = fast->kernels->fast_peaks_u8(fast->scratch.columns, score_row(fast, fast->y - 1),
                                               fast->scores, score_row(fast, fast->y + 1), border,
                                               fast->image.width - border);
    return true;
}
