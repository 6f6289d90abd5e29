#include "objects/assign.h"

/* The problem with at least as many columns as rows; entries count from 1, column 0 is where a new
 * row starts from. */
struct problem {
    const float *cost;
    int32_t row_step, column_step, rows, columns;
    struct fv_assign_scratch *s;
};

static double reduced(const struct problem *p, int32_t row, int32_t column)
{
    const float cost = p->cost[(row - 1) * p->row_step + (column - 1) * p->column_step];
    return (double)(cost < 1.0f ? cost : 1.0f) - p->s->row_potential[row] -
           p->s->column_potential[column];
}

/* One step of Dijkstra's search: take in the row of `column`, return the nearest column not yet
 * reached. */
static int32_t widen(const struct problem *p, int32_t column)
{
    struct fv_assign_scratch *s = p->s;
    const int32_t row = s->row_of[column];
    double delta = 1e9;
    int32_t next = 0;
    s->used[column] = 1;
    for (int32_t j = 1; j <= p->columns; j++) {
        if (s->used[j]) continue;
        const double length = reduced(p, row, j);
        if (length < s->least[j]) {
            s->least[j] = length;
            s->way[j] = column;
        }
        if (s->least[j] < delta) {
            delta = s->least[j];
            next = j;
        }
    }
    for (int32_t j = 0; j <= p->columns; j++) {
        if (s->used[j]) {
            s->row_potential[s->row_of[j]] += delta;
            s->column_potential[j] -= delta;
        } else {
            s->least[j] -= delta;
        }
    }
    return next;
}

static void add_row(const struct problem *p, int32_t row)
{
    struct fv_assign_scratch *s = p->s;
    int32_t column = 0;
    s->row_of[0] = row;
    for (int32_t j = 0; j <= p->columns; j++) {
        s->least[j] = 1e9;
        s->used[j] = 0;
    }
    do
        column = widen(p, column);
    while (s->row_of[column] != 0);
    while (column != 0) { /* turn the path over */
        const int32_t before = s->way[column];
        s->row_of[column] = s->row_of[before];
        column = before;
    }
}

void fv_assign(const float *cost, int32_t stride, int32_t rows, int32_t columns,
               struct fv_assign_scratch *s, int32_t *column_of)
{
    const int turned = rows > columns;
    const struct problem p = {.cost = cost,
                              .row_step = turned ? 1 : stride,
                              .column_step = turned ? stride : 1,
                              .rows = turned ? columns : rows,
                              .columns = turned ? rows : columns,
                              .s = s};
    for (int32_t r = 0; r < rows; r++)
        column_of[r] = -1;
    for (int32_t j = 0; j <= p.columns; j++) {
        s->column_potential[j] = 0;
        s->row_of[j] = 0;
    }
    for (int32_t i = 0; i <= p.rows; i++)
        s->row_potential[i] = 0;
    for (int32_t i = 1; i <= p.rows; i++)
        add_row(&p, i);
    for (int32_t j = 1; j <= p.columns; j++) {
        const int32_t i = s->row_of[j];
        if (i == 0) continue;
        const int32_t r = turned ? j - 1 : i - 1, c = turned ? i - 1 : j - 1;
        if (cost[r * stride + c] < 1.0f) column_of[r] = c;
    }
}
