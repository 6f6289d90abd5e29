/* The highest surface in each cell (fovea/grid.h says by which rules). */
#include "grid/cells.h"

enum { ONE = FV_GRID_HEIGHT_ONE, MOST = 15 * ONE, NEAR_MM = 50 };

static bool is_near(int32_t a_mm, int32_t b_mm)
{
    return a_mm - b_mm <= NEAR_MM && b_mm - a_mm <= NEAR_MM;
}

/* One more point for a height: the mean of those that are counted. */
static void join(int16_t *mean_mm, uint16_t *count, int32_t mm)
{
    const int32_t all = *count + ONE, sum = *mean_mm * (int32_t)*count + mm * ONE;
    *mean_mm = (int16_t)((sum + (sum < 0 ? -all / 2 : all / 2)) / all);
    *count = (uint16_t)(all < MOST ? all : MOST);
}

/* Two points make a height known. */
static void propose(struct fv_grid_height *h, int32_t mm)
{
    if (h->next >= ONE / 2 && is_near(mm, h->next_mm)) {
        join(&h->next_mm, &h->next, mm);
        h->top_mm = h->next_mm;
        h->top = h->next;
        h->next = 0;
    } else if (h->next < ONE / 2 || mm > h->next_mm) {
        h->next_mm = (int16_t)mm;
        h->next = ONE;
    }
}

void fv_grid_height_add(struct fv_grid *g, int64_t at, double height_m)
{
    const double most_m = g->config.heights_max_m;
    if (g->heights == NULL || at < 0 || !(height_m < most_m && height_m > -most_m)) return;
    struct fv_grid_height *h = &g->heights[at];
    const int32_t mm = (int32_t)(height_m * 1000 + (height_m < 0 ? -0.5 : 0.5));
    if (h->top >= ONE && is_near(mm, h->top_mm))
        join(&h->top_mm, &h->top, mm);
    else if (h->top < ONE || mm > h->top_mm)
        propose(h, mm);
}

void fv_grid_height_rows(const struct fv_grid *g, int64_t row_first, int64_t row_count,
                         int16_t *heights_mm, uint8_t *counts)
{
    const int64_t side = fv_grid_side(g);
    for (int64_t y = row_first; y < row_first + row_count; y++)
        for (int64_t x = 0; x < side; x++) {
            const int64_t at =
                fv_grid_place_of(g, g->state->corner[0] + x, g->state->corner[1] + y);
            const struct fv_grid_height *h = &g->heights[at];
            *heights_mm++ = h->top < ONE ? FOVEA_GRID_HEIGHT_UNKNOWN : h->top_mm;
            if (counts != NULL) *counts++ = (uint8_t)(h->top / ONE);
        }
}
