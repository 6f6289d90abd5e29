#include "web/store.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/clock.h"

static struct fv_web_row *row_find(struct fv_web_store *store, const char *channel, int32_t piece)
{
    for (uint32_t i = 0; i < store->row_count; i++)
        if (store->rows[i].piece == piece && strcmp(store->rows[i].channel, channel) == 0)
            return &store->rows[i];
    if (store->row_count == FV_WEB_ROWS_MAX) return NULL;
    struct fv_web_row *row = &store->rows[store->row_count++];
    snprintf(row->channel, sizeof row->channel, "%s", channel);
    row->piece = piece;
    return row;
}

void fv_web_store_message(struct fv_web_store *store, const struct fv_web_kept *kept)
{
    struct fv_web_row *row = row_find(store, kept->channel, kept->piece);
    if (row == NULL) return;
    if (kept->bytes > row->capacity) {
        uint8_t *more = realloc(row->data, kept->bytes);
        if (more == NULL) return;
        row->data = more;
        row->capacity = kept->bytes;
    }
    memcpy(row->data, kept->data, kept->bytes);
    row->bytes = kept->bytes;
    row->pause_ns = kept->pause_ns;
    row->operators = kept->operators;
    row->waits = true;
}

bool fv_web_store_tick(struct fv_web_store *store, int64_t now_ns)
{
    bool any = false;
    for (uint32_t i = 0; i < store->row_count; i++) {
        struct fv_web_row *row = &store->rows[i];
        if (!row->waits || now_ns < row->due_ns) continue;
        row->version++;
        row->waits = false;
        row->due_ns = now_ns + row->pause_ns;
        any = true;
    }
    return any;
}

void fv_web_store_path_begin(struct fv_web_store *store)
{
    store->path_epoch++;
    store->path_count = 0;
}

void fv_web_store_path_add(struct fv_web_store *store, const double position[3])
{
    struct fv_web_place *place = &store->path[store->path_count++ % FV_WEB_PATH_MAX];
    for (int i = 0; i < 3; i++)
        place->position[i] = (float)position[i];
}

void fv_web_store_path_change(struct fv_web_store *store, double scale, const double position[3],
                              const double q[4])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double R[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
        {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
        {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
    };
    for (uint64_t n = 0; n < store->path_count && n < FV_WEB_PATH_MAX; n++) {
        float *at = store->path[n].position;
        const double p[3] = {(double)at[0], (double)at[1], (double)at[2]};
        for (int i = 0; i < 3; i++)
            at[i] =
                (float)(scale * (R[i][0] * p[0] + R[i][1] * p[1] + R[i][2] * p[2]) + position[i]);
    }
    store->path_epoch++;
}

void fv_web_store_log(struct fv_web_store *store, int64_t utime, const char *format, ...)
{
    va_list arguments;
    const uint64_t at = store->log_count++ % FV_WEB_LOG_MAX;
    va_start(arguments, format);
    store->log[at].utime = utime;
    vsnprintf(store->log[at].text, sizeof store->log[at].text, format, arguments);
    va_end(arguments);
}

static void forget(struct fv_web_store *store)
{
    for (uint32_t i = 0; i < store->row_count; i++)
        free(store->rows[i].data);
    memset(store->rows, 0, sizeof store->rows);
    store->row_count = 0;
    store->log_count = 0;
    fv_web_store_path_begin(store);
    for (uint32_t camera = 0; camera < FOVEA_CAMERAS_MAX; camera++) {
        struct fv_web_picture *picture = fv_web_store_picture(store, camera);
        free((void *)(uintptr_t)picture->image.data);
        picture->image.data = NULL;
    }
    store->cameras = 0;
}

void fv_web_store_begin(struct fv_web_store *store, const char *prefix)
{
    forget(store);
    snprintf(store->prefix, sizeof store->prefix, "%s", prefix);
    store->running = true;
    store->run++;
    store->news++;
}

void fv_web_store_end(struct fv_web_store *store)
{
    store->running = false;
    store->news++;
}

struct fv_web_picture *fv_web_store_picture(struct fv_web_store *store, uint32_t camera)
{
    return camera == 0 || camera >= FOVEA_CAMERAS_MAX ? &store->picture
                                                      : &store->others[camera - 1];
}

void fv_web_picture_take(struct fv_web_picture *picture, const struct fovea_image *image,
                         int64_t stamp_ns, int64_t sequence, int64_t age_ns)
{
    free((void *)(uintptr_t)picture->image.data);
    picture->image = *image;
    picture->number = picture->number < UINT32_MAX ? picture->number + 1 : 1;
    picture->stamp_ns = stamp_ns;
    picture->sequence = sequence;
    picture->age_ns = age_ns;
    picture->taken_ns = fv_clock_ns(CLOCK_MONOTONIC);
    picture->point_count = 0;
}

const uint8_t *fv_web_picture_jpeg(struct fv_web_picture *picture, int picture_class, size_t *bytes)
{
    if (picture->image.data == NULL) return NULL;
    if (picture->jpeg[picture_class].number != picture->number) {
        picture->jpeg[picture_class].number = picture->number;
        picture->jpeg[picture_class].bytes =
            fv_web_jpeg_make(&picture->image, picture_class, &picture->jpeg[picture_class].data,
                             &picture->jpeg[picture_class].capacity);
        picture->made++;
    }
    *bytes = picture->jpeg[picture_class].bytes;
    return *bytes > 0 ? picture->jpeg[picture_class].data : NULL;
}

void fv_web_store_free(struct fv_web_store *store)
{
    forget(store);
    for (uint32_t camera = 0; camera < FOVEA_CAMERAS_MAX; camera++)
        for (int i = 0; i < FV_WEB_JPEGS; i++)
            free(fv_web_store_picture(store, camera)->jpeg[i].data);
}
