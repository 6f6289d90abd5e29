/* D* Lite of tools/examples/navigate against Dijkstra's algorithm: on drawn fields whose prices
 * change while the robot moves and the window goes on over the field's edge, costs are the same
 * numbers; and a small change is repaired without looking at the whole field again. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "../../../tools/examples/navigate/dstar_lite.h"
#include "base/elementary.h"

enum { LEAST = 100000, REACH = 4, SIDE_MAX = DSTAR_SIDE - 1, CELLS_MAX = SIDE_MAX * SIDE_MAX };

static struct dstar search, anew;
static struct fv_random draws;
static int32_t corner[2], side; /* of the window, in the field */
static int32_t robot[2];        /* in the window */

static int32_t below(int32_t bound)
{
    return (int32_t)fv_random_below(&draws, (uint32_t)bound);
}

static int32_t field_of(int32_t x, int32_t y)
{
    return (corner[1] + y) % DSTAR_SIDE * DSTAR_SIDE + (corner[0] + x) % DSTAR_SIDE;
}

/* ---- Dijkstra's, over the window ------------------------------------------------------------- */

static int64_t truth[CELLS_MAX];
static struct {
    int64_t cost;
    int32_t cell;
} queue[9 * CELLS_MAX], last; /* a heap; a cell may be in it several times */
static int32_t queued;

static void offer(int32_t cell, int64_t cost)
{
    int32_t at = queued;
    if (cost >= truth[cell]) return;
    truth[cell] = cost;
    for (queued++; at > 0 && queue[(at - 1) / 2].cost > cost; at = (at - 1) / 2)
        queue[at] = queue[(at - 1) / 2];
    queue[at].cost = cost;
    queue[at].cell = cell;
}

static int32_t take(void)
{
    const int32_t first = queue[0].cell;
    int32_t at = 0;
    last = queue[--queued];
    for (int32_t child = 1; child < queued; child = 2 * at + 1) {
        if (child + 1 < queued && queue[child + 1].cost < queue[child].cost) child++;
        if (queue[child].cost >= last.cost) break;
        queue[at] = queue[child];
        at = child;
    }
    queue[at] = last;
    return first;
}

static void find_truth(void)
{
    for (int32_t i = 0; i < side * side; i++)
        truth[i] = DSTAR_NO_WAY;
    queued = 0;
    for (int32_t i = 0; i < side * side; i++)
        offer(i, search.exit[field_of(i % side, i / side)]);
    while (queued > 0) {
        const int32_t cell = take();
        for (int32_t k = 0; k < 9; k++) {
            const int32_t x = cell % side + k % 3 - 1, y = cell / side + k / 3 - 1;
            if (k == 4 || x < 0 || y < 0 || x >= side || y >= side) continue;
            const int32_t price = search.price[field_of(x, y)];
            if (price == DSTAR_CLOSED) continue;
            offer(y * side + x, truth[cell] + (k % 2 == 0 ? dstar_diagonal(price) : price));
        }
    }
}

/* ---- fields ---------------------------------------------------------------------------------- */

static void draw_cell(int32_t x, int32_t y)
{
    static const int32_t prices[] = {1, 1, 1, 1, 3, 3, 7, 60};
    const int32_t cell = field_of(x, y), price = prices[below(8)] * LEAST;
    dstar_change(&search, cell, below(5) == 0 ? DSTAR_CLOSED : price + below(2) * below(LEAST),
                 search.exit[cell]);
}

static void draw_exit(int32_t x, int32_t y, int64_t cost)
{
    const int32_t cell = field_of(x, y);
    dstar_change(&search, cell, search.price[cell], cost);
}

/* At the goal's cell, or all along one edge. */
static void draw_exits(void)
{
    const int32_t x = below(side), y = below(side);
    for (int32_t i = 0; i < side * side; i++)
        draw_exit(i % side, i / side, DSTAR_NO_WAY);
    if (below(2) == 0) draw_exit(x, y, 0);
    for (int32_t i = 0; i < side && search.exit[field_of(x, y)] != 0; i++)
        draw_exit(i, 0, (int64_t)LEAST * 3 * (5 + abs(i - x)));
}

static void draw_field(int32_t length)
{
    side = length;
    for (int32_t axis = 0; axis < 2; axis++) {
        corner[axis] = below(DSTAR_SIDE);
        robot[axis] = below(side);
    }
    dstar_begin(&search, field_of(side / 2, side / 2), LEAST);
    for (int32_t i = 0; i < side * side; i++)
        draw_cell(i % side, i / side);
    draw_exits();
}

/* The window goes on by a column: the first is closed, another comes behind the last. */
static void go_on(void)
{
    for (int32_t y = 0; y < side; y++)
        dstar_change(&search, field_of(0, y), DSTAR_CLOSED, DSTAR_NO_WAY);
    corner[0] = (corner[0] + 1) % DSTAR_SIDE;
    for (int32_t y = 0; y < side; y++)
        draw_cell(side - 1, y);
    if (robot[0] > 0) robot[0]--;
}

static void change(void)
{
    const int32_t size = 1 + below(6), x0 = below(side), y0 = below(side);
    for (int32_t i = 0; i < size * size; i++)
        if (x0 + i % size < side && y0 + i / size < side) draw_cell(x0 + i % size, y0 + i / size);
    if (below(20) == 0) draw_exits();
    if (below(4) == 0) go_on();
    for (int32_t axis = 0; axis < 2; axis++) {
        robot[axis] += below(3) - 1;
        if (robot[axis] < 0 || robot[axis] >= side || below(20) == 0) robot[axis] = below(side);
    }
}

/* ---- judged ---------------------------------------------------------------------------------- */

/* What a robot that looks some steps ahead reads. */
static void costs_around_are_right(int64_t cost)
{
    for (int32_t i = 0; i < side * side; i++) {
        const int32_t x = i % side, y = i / side;
        const int64_t g = search.g[field_of(x, y)];
        if (abs(x - robot[0]) > REACH || abs(y - robot[1]) > REACH) continue;
        if (truth[i] <= cost)
            assert_int_equal(g, truth[i]);
        else
            assert_true(g > cost || cost == DSTAR_NO_WAY);
    }
}

/* From cell to cell by what costs least, down to an exit. */
static void the_way_down_is_right(void)
{
    int32_t x = robot[0], y = robot[1];
    while (search.exit[field_of(x, y)] != search.g[field_of(x, y)]) {
        const int32_t cell = field_of(x, y), from_x = x, from_y = y;
        assert_int_equal(search.g[cell], truth[y * side + x]);
        for (int32_t k = 0; k < 9; k++) {
            const int32_t to_x = from_x + k % 3 - 1, to_y = from_y + k / 3 - 1;
            if (k == 4 || to_x < 0 || to_y < 0 || to_x >= side || to_y >= side) continue;
            const int64_t step =
                k % 2 == 0 ? dstar_diagonal(search.price[cell]) : search.price[cell];
            if (search.g[field_of(to_x, to_y)] + step != search.g[cell]) continue;
            x = to_x;
            y = to_y;
        }
        assert_true(x != from_x || y != from_y);
    }
}

static void costs_are_those_of_dijkstra(void **state)
{
    int32_t ways = 0;
    (void)state;
    fv_random_seed(&draws, 1);
    for (int32_t field = 0; field < 40; field++) {
        draw_field(field == 0 ? SIDE_MAX : 2 + below(60));
        for (int32_t round = 0; round < 40; round++) {
            const int64_t cost = dstar_find(&search, field_of(robot[0], robot[1]), REACH);
            find_truth();
            assert_int_equal(cost, truth[robot[1] * side + robot[0]]);
            costs_around_are_right(cost);
            if (cost < DSTAR_NO_WAY) the_way_down_is_right();
            ways += cost < DSTAR_NO_WAY;
            change();
        }
    }
    print_message("%d of 1600 searches found a way\n", (int)ways);
    assert_in_range(ways, 1000, 1550);
}

/* A search that goes on after `search` had one change, and one that begins with the field as it is:
 * cells that each looked at. */
static void compare(int64_t *repaired, int64_t *begun)
{
    const int32_t from = field_of(robot[0], robot[1]);
    const int64_t before = search.looks, first = anew.looks;
    dstar_begin(&anew, from, LEAST);
    for (int32_t i = 0; i < DSTAR_CELLS; i++)
        dstar_change(&anew, i, search.price[i], search.exit[i]);
    assert_int_equal(dstar_find(&search, from, REACH), dstar_find(&anew, from, REACH));
    *repaired += search.looks - before;
    *begun += anew.looks - first;
}

/* A robot drives down a field of 200 by 200, and sees something new at each step. */
static void a_repair_looks_at_few_cells(void **state)
{
    int64_t repaired = 0, begun = 0;
    (void)state;
    fv_random_seed(&draws, 2);
    draw_field(200);
    for (int32_t i = 0; i < side * side; i++)
        draw_exit(i % side, i / side, i == 0 ? 0 : DSTAR_NO_WAY);
    robot[0] = robot[1] = 180;
    (void)dstar_find(&search, field_of(robot[0], robot[1]), REACH);
    for (int32_t step = 0; step < 60; step++) {
        for (int32_t i = 0; i < 4; i++)
            draw_cell(robot[0] - 8 + below(17), robot[1] - 8 + below(17));
        robot[step % 2]--;
        compare(&repaired, &begun);
    }
    print_message("cells looked at: %lld, anew %lld\n", (long long)repaired, (long long)begun);
    assert_true(repaired > 0 && 20 * repaired < begun);
    /* Nothing is looked at twice for nothing. */
    const int64_t looks = search.looks;
    (void)dstar_find(&search, field_of(robot[0], robot[1]), REACH);
    assert_int_equal(search.looks, looks);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(costs_are_those_of_dijkstra),
        cmocka_unit_test(a_repair_looks_at_few_cells),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
