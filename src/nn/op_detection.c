/* TFLite_Detection_PostProcess: boxes from centre-size encodings and anchors, then non-maximum
 * suppression, either over each anchor's best class ("fast") or class by class ("regular"). A row
 * of the operator is a step of bounded cost. Order of ties as in the reference: lower index first.
 * Outputs: boxes [n][ymin xmin ymax xmax], classes, scores, count; unused entries are zero. */
#include <string.h>

#include "base/elementary.h"
#include "nn/run.h"

enum { ANCHORS_PER_STEP = 64, BLOCK = 64 };

/* What goes on from step to step, in scratch behind everything else. */
struct run {
    int32_t total, next, selected; /* sorted anchors, the one that comes next, those selected */
    int32_t found;                 /* pairs of anchor and class so far */
};

struct state {
    const struct fv_op_detection *p;
    const uint8_t *scores;
    const float *table; /* score by byte */
    float *boxes;       /* [anchors][4] */
    int32_t *order;     /* anchors by falling score */
    uint8_t *score;     /* byte score that is sorted by */
    uint8_t *active;
    int32_t *found; /* pairs of anchor and class, by falling score */
    struct run *run;
    int32_t columns;
};

static void decode_boxes(const struct fv_nn_call *call, const struct state *s, int32_t begin,
                         int32_t end)
{
    const struct fv_op_detection *p = s->p;
    const float *anchor =
        (const float *)(const void *)(call->model->base + p->anchor_data) + 4 * (ptrdiff_t)begin;
    const float *table = (const float *)(const void *)(call->model->base + p->box_table);
    const uint8_t *code = call->in[0] + 4 * (ptrdiff_t)begin;
    for (int32_t i = begin; i < end; i++, anchor += 4, code += 4) {
        const double y = (double)table[code[0]] / p->y_scale,
                     x = (double)table[code[1]] / p->x_scale;
        const double h = (double)table[code[2]] / p->h_scale,
                     w = (double)table[code[3]] / p->w_scale;
        const float cy = (float)(y * anchor[2] + anchor[0]),
                    cx = (float)(x * anchor[3] + anchor[1]);
        const float half_h = (float)(0.5 * fv_exp(h) * anchor[2]),
                    half_w = (float)(0.5 * fv_exp(w) * anchor[3]);
        float *box = s->boxes + (ptrdiff_t)i * 4;
        box[0] = cy - half_h;
        box[1] = cx - half_w;
        box[2] = cy + half_h;
        box[3] = cx + half_w;
    }
}

/* Boxes that are compared with one at once, and where they stand among the sorted anchors. */
struct block {
    int32_t count, at[BLOCK];
    float y0[BLOCK], x0[BLOCK], y1[BLOCK], x1[BLOCK];
};

/* Intersection over union with box `a`, which has an area; not above zero where boxes are apart or
 * one has no area. Without branches: compilers find the vectors. */
static void find_overlaps(const float *a, const struct block *b, float overlaps[BLOCK])
{
    const float ay0 = a[0], ax0 = a[1], ay1 = a[2], ax1 = a[3], area_a = (ay1 - ay0) * (ax1 - ax0);
    for (int32_t i = 0; i < BLOCK; i++) {
        const float y0 = ay0 > b->y0[i] ? ay0 : b->y0[i], x0 = ax0 > b->x0[i] ? ax0 : b->x0[i];
        const float y1 = ay1 < b->y1[i] ? ay1 : b->y1[i], x1 = ax1 < b->x1[i] ? ax1 : b->x1[i];
        const float dy = y1 - y0, dx = x1 - x0;
        const float h = dy > 0.0f ? dy : 0.0f, w = dx > 0.0f ? dx : 0.0f;
        const float area_b = (b->y1[i] - b->y0[i]) * (b->x1[i] - b->x0[i]), both = h * w;
        const float counted = area_b > 0.0f ? both : 0.0f;
        overlaps[i] = counted / (area_a + area_b - both);
    }
}

/* Anchors whose score passes the threshold, highest first (counting sort by the byte, stable).
 * Returns how many. */
static int32_t sort_by_score(const struct state *s)
{
    int32_t count[257] = {0}, total = 0;
    for (int32_t i = 0; i < s->p->anchors; i++) {
        if (s->table[s->score[i]] >= s->p->score_threshold) ++count[s->score[i]];
    }
    for (int v = 255; v >= 0; --v) {
        const int32_t n = count[v];
        count[v] = total;
        total += n;
    }
    for (int32_t i = 0; i < s->p->anchors; i++) {
        if (s->table[s->score[i]] >= s->p->score_threshold) s->order[count[s->score[i]]++] = i;
    }
    return total;
}

/* Prepare the greedy suppression of the anchors whose byte scores stand in s->score. */
static void suppress_begin(const struct state *s)
{
    s->run->total = sort_by_score(s);
    s->run->next = 0;
    s->run->selected = 0;
    memset(s->active, 1, (size_t)s->run->total);
}

/* Sorted anchors from `first` on that are still active, until the block is full or `end`. Returns
 * the next one. */
static int32_t fill_block(const struct state *s, int32_t first, int32_t end, struct block *b)
{
    b->count = 0;
    for (; first < end && b->count < BLOCK; first++) {
        const float *box = s->boxes + (ptrdiff_t)s->order[first] * 4;
        const int32_t i = b->count;
        b->at[i] = first;
        b->y0[i] = box[0];
        b->x0[i] = box[1];
        b->y1[i] = box[2];
        b->x1[i] = box[3];
        b->count += s->active[first];
    }
    return first;
}

/* Part `part` of the selection of one more anchor, but no more than `limit` in all; they end up at
 * the front of `order`. The first part finds it, each compares it with a share of those behind it.
 * Returns 0 where none is left. */
static int select_part(const struct state *s, int32_t limit, int32_t part, int32_t parts)
{
    struct run *run = s->run;
    while (part == 0 && run->next < run->total && !s->active[run->next])
        run->next++;
    if (run->next >= run->total || run->selected >= limit) return 0;
    const int32_t chosen = s->order[run->next], first = run->next + 1;
    const int32_t behind = run->total - first,
                  end = first + (int32_t)fv_nn_part_first(behind, part + 1, parts);
    const float *box = s->boxes + (ptrdiff_t)chosen * 4;
    const int has_area = (box[2] - box[0]) * (box[3] - box[1]) > 0.0f;
    struct block b = {0};
    for (int32_t j = first + (int32_t)fv_nn_part_first(behind, part, parts); has_area && j < end;) {
        float overlaps[BLOCK];
        j = fill_block(s, j, end, &b);
        find_overlaps(box, &b, overlaps);
        for (int32_t i = 0; i < b.count; i++)
            s->active[b.at[i]] &= !(overlaps[i] > s->p->iou_threshold);
    }
    if (part < parts - 1) return 1;
    s->order[run->selected++] = chosen;
    run->next++;
    return 1;
}

/* Select up to `count` more. */
static void suppress_some(const struct state *s, int32_t count, int32_t limit)
{
    while (count > 0 && select_part(s, limit, 0, 1))
        --count;
}

static void write_detection(const struct fv_nn_call *call, const struct state *s, int32_t slot,
                            int32_t anchor, int32_t class_)
{
    memcpy((float *)(void *)call->out[0] + (ptrdiff_t)slot * 4, s->boxes + (ptrdiff_t)anchor * 4,
           4 * sizeof(float));
    ((float *)(void *)call->out[1])[slot] = (float)class_;
    ((float *)(void *)call->out[2])[slot] =
        s->table[s->scores[(ptrdiff_t)anchor * s->columns + s->p->class_offset + class_]];
}

/* Best class of an anchor that is below (value, class) in the order of falling score and rising
 * index. */
static int32_t next_class(const struct state *s, int32_t anchor, int32_t after)
{
    const uint8_t *score = s->scores + (ptrdiff_t)anchor * s->columns + s->p->class_offset;
    int32_t best = -1;
    for (int32_t c = 0; c < s->p->classes; c++) {
        if (after >= 0 && (score[c] > score[after] || (score[c] == score[after] && c <= after)))
            continue;
        if (best < 0 || score[c] > score[best]) best = c;
    }
    return best;
}

/* ---- steps: each row of the operator is one -------------------------------------------------- */

static int32_t decode_steps(const struct fv_op_detection *p)
{
    return (p->anchors - 1) / ANCHORS_PER_STEP + 1;
}

/* Selections of one class at most. */
static int32_t limit_of(const struct fv_op_detection *p)
{
    const int32_t limit = p->per_class < p->anchors ? p->per_class : p->anchors;
    return limit < 1 ? 1 : limit;
}

/* Of a selection. */
static int32_t parts_of(const struct fv_op_detection *p)
{
    return p->parts > 1 ? p->parts : 1;
}

/* As many as the file's rows leave. */
static int32_t steps_per_class(const struct fv_op_detection *p, int32_t rows)
{
    return (rows - decode_steps(p) - 1) / parts_of(p) / p->classes;
}

bool fv_nn_detection_rows_fit(const struct fv_op_detection *p, int32_t rows)
{
    const int64_t between = (int64_t)rows - decode_steps(p) - 1, parts = parts_of(p);
    if (!p->regular_nms) return between == p->max_detections * parts + 1;
    if (between <= 0 || between % (p->classes * parts) != 0) return false;
    const int64_t steps = between / parts / p->classes;
    return parts == 1 ? steps <= limit_of(p) : steps == limit_of(p);
}

static void best_scores(const struct state *s, int32_t begin, int32_t end)
{
    for (int32_t i = begin; i < end; i++) {
        const uint8_t *score = s->scores + (ptrdiff_t)i * s->columns + s->p->class_offset;
        uint8_t best = 0;
        for (int32_t c = 0; c < s->p->classes; c++)
            best = score[c] > best ? score[c] : best;
        s->score[i] = best;
    }
}

static void write_fast(const struct fv_nn_call *call, const struct state *s)
{
    const struct fv_op_detection *p = s->p;
    const int32_t per = p->max_per_anchor < p->classes ? p->max_per_anchor : p->classes;
    for (int32_t i = 0; i < s->run->selected; i++) {
        int32_t class_ = -1;
        for (int32_t k = 0; k < per; k++) {
            class_ = next_class(s, s->order[i], class_);
            write_detection(call, s, i * per + k, s->order[i], class_);
        }
    }
    *(float *)(void *)call->out[3] = (float)s->run->selected;
}

/* Pairs of anchor and class by falling score take in what class `c` has left. */
static void merge_class(const struct state *s, int32_t c)
{
    const struct fv_op_detection *p = s->p;
    int32_t *found = s->found, total = s->run->found;
    for (int32_t i = 0; i < s->run->selected; i++) {
        const uint8_t score = s->score[s->order[i]];
        int32_t at = total;
        while (at > 0 && s->scores[(ptrdiff_t)found[2 * at - 2] * s->columns + p->class_offset +
                                   found[2 * at - 1]] < score)
            --at;
        if (at >= p->max_detections) continue;
        total = total < p->max_detections ? total + 1 : total;
        memmove(found + 2 * at + 2, found + 2 * at, (size_t)(total - 1 - at) * 2 * sizeof *found);
        found[2 * at] = s->order[i];
        found[2 * at + 1] = c;
    }
    s->run->found = total;
}

static void regular_step(const struct state *s, int32_t row, int32_t steps)
{
    const struct fv_op_detection *p = s->p;
    const int32_t parts = parts_of(p), step = row / parts, part = row % parts, c = step / steps;
    if (step % steps == 0 && part == 0) {
        for (int32_t i = 0; i < p->anchors; i++)
            s->score[i] = s->scores[(ptrdiff_t)i * s->columns + p->class_offset + c];
        suppress_begin(s);
    }
    if (parts > 1)
        (void)select_part(s, p->per_class, part, parts);
    else
        suppress_some(s, (limit_of(p) - 1) / steps + 1, p->per_class);
    if (step % steps == steps - 1 && part == parts - 1) merge_class(s, c);
}

static void write_regular(const struct fv_nn_call *call, const struct state *s)
{
    for (int32_t i = 0; i < s->run->found; i++)
        write_detection(call, s, i, s->found[2 * i], s->found[2 * i + 1]);
    *(float *)(void *)call->out[3] = (float)s->run->found;
}

static void clear_outputs(const struct fv_nn_call *call, const struct state *s)
{
    const size_t slots = (size_t)s->p->max_detections * (size_t)s->p->max_per_anchor;
    memset(call->out[0], 0, slots * 16);
    memset(call->out[1], 0, slots * 4);
    memset(call->out[2], 0, slots * 4);
    *s->run = (struct run){0, 0, 0, 0};
}

static void step(const struct fv_nn_call *call, const struct state *s, int32_t row)
{
    const struct fv_op_detection *p = s->p;
    const int32_t decode = decode_steps(p), begin = row * ANCHORS_PER_STEP;
    if (row == 0) clear_outputs(call, s);
    if (row < decode) {
        const int32_t end =
            p->anchors - begin > ANCHORS_PER_STEP ? begin + ANCHORS_PER_STEP : p->anchors;
        decode_boxes(call, s, begin, end);
        if (!p->regular_nms) best_scores(s, begin, end);
    } else if (row == call->op->rows - 1) {
        if (p->regular_nms)
            write_regular(call, s);
        else
            write_fast(call, s);
    } else if (p->regular_nms) {
        regular_step(s, row - decode, steps_per_class(p, call->op->rows));
    } else if (row == decode) {
        suppress_begin(s);
    } else {
        const int32_t parts = parts_of(p), part = (row - decode - 1) % parts;
        (void)select_part(s, p->max_detections, part, parts);
    }
}

void fv_nn_op_detection(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_detection *p = &call->op->u.detection;
    const size_t n = (size_t)p->anchors,
                 slots = (size_t)p->max_detections * (size_t)p->max_per_anchor;
    uint8_t *scratch = call->scratch;
    const struct state s = {
        .p = p,
        .scores = call->in[1],
        .table = (const float *)(const void *)(call->model->base + p->score_table),
        .boxes = (float *)(void *)scratch,
        .order = (int32_t *)(void *)(scratch + 16 * n),
        .score = scratch + 20 * n,
        .active = scratch + 21 * n,
        .found = (int32_t *)(void *)(scratch + 32 * n),
        .run = (struct run *)(void *)(scratch + 32 * n + 16 * slots),
        .columns = p->classes + p->class_offset,
    };
    for (int32_t row = begin; row < end; row++)
        step(call, &s, row);
}
