#include "features/spread.h"

#include "image/pyramid.h"

#include <string.h>

enum {
    OVER_STRONGEST = 30,
    CELL_MIN_PX = 4,
    FULL_WORTH_LEVELS = 6,
    WORTH_MAX = 640,
    STEP = 8,
    CHUNK = 16
};

uint32_t fv_spread_quota(uint32_t level, uint32_t levels, uint32_t count, uint32_t over)
{
    uint64_t part = 0, sum = 0, weight = 1;
    for (uint32_t i = 0; i < levels; i++)
        weight *= over;
    for (uint32_t i = 0; i < levels; i++) {
        sum += weight;
        if (i == level) part = weight;
        weight = weight / over * (over - 1);
    }
    return (uint32_t)((count * part + sum / 2) / sum);
}

void fv_spread_carve(struct fv_spread *spread, uint32_t levels, const int32_t width[],
                     const int32_t height[], uint32_t count_max, struct fv_arena *frame)
{
    spread->levels = levels;
    spread->cover = fv_arena_take(frame, FV_SPREAD_FIELDS, sizeof *spread->cover);
    for (uint32_t i = 0; i < levels; i++) {
        struct fv_spread_level *level = &spread->level[i];
        const uint64_t scale = (uint64_t)fv_pyramid_scale_q16(i) * (FV_SPREAD_COVER / 2) << 16;
        *level = (struct fv_spread_level){.width = width[i], .height = height[i]};
        level->field_x = (uint32_t)(scale / (uint32_t)width[0]);
        level->field_y = (uint32_t)(scale / (uint32_t)height[0]);
        level->cells_max = fv_spread_quota(i, levels, count_max, FV_SPREAD_OVER_EVEN) + 1;
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

/* 2^32 / divisor rounded up: for numerators and divisors below 2^16 multiplied() divides exactly.
 */
static uint32_t inverse(int32_t divisor)
{
    return (uint32_t)((UINT64_C(0x100000000) + (uint32_t)divisor - 1) / (uint32_t)divisor);
}

static int32_t multiplied(int32_t numerator, uint32_t inverse_q32)
{
    return (int32_t)((uint64_t)(uint32_t)numerator * inverse_q32 >> 32);
}

static void begin_level(struct fv_spread_level *level, uint32_t quota)
{
    const uint32_t cells = quota < 1 ? 1 : quota < level->cells_max ? quota : level->cells_max;
    level->cell_px = square_root((uint32_t)level->width * (uint32_t)level->height / cells);
    if (level->cell_px < CELL_MIN_PX) level->cell_px = CELL_MIN_PX;
    /* Cells cut by the border make more than asked: widen until they fit, at most until one cell
     * covers all.
     */
    for (;; level->cell_px++) {
        level->columns = (level->width + level->cell_px - 1) / level->cell_px;
        level->rows = (level->height + level->cell_px - 1) / level->cell_px;
        if ((uint32_t)level->columns * (uint32_t)level->rows <= level->cells_max) break;
    }
    level->per_cell = inverse(level->cell_px);
    memset(level->cells, 0, (size_t)(level->columns * level->rows) * sizeof *level->cells);
}

/* 1 where covering is what counts; else the scale of the level, of the coarsest half of that of the
 * last before them. 255 times the largest stays below WORTH_MAX. */
static uint16_t worth_of_level(uint32_t level, uint8_t per_cell)
{
    if (per_cell < FV_SPREAD_KEPT) return 256;
    if (level < FULL_WORTH_LEVELS) return (uint16_t)(fv_pyramid_scale_q16(level) >> 8);
    return (uint16_t)(fv_pyramid_scale_q16(FULL_WORTH_LEVELS - 1) >> 9);
}

static int worth(const struct fv_spread *spread, const struct fv_corner *corner)
{
    return corner->score * spread->worth_q8[corner->level] >> 8;
}

void fv_spread_begin(struct fv_spread *spread, uint32_t count, uint8_t threshold, uint8_t per_cell)
{
    spread->per_cell = per_cell;
    spread->count = count;
    spread->threshold = threshold;
    memset(spread->cover, 0, FV_SPREAD_FIELDS * sizeof *spread->cover);
    for (uint32_t i = 0; i < spread->levels; i++) {
        spread->worth_q8[i] = worth_of_level(i, per_cell);
        begin_level(&spread->level[i],
                    fv_spread_quota(i, spread->levels, count, FV_SPREAD_OVER_EVEN));
    }
}

static struct fv_spread_cell *cell_at(const struct fv_spread_level *level, int32_t x, int32_t y)
{
    return &level->cells[multiplied(y, level->per_cell) * level->columns +
                         multiplied(x, level->per_cell)];
}

/* The field in which a pixel of a level has its centre. */
static int32_t field_of(const struct fv_spread_level *level, int32_t x, int32_t y)
{
    return multiplied(2 * y + 1, level->field_y) * FV_SPREAD_COVER +
           multiplied(2 * x + 1, level->field_x);
}

static uint64_t kept_of(int32_t x, int32_t y, uint8_t score, int32_t field)
{
    return (uint64_t)score << 40 | (uint64_t)(0xffff - y) << 24 | (uint64_t)(0xffff - x) << 8 |
           (uint64_t)field;
}

static uint8_t score_of(uint64_t kept)
{
    return (uint8_t)(kept >> 40);
}

static uint8_t field_of_kept(uint64_t kept)
{
    return (uint8_t)kept;
}

static struct fv_corner corner_of(uint64_t kept, uint8_t level)
{
    return (struct fv_corner){.x = (uint16_t)(0xffff - (kept >> 8 & 0xffff)),
                              .y = (uint16_t)(0xffff - (kept >> 24 & 0xffff)),
                              .level = level,
                              .score = score_of(kept)};
}

void fv_spread_offer(struct fv_spread *spread, uint32_t level, int32_t x, int32_t y, uint8_t score)
{
    const struct fv_spread_level *at = &spread->level[level];
    const int32_t index = field_of(at, x, y);
    const struct fv_corner corner = {
        .x = (uint16_t)x, .y = (uint16_t)y, .level = (uint8_t)level, .score = score};
    if (worth(spread, &corner) > worth(spread, &spread->cover[index]))
        spread->cover[index] = corner;

    struct fv_spread_cell *cell = cell_at(at, x, y);
    if (score < spread->threshold && score_of(cell->best[0]) >= spread->threshold) return;
    /* The smaller of each pair moves on: no branch to mispredict, where the strength of corners is
     * random. */
    uint64_t moving = kept_of(x, y, score, index);
    for (int i = 0; i < FV_SPREAD_KEPT; i++) {
        const uint64_t here = cell->best[i];
        cell->best[i] = here > moving ? here : moving;
        moving = here > moving ? moving : here;
    }
    cell->count = (uint8_t)(cell->count + (cell->count < FV_SPREAD_KEPT));
}

/* Whether every field that the rows [y, end) of a cell touch has a corner that counts there as much
 * as one with `score` at this level. */
static bool covered(const struct fv_spread *spread, uint32_t level, int32_t column, int32_t y,
                    int32_t end, uint8_t score)
{
    const struct fv_spread_level *at = &spread->level[level];
    const int32_t x = column * at->cell_px, right = x + at->cell_px;
    const int32_t first = field_of(at, x, y),
                  last = field_of(at, (right < at->width ? right : at->width) - 1, end - 1);
    const struct fv_corner corner = {.level = (uint8_t)level, .score = score};
    const int32_t wide = (last - first) % FV_SPREAD_COVER, least = worth(spread, &corner);
    for (int32_t row = first; row <= last; row += FV_SPREAD_COVER)
        for (int32_t i = row; i <= row + wide; i++)
            if (worth(spread, &spread->cover[i]) < least) return false;
    return true;
}

/* The score from which on corners of a cell may still change what is kept, when weak ones do not
 * count any more: the threshold, or beyond the last of a full cell. */
static uint8_t score_needed(const struct fv_spread *spread, const struct fv_spread_cell *cell)
{
    const uint8_t last = score_of(cell->best[FV_SPREAD_KEPT - 1]);
    return last < spread->threshold ? spread->threshold : last < 254 ? last + 1 : last;
}

void fv_spread_thresholds(struct fv_spread *spread, uint32_t level, int32_t y, uint8_t least,
                          uint8_t *thresholds)
{
    const struct fv_spread_level *at = &spread->level[level];
    const int32_t row = multiplied(y, at->per_cell), top = row * at->cell_px,
                  bottom = top + at->cell_px < at->height ? top + at->cell_px : at->height;
    if (least >= spread->threshold) return;
    if (y == bottom - 1) memset(thresholds, least, (size_t)at->width);
    if (y == bottom - 1 || (y - top) % STEP != STEP / 2) return;
    for (int32_t column = 0; column < at->columns; column++) {
        struct fv_spread_cell *cell = &at->cells[row * at->columns + column];
        const int32_t x = column * at->cell_px, right = x + at->cell_px;
        const int32_t end = right < at->width ? right : at->width;
        if (score_of(cell->best[0]) >= spread->threshold) {
            const uint8_t needed = score_needed(spread, cell);
            if (needed > cell->needed &&
                covered(spread, level, column, y - 1, bottom, (uint8_t)(needed - 1)))
                cell->needed = needed;
        }
        const uint8_t here = cell->needed > least ? cell->needed : least;
        for (int32_t i = x; i < end; i += CHUNK)
            memset(thresholds + i, here, CHUNK);
        if (column == 0) continue;
        /* Neighbours of pixels that may count are seen as well as these. */
        if (thresholds[x - 1] > here) thresholds[x - 1] = here;
        if (thresholds[x - 1] < here) thresholds[x] = thresholds[x - 1];
    }
}

/* Score the corners of a cell anew, and sort them. */
static void score_cell(struct fv_spread_cell *cell, uint8_t level, uint8_t threshold,
                       fv_spread_measure_fn *measure, const void *context)
{
    const bool strong = score_of(cell->best[0]) >= threshold;
    uint64_t sorted[FV_SPREAD_KEPT] = {0};
    uint8_t count = 0;
    for (int i = 0; i < cell->count; i++) {
        const uint64_t kept = cell->best[i];
        if (strong && score_of(kept) < threshold) break;
        const struct fv_corner corner = corner_of(kept, level);
        const uint64_t scored = kept_of(
            corner.x, corner.y, measure(context, level, corner.x, corner.y), field_of_kept(kept));
        int at = count++;
        for (; at > 0 && sorted[at - 1] < scored; at--)
            sorted[at] = sorted[at - 1];
        sorted[at] = scored;
    }
    cell->count = count;
    memcpy(cell->best, sorted, sizeof sorted);
}

void fv_spread_score(struct fv_spread *spread, fv_spread_measure_fn *measure, const void *context)
{
    for (uint32_t i = 0; i < spread->levels; i++) {
        const struct fv_spread_level *level = &spread->level[i];
        for (int32_t k = 0; k < level->columns * level->rows; k++)
            score_cell(&level->cells[k], (uint8_t)i, spread->threshold, measure, context);
    }
    for (int i = 0; i < FV_SPREAD_FIELDS; i++) {
        struct fv_corner *corner = &spread->cover[i];
        if (corner->score > 0)
            corner->score = measure(context, corner->level, corner->x, corner->y);
    }
    spread->threshold = 0; /* it is of the other measure, and weak ones are left out */
}

/* Corners of a level by score, those only that may be picked for their strength. */
struct ranking {
    uint32_t total, room; /* of them `room` are picked */
    uint32_t of_score[256];
};

static void rank(struct fv_spread_level *level, uint8_t threshold, int per_cell,
                 struct ranking *ranking)
{
    *ranking = (struct ranking){0};
    for (int32_t i = 0; i < level->columns * level->rows; i++) {
        struct fv_spread_cell *cell = &level->cells[i];
        cell->eligible = (uint8_t)(cell->count < per_cell ? cell->count : per_cell);
        if (cell->count > 0 && score_of(cell->best[0]) >= threshold)
            while (score_of(cell->best[cell->eligible - 1]) < threshold)
                cell->eligible--;
        for (int k = 0; k < cell->eligible; k++)
            ranking->of_score[score_of(cell->best[k])]++;
        ranking->total += cell->eligible;
    }
}

/* Rank all levels; cells may give more than planned where the count would not be reached otherwise.
 */
static void rank_levels(struct fv_spread *spread, struct ranking rankings[])
{
    uint32_t total = 0;
    int per_cell = spread->per_cell;
    do {
        total = 0;
        for (uint32_t i = 0; i < spread->levels; i++) {
            rank(&spread->level[i], spread->threshold, per_cell, &rankings[i]);
            total += rankings[i].total;
        }
    } while (total < spread->count && ++per_cell <= FV_SPREAD_KEPT);
}

/* Divide `count` picks among the levels: coarse to fine, each level up to what it and the coarser
 * ones are due; then the rest, fine to coarse. */
static void divide(const struct fv_spread *spread, uint32_t count, struct ranking rankings[])
{
    const uint32_t over = spread->per_cell < FV_SPREAD_KEPT ? FV_SPREAD_OVER_EVEN : OVER_STRONGEST;
    uint32_t due = 0, done = 0;
    for (uint32_t i = spread->levels; i-- > 0;) {
        due += fv_spread_quota(i, spread->levels, count, over);
        if (due > count || i == 0) due = count;
        const uint32_t room = due - done;
        rankings[i].room = room < rankings[i].total ? room : rankings[i].total;
        done += rankings[i].room;
    }
    for (uint32_t i = 0; i < spread->levels && done < count; i++) {
        const uint32_t more = rankings[i].total - rankings[i].room, left = count - done;
        rankings[i].room += more < left ? more : left;
        done += more < left ? more : left;
    }
}

/* Take the strongest of a level into its cells' flags, and note their fields. */
static void take_strongest(struct fv_spread_level *level, const struct ranking *ranking, bool has[])
{
    uint32_t room = ranking->room;
    int lowest =
        255; /* the lowest score that is taken; `room` becomes how many of exactly that score */
    while (lowest > 0 && ranking->of_score[lowest] <= room)
        room -= ranking->of_score[lowest--];
    for (int32_t i = 0; i < level->columns * level->rows; i++) {
        struct fv_spread_cell *cell = &level->cells[i];
        cell->taken = 0;
        for (int k = 0; k < cell->eligible; k++) {
            const int score = score_of(cell->best[k]);
            const bool taken = score > lowest || (score == lowest && room > 0);
            if (taken && score == lowest) room--;
            if (!taken) break;
            has[field_of_kept(cell->best[k])] = true;
            cell->taken |= (uint8_t)(1u << k);
        }
    }
}

/* How many fields are to be filled: the empty ones that have a corner, until enough fields hold
 * one. */
static uint32_t fields_to_fill(const struct fv_spread *spread, const bool has[])
{
    uint32_t held = 0, empty = 0;
    for (int i = 0; i < FV_SPREAD_FIELDS; i++) {
        held += has[i];
        empty += !has[i] && spread->cover[i].score > 0;
    }
    const uint32_t wanted = held < FV_SPREAD_WANTED ? FV_SPREAD_WANTED - held : 0;
    return empty < wanted ? empty : wanted;
}

/* Mark the corner of a field as taken in the cell of its level. Where stronger ones have pushed it
 * out, it takes the place of the weakest that is still free. False where all are taken already. */
static bool take_field(const struct fv_spread *spread, const struct fv_corner *field, int32_t index)
{
    struct fv_spread_cell *cell = cell_at(&spread->level[field->level], field->x, field->y);
    const uint64_t kept = kept_of(field->x, field->y, field->score, index);
    int place = 0;
    while (place < cell->count && cell->best[place] != kept)
        place++;
    if (place == cell->count) {
        place--;
        while (place >= 0 && (cell->taken >> place & 1))
            place--;
        if (place < 0) return false;
        cell->best[place] = kept;
    }
    cell->taken |= (uint8_t)(1u << place);
    return true;
}

/* Fill up to `room` empty fields, those with the worthiest corners; returns how many were filled.
 */
static uint32_t fill_fields(const struct fv_spread *spread, const bool has[], uint32_t room)
{
    uint32_t of_worth[WORTH_MAX] = {0}, filled = 0;
    for (int i = 0; i < FV_SPREAD_FIELDS; i++)
        if (!has[i]) of_worth[worth(spread, &spread->cover[i])]++;
    int lowest = WORTH_MAX - 1;
    while (lowest > 1 && of_worth[lowest] <= room)
        room -= of_worth[lowest--];
    for (int i = 0; i < FV_SPREAD_FIELDS; i++) {
        const struct fv_corner *field = &spread->cover[i];
        const int value = worth(spread, field);
        if (has[i] || value < lowest || value == 0) continue;
        if (value == lowest && room == 0) continue;
        if (value == lowest) room--;
        filled += take_field(spread, field, i);
    }
    return filled;
}

static uint32_t copy_taken(const struct fv_spread_level *level, uint8_t number,
                           struct fv_corner *corners)
{
    uint32_t count = 0;
    for (int32_t i = 0; i < level->columns * level->rows; i++)
        for (int k = 0; k < level->cells[i].count; k++)
            if (level->cells[i].taken >> k & 1)
                corners[count++] = corner_of(level->cells[i].best[k], number);
    return count;
}

/* Take up to `room` more of a level in the order of its cells; returns how many. */
static uint32_t top_up(struct fv_spread_level *level, uint32_t room)
{
    uint32_t taken = 0;
    for (int32_t i = 0; i < level->columns * level->rows; i++)
        for (int k = 0; k < level->cells[i].eligible && taken < room; k++) {
            taken += !(level->cells[i].taken >> k & 1);
            level->cells[i].taken |= (uint8_t)(1u << k);
        }
    return taken;
}

uint32_t fv_spread_pick(struct fv_spread *spread, struct fv_corner *corners)
{
    /* Fields to fill cost strong corners, whose loss empties further fields: a few iterations
     * come close. Each looks ahead by what the last one added, so that rather too many strong ones
     * are given up, and some taken back at the end. */
    enum { ITERATIONS = 4 };
    struct ranking rankings[FOVEA_PYRAMID_LEVELS_MAX];
    bool has[FV_SPREAD_FIELDS];
    uint32_t strong = spread->count, fill = 0, picked = 0;
    rank_levels(spread, rankings);
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        const uint32_t before = fill;
        memset(has, 0, sizeof has);
        divide(spread, strong, rankings);
        for (uint32_t i = 0; i < spread->levels; i++)
            take_strongest(&spread->level[i], &rankings[i], has);
        fill = fields_to_fill(spread, has);
        const uint32_t ahead = fill + (iteration > 0 && fill > before ? fill - before : 0);
        if (iteration < ITERATIONS - 1) strong = spread->count > ahead ? spread->count - ahead : 0;
    }
    uint32_t left = spread->count;
    for (uint32_t i = 0; i < spread->levels; i++)
        left -= rankings[i].room;
    left -= fill_fields(spread, has, fill < left ? fill : left);
    for (uint32_t i = 0; i < spread->levels && left > 0; i++)
        left -= top_up(&spread->level[i], left);
    for (uint32_t i = spread->levels; i-- > 0;)
        picked += copy_taken(&spread->level[i], (uint8_t)i, corners + picked);
    return picked;
}
