#include "app/results.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/ring.h"

enum { RING_BYTES = 1 << 20 }; /* over a second of full lists at 100 Hz */

struct fv_results {
    struct fv_ring ring;
    FILE *file;
    const char *path;
    uint64_t lost, written; /* lists that found no room, the loop's; detections in the file */
    bool failed;
    uint8_t memory[RING_BYTES];
};

/* A list in the ring: this, then `count` detections. */
struct look {
    uint64_t sequence;
    uint32_t count, bytes; /* of the whole record, a multiple of 8 */
};

size_t fv_results_bytes(void)
{
    return sizeof(struct fv_results);
}

enum fovea_status fv_results_open(const char *detections_path, struct fv_results **results, struct fovea_error *error)
{
    *results = NULL;
    if (detections_path == NULL) return FOVEA_OK;
    struct fv_results *opened = aligned_alloc(64, (sizeof *opened + 63) / 64 * 64);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the results");
    memset(opened, 0, sizeof *opened);
    fv_ring_init(&opened->ring, opened->memory, sizeof opened->memory);
    opened->path = detections_path;
    opened->file = fopen(detections_path, "we");
    if (opened->file == NULL) {
        fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: cannot be written: %s", detections_path, strerror(errno));
        free(opened);
        return FOVEA_ERROR_INPUT;
    }
    *results = opened;
    return FOVEA_OK;
}

/* ---- loop thread ------------------------------------------------------------------------------------------- */

static size_t record_bytes(uint32_t count)
{
    return (sizeof(struct look) + count * sizeof(struct fovea_detection) + 7) / 8 * 8;
}

bool fv_results_room(struct fv_results *results)
{
    return results == NULL || fv_ring_room(&results->ring) >= record_bytes(FOVEA_DETECTIONS_MAX);
}

void fv_results_detections(struct fv_results *results, const struct fovea_detections *detections)
{
    if (results == NULL) return;
    const struct look look = {detections->sequence, detections->count, (uint32_t)record_bytes(detections->count)};
    uint8_t *room = fv_ring_reserve(&results->ring, look.bytes);
    if (room == NULL) {
        results->lost++;
        return;
    }
    memcpy(room, &look, sizeof look);
    memcpy(room + sizeof look, detections->list, look.count * sizeof *detections->list);
    fv_ring_commit(&results->ring, look.bytes);
}

/* ---- the other side ---------------------------------------------------------------------------------------- */

static void write_one(struct fv_results *results, uint64_t sequence, const struct fovea_detection *found)
{
    const double x = (double)found->x_min_px + 0.5, y = (double)found->y_min_px + 0.5;
    const int bytes = fprintf(results->file, "%s{\"image_id\": %" PRIu64 ", \"category_id\": %d, \"bbox\": [%.3f, %.3f, %.3f, %.3f], \"score\": %.6f}",
                              results->written == 0 ? "[\n" : ",\n", sequence, found->class_id + 1, x, y,
                              (double)found->x_max_px - (double)found->x_min_px, (double)found->y_max_px - (double)found->y_min_px,
                              (double)found->score);
    results->failed |= bytes < 0;
    results->written++;
}

void fv_results_drain(struct fv_results *results)
{
    size_t bytes;
    const uint8_t *data;
    if (results == NULL) return;
    while ((data = fv_ring_peek(&results->ring, &bytes)) != NULL) {
        for (size_t at = 0; at < bytes;) {
            struct look look;
            memcpy(&look, data + at, sizeof look);
            for (uint32_t i = 0; i < look.count; i++) {
                struct fovea_detection found;
                memcpy(&found, data + at + sizeof look + i * sizeof found, sizeof found);
                write_one(results, look.sequence, &found);
            }
            at += look.bytes;
        }
        fv_ring_release(&results->ring, bytes);
    }
}

enum fovea_status fv_results_close(struct fv_results *results, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    if (results == NULL) return FOVEA_OK;
    fv_results_drain(results);
    bool failed = fputs(results->written == 0 ? "[]\n" : "\n]\n", results->file) < 0 || results->failed || ferror(results->file) != 0;
    failed = fclose(results->file) != 0 || failed;
    if (failed)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: cannot be written", results->path);
    else if (results->lost > 0)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: found no time to write the detections of %" PRIu64 " frames",
                                 results->path, results->lost);
    free(results);
    return status;
}
