#include "features/spread.h"

#include <stdbool.h>
#include <string.h>

enum { CELL_MIN_PX = 4 };

void fv_spread_carve(struct fv_spread *spread, uint32_t count_max, struct fv_arena *frame)
{
    spread->cells_max = count_max;
    spread->cells = fv_arena_take(frame, count_max, sizeof *spread->cells);
}

/* Largest integer whose square is at most `value`: bit by bit. */
static int32_t square_root(uint32_t value)
{
    uint32_t root = 0;
    for (uint32_t bit = 1u << 15; bit != 0; bit >>= 1)
        if ((root + bit) * (root + bit) <= value) root += bit;
    return (int32_t)root;
}

void fv_spread_begin(struct fv_spread *spread, int32_t width, int32_t height, uint32_t share)
{
    const uint32_t cells = share < 1 ? 1 : share > spread->cells_max ? spread->cells_max : share;
    spread->width = width;
    spread->height = height;
    spread->cell_px = square_root((uint32_t)width * (uint32_t)height / cells);
    if (spread->cell_px < CELL_MIN_PX) spread->cell_px = CELL_MIN_PX;
    /* Cells cut by the border make more than asked: widen until they fit, at most until one cell covers all. */
    for (;; spread->cell_px++) {
        spread->columns = (width + spread->cell_px - 1) / spread->cell_px;
        spread->rows = (height + spread->cell_px - 1) / spread->cell_px;
        if ((uint32_t)spread->columns * (uint32_t)spread->rows <= spread->cells_max) break;
    }
    memset(spread->cells, 0, (size_t)(spread->columns * spread->rows) * sizeof *spread->cells);
}

void fv_spread_offer(struct fv_spread *spread, int32_t x, int32_t y, uint8_t score)
{
    struct fv_spread_cell *cell = &spread->cells[y / spread->cell_px * spread->columns + x / spread->cell_px];
    int place = cell->count;
    while (place > 0 && cell->best[place - 1].score < score) place--;
    if (place == FV_SPREAD_KEPT) return;
    if (cell->count < FV_SPREAD_KEPT) cell->count++;
    for (int i = cell->count - 1; i > place; i--) cell->best[i] = cell->best[i - 1];
    cell->best[place].x = (uint16_t)x;
    cell->best[place].y = (uint16_t)y;
    cell->best[place].score = score;
}

/* Where a cell has a corner of the higher threshold, its weaker ones are dropped. */
static void drop_weak(struct fv_spread *spread, int32_t cells, uint8_t threshold)
{
    for (int32_t i = 0; i < cells; i++) {
        struct fv_spread_cell *cell = &spread->cells[i];
        if (cell->count == 0 || cell->best[0].score < threshold) continue;
        while (cell->best[cell->count - 1].score < threshold) cell->count--;
    }
}

/* In a round of which only `room` corners fit: the score that still is taken, and how many of exactly that score. */
static uint8_t cut(const struct fv_spread *spread, int32_t cells, int round, uint32_t room, uint32_t *ties)
{
    uint32_t histogram[256] = {0};
    for (int32_t i = 0; i < cells; i++)
        if (spread->cells[i].count > round) histogram[spread->cells[i].best[round].score]++;
    int score = 255;
    while (histogram[score] <= room) room -= histogram[score--];
    *ties = room;
    return (uint8_t)score;
}

/* Rounds: how many of its corners every cell gives is left in its count. */
static void share_out(struct fv_spread *spread, int32_t cells, uint32_t count)
{
    for (int round = 0; round < FV_SPREAD_KEPT; round++) {
        uint32_t offered = 0, ties = 0;
        for (int32_t i = 0; i < cells; i++) offered += spread->cells[i].count > round;
        if (offered <= count) {
            count -= offered;
            continue;
        }
        const uint8_t last = cut(spread, cells, round, count, &ties);
        for (int32_t i = 0; i < cells; i++) {
            struct fv_spread_cell *cell = &spread->cells[i];
            if (cell->count <= round) continue;
            const uint8_t score = cell->best[round].score;
            const bool taken = score > last || (score == last && ties > 0);
            if (score == last && ties > 0) ties--;
            cell->count = (uint8_t)(taken ? round + 1 : round);
        }
        return;
    }
}

uint32_t fv_spread_pick(struct fv_spread *spread, uint32_t count, uint8_t threshold, uint8_t level,
                        struct fv_corner *corners)
{
    const int32_t cells = spread->columns * spread->rows;
    uint32_t picked = 0;
    drop_weak(spread, cells, threshold);
    share_out(spread, cells, count);
    for (int32_t i = 0; i < cells; i++) {
        const struct fv_spread_cell *cell = &spread->cells[i];
        for (int k = 0; k < cell->count; k++)
            corners[picked++] = (struct fv_corner){
                .x = cell->best[k].x, .y = cell->best[k].y, .level = level, .score = cell->best[k].score};
    }
    return picked;
}
