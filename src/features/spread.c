#include "features/spread.h"

#include <stdbool.h>
#include <string.h>

enum { CELL_MIN_PX = 4, FIELDS = FV_SPREAD_COVER * FV_SPREAD_COVER };

/* Shares of the levels fall by 5/6 from each to the next, as their side lengths do. */
static uint32_t share_of(uint32_t level, uint32_t levels, uint32_t count)
{
    uint64_t part = 0, sum = 0, weight = 1;
    for (uint32_t i = 0; i < levels; i++)
        weight *= 6;
    for (uint32_t i = 0; i < levels; i++) {
        sum += weight;
        if (i == level) part = weight;
        weight = weight / 6 * 5;
    }
    return (uint32_t)((count * part + sum / 2) / sum);
}

void fv_spread_carve(struct fv_spread *spread, uint32_t levels, const int32_t width[], const int32_t height[],
                     uint32_t count_max, struct fv_arena *frame)
{
    spread->levels = levels;
    spread->cover = fv_arena_take(frame, FIELDS, sizeof *spread->cover);
    for (uint32_t i = 0; i < levels; i++) {
        struct fv_spread_level *level = &spread->level[i];
        *level = (struct fv_spread_level){.width = width[i], .height = height[i]};
        level->cells_max = share_of(i, levels, count_max) + 1;
        level->cells = fv_arena_take(frame, level->cells_max, sizeof *level->cells);
    }
}

/* Largest integer whose square is at most `value`: bit by bit. */
static int32_t square_root(uint32_t value)
{
    uint32_t root = 0;
    for (uint32_t bit = 1u << 15; bit != 0; bit >>= 1)
        if ((root + bit) * (root + bit) <= value) root += bit;
    return (int32_t)root;
}

/* 2^32 / divisor rounded up. For numerators up to 2^16 and divisors up to 2^12 multiplied() divides exactly.
 */
static uint32_t inverse(int32_t divisor)
{
    return (uint32_t)((UINT64_C(0x100000000) + (uint32_t)divisor - 1) / (uint32_t)divisor);
}

static int32_t multiplied(int32_t numerator, uint32_t inverse_q32)
{
    return (int32_t)((uint64_t)(uint32_t)numerator * inverse_q32 >> 32);
}

static void begin_level(struct fv_spread_level *level, uint32_t share)
{
    const uint32_t cells = share < 1 ? 1 : share < level->cells_max ? share : level->cells_max;
    level->cell_px = square_root((uint32_t)level->width * (uint32_t)level->height / cells);
    if (level->cell_px < CELL_MIN_PX) level->cell_px = CELL_MIN_PX;
    /* Cells cut by the border make more than asked: widen until they fit, at most until one cell covers all.
     */
    for (;; level->cell_px++) {
        level->columns = (level->width + level->cell_px - 1) / level->cell_px;
        level->rows = (level->height + level->cell_px - 1) / level->cell_px;
        if ((uint32_t)level->columns * (uint32_t)level->rows <= level->cells_max) break;
    }
    level->per_cell = inverse(level->cell_px);
    level->per_field_x = inverse(level->width);
    level->per_field_y = inverse(level->height);
    memset(level->cells, 0, (size_t)(level->columns * level->rows) * sizeof *level->cells);
}

void fv_spread_begin(struct fv_spread *spread, uint32_t count, uint8_t threshold)
{
    spread->count = count;
    spread->threshold = threshold;
    memset(spread->cover, 0, FIELDS * sizeof *spread->cover);
    for (uint32_t i = 0; i < spread->levels; i++)
        begin_level(&spread->level[i], share_of(i, spread->levels, count));
}

static struct fv_spread_cell *cell_at(const struct fv_spread_level *level, int32_t x, int32_t y)
{
    return &level->cells[multiplied(y, level->per_cell) * level->columns + multiplied(x, level->per_cell)];
}

void fv_spread_offer(struct fv_spread *spread, uint32_t level, int32_t x, int32_t y, uint8_t score)
{
    const struct fv_spread_level *at = &spread->level[level];
    const int32_t column = multiplied(FV_SPREAD_COVER * x, at->per_field_x);
    const int32_t row = multiplied(FV_SPREAD_COVER * y, at->per_field_y);
    struct fv_corner *field = &spread->cover[row * FV_SPREAD_COVER + column];
    if (score > field->score)
        *field =
            (struct fv_corner){.x = (uint16_t)x, .y = (uint16_t)y, .level = (uint8_t)level, .score = score};

    struct fv_spread_cell *cell = cell_at(at, x, y);
    if (cell->count > 0 && score < spread->threshold && cell->best[0].score >= spread->threshold) return;
    int place = cell->count;
    while (place > 0 && cell->best[place - 1].score < score)
        place--;
    if (place == FV_SPREAD_KEPT) return;
    if (cell->count < FV_SPREAD_KEPT) cell->count++;
    for (int i = cell->count - 1; i > place; i--)
        cell->best[i] = cell->best[i - 1];
    cell->best[place].x = (uint16_t)x;
    cell->best[place].y = (uint16_t)y;
    cell->best[place].score = score;
}

/* Mark the corner of a field as taken in the cell of its level. Where six stronger ones have pushed it out,
 * it takes the place of the weakest that is still free. False where all six are taken already. */
static bool take_field(const struct fv_spread *spread, const struct fv_corner *field)
{
    struct fv_spread_cell *cell = cell_at(&spread->level[field->level], field->x, field->y);
    int place = 0;
    while (place < cell->count && (cell->best[place].x != field->x || cell->best[place].y != field->y))
        place++;
    if (place == cell->count) {
        place--;
        while (place >= 0 && cell->best[place].taken)
            place--;
        if (place < 0) return false;
        cell->best[place].x = field->x;
        cell->best[place].y = field->y;
        cell->best[place].score = field->score;
    }
    cell->best[place].taken = 1;
    cell->taken++;
    return true;
}

/* The lowest score that is taken when only `room` fit, and how many of exactly that score. */
static uint8_t cut(const uint32_t histogram[256], uint32_t room, uint32_t *ties)
{
    int score = 255;
    while (score > 0 && histogram[score] <= room)
        room -= histogram[score--];
    *ties = room;
    return (uint8_t)score;
}

/* Whether a corner of this score makes the cut; counts the ties down. */
static bool passes(uint8_t score, uint8_t lowest, uint32_t *ties)
{
    if (score != lowest) return score > lowest;
    if (*ties == 0) return false;
    (*ties)--;
    return true;
}

/* The cover's corners, the strongest `count` where there are more. Adds what each level gave to taken[]. */
static void take_cover(const struct fv_spread *spread, uint32_t count, uint32_t taken[])
{
    uint32_t histogram[256] = {0}, ties;
    for (int i = 0; i < FIELDS; i++)
        if (spread->cover[i].score > 0) histogram[spread->cover[i].score]++;
    const uint8_t lowest = cut(histogram, count, &ties);
    for (int i = 0; i < FIELDS; i++) {
        const struct fv_corner *field = &spread->cover[i];
        if (field->score > 0 && passes(field->score, lowest, &ties) && take_field(spread, field))
            taken[field->level]++;
    }
}

/* Index of the strongest free corner that a cell has to offer, or -1. */
static int next_of(const struct fv_spread_cell *cell, uint8_t threshold)
{
    int i = 0;
    while (i < cell->count && cell->best[i].taken)
        i++;
    if (i == cell->count) return -1;
    return cell->best[0].score >= threshold && cell->best[i].score < threshold ? -1 : i;
}

/* One round: each cell that gave at most `round` corners gives its next. Returns how many were taken. */
static uint32_t take_round(struct fv_spread_level *level, int round, uint32_t room, uint8_t threshold)
{
    const int32_t cells = level->columns * level->rows;
    uint32_t histogram[256] = {0}, ties, taken = 0;
    for (int32_t i = 0; i < cells; i++) {
        const int next = level->cells[i].taken <= round ? next_of(&level->cells[i], threshold) : -1;
        if (next >= 0) histogram[level->cells[i].best[next].score]++;
    }
    const uint8_t lowest = cut(histogram, room, &ties);
    for (int32_t i = 0; i < cells; i++) {
        struct fv_spread_cell *cell = &level->cells[i];
        const int next = cell->taken <= round ? next_of(cell, threshold) : -1;
        if (next < 0 || !passes(cell->best[next].score, lowest, &ties)) continue;
        cell->best[next].taken = 1;
        cell->taken++;
        taken++;
    }
    return taken;
}

static uint32_t copy_taken(const struct fv_spread_level *level, uint8_t number, struct fv_corner *corners)
{
    uint32_t count = 0;
    for (int32_t i = 0; i < level->columns * level->rows; i++) {
        const struct fv_spread_cell *cell = &level->cells[i];
        for (int k = 0; k < cell->count; k++)
            if (cell->best[k].taken)
                corners[count++] = (struct fv_corner){.x = cell->best[k].x,
                                                      .y = cell->best[k].y,
                                                      .level = number,
                                                      .score = cell->best[k].score};
    }
    return count;
}

/* Rounds until `room` is used up or the level has nothing left; returns how many were taken. */
static uint32_t take_rounds(struct fv_spread_level *level, uint32_t room, uint8_t threshold)
{
    uint32_t taken = 0;
    for (int round = 0; round < FV_SPREAD_KEPT && taken < room; round++)
        taken += take_round(level, round, room - taken, threshold);
    return taken;
}

uint32_t fv_spread_pick(struct fv_spread *spread, struct fv_corner *corners)
{
    uint32_t taken[FOVEA_PYRAMID_LEVELS_MAX] = {0}, left = spread->count, due = 0, done = 0, picked = 0;
    take_cover(spread, spread->count, taken);
    for (uint32_t i = 0; i < spread->levels; i++)
        left -= taken[i];

    /* Coarse to fine, each level up to what it and the coarser ones are due; then what is left, fine to
     * coarse. */
    for (uint32_t i = spread->levels; i-- > 0;) {
        due += share_of(i, spread->levels, spread->count);
        const uint32_t room = due > done + taken[i] ? due - done - taken[i] : 0;
        const uint32_t more = take_rounds(&spread->level[i], room < left ? room : left, spread->threshold);
        left -= more;
        done += taken[i] + more;
    }
    for (uint32_t i = 0; i < spread->levels && left > 0; i++)
        left -= take_rounds(&spread->level[i], left, spread->threshold);

    for (uint32_t i = spread->levels; i-- > 0;)
        picked += copy_taken(&spread->level[i], (uint8_t)i, corners + picked);
    return picked;
}
