/* The grid of free space, its heights and the scan of a run, put together from its messages, each
 * of which is checked against those before it. */
#ifndef FOVEA_TESTS_SENT_GRID_H
#define FOVEA_TESTS_SENT_GRID_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "fovea/fovea.h"
#include "fovea/grid.h"
#include "fovea_grid_t.h"
#include "fovea_height_grid_t.h"
#include "fovea_scan_t.h"

enum { SENT_SIDE = 256, SENT_RAYS = 90 };

/* What the messages said last, and how often. */
struct sent_grid {
    int8_t cells[SENT_SIDE * SENT_SIDE];
    float ranges[SENT_RAYS];
    int16_t heights_mm[SENT_SIDE * SENT_SIDE];
    uint8_t height_counts[SENT_SIDE * SENT_SIDE];
    int64_t grid_stamp_ns, scan_stamp_ns;
    double origin[3];
    int32_t reset_counter, map_id, grid_row, height_row; /* the rows that come next */
    int grids, height_grids, scans, known;
    int empty;    /* grids without a known cell after one with some */
    int compared; /* grids that were compared with that beside, as they came */
};

static int sent_grid_known(const int8_t *cells)
{
    int known = 0;
    for (int i = 0; i < SENT_SIDE * SENT_SIDE; i++)
        known += cells[i] != FOVEA_GRID_UNKNOWN;
    return known;
}

/* Rows come in order; what was under way may be begun anew. Returns the next. */
static int32_t row_after(int32_t expected, int32_t first, int32_t count)
{
    assert_true(count > 0 && first + count <= SENT_SIDE && (first == expected || first == 0));
    return (first + count) % SENT_SIDE;
}

/* The grid is level in `odom`. */
static void assert_level(const double orientation[4])
{
    assert_true(orientation[0] == 1 && orientation[1] == 0 && orientation[2] == 0 &&
                orientation[3] == 0);
}

static void take_grid(const struct fovea_message *message, struct sent_grid *run)
{
    fovea_grid_t m;
    assert_true(fovea_grid_t_decode(message->data, 0, (int)message->bytes, &m) > 0);
    assert_true(m.width == SENT_SIDE && m.height == SENT_SIDE && m.resolution_m == 0.05);
    assert_string_equal(m.frame, "odom");
    assert_level(m.origin_orientation);
    run->reset_counter = m.reset_counter;
    run->map_id = m.map_id;
    run->grid_row = row_after(run->grid_row, m.first_row, m.row_count);
    assert_true(m.cell_count == m.row_count * SENT_SIDE && m.cell_count <= FOVEA_GRID_T_CELLS_MAX);
    memcpy(run->cells + m.first_row * SENT_SIDE, m.cells, (size_t)m.cell_count);
    memcpy(run->origin, m.origin_position, sizeof run->origin);
    if (m.first_row + m.row_count == SENT_SIDE) {
        run->grids++;
        run->empty += run->grids > 1 && sent_grid_known(run->cells) == 0;
    }
    run->grid_stamp_ns = m.stamp.time_ns;
    fovea_grid_t_decode_cleanup(&m);
}

static void take_heights(const struct fovea_message *message, struct sent_grid *run)
{
    fovea_height_grid_t m;
    assert_true(fovea_height_grid_t_decode(message->data, 0, (int)message->bytes, &m) > 0);
    assert_true(m.width == SENT_SIDE && m.height == SENT_SIDE && m.resolution_m == 0.05);
    assert_true(m.cell_count == m.row_count * SENT_SIDE &&
                m.cell_count <= FOVEA_HEIGHT_GRID_T_CELLS_MAX);
    assert_string_equal(m.frame, "odom");
    assert_level(m.origin_orientation);
    assert_true(m.reset_counter == run->reset_counter && m.map_id == run->map_id);
    assert_true(m.stamp.time_ns == run->grid_stamp_ns && m.stamp.time_ns == run->scan_stamp_ns);
    run->height_row = row_after(run->height_row, m.first_row, m.row_count);
    assert_memory_equal(m.origin_position, run->origin, sizeof run->origin);
    const size_t from = (size_t)m.first_row * SENT_SIDE, count = (size_t)m.cell_count;
    memcpy(run->heights_mm + from, m.height_mm, count * sizeof m.height_mm[0]);
    memcpy(run->height_counts + from, m.point_count, count);
    run->height_grids += m.first_row + m.row_count == SENT_SIDE;
    fovea_height_grid_t_decode_cleanup(&m);
}

static void take_scan(const struct fovea_message *message, struct sent_grid *run)
{
    fovea_scan_t m;
    assert_true(fovea_scan_t_decode(message->data, 0, (int)message->bytes, &m) > 0);
    assert_true(m.count == SENT_RAYS && m.angle_first == 0.0f && m.range_max_m == 6.0f);
    assert_true(m.angle_step > 0.0698f && m.angle_step < 0.0699f); /* 4 degrees */
    memcpy(run->ranges, m.range_m, sizeof run->ranges);
    run->scans++;
    run->scan_stamp_ns = m.stamp.time_ns;
    fovea_scan_t_decode_cleanup(&m);
}

static void sent_grid_take(const struct fovea_outputs *outputs, struct sent_grid *run)
{
    for (uint32_t i = 0; i < outputs->message_count; i++) {
        if (strcmp(outputs->messages[i].channel, "FOVEA_GRID") == 0)
            take_grid(&outputs->messages[i], run);
        if (strcmp(outputs->messages[i].channel, "FOVEA_GRID_HEIGHTS") == 0)
            take_heights(&outputs->messages[i], run);
        if (strcmp(outputs->messages[i].channel, "FOVEA_SCAN") == 0)
            take_scan(&outputs->messages[i], run);
    }
}

#endif
