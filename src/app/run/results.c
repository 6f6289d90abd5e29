#include "app/run/results.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/aligned.h"
#include "base/ring.h"
#include "support/output.h"

enum { RING_BYTES = 1 << 20 }; /* a second of full lists at 30 Hz */

enum kind { DETECTIONS, OBJECTS, KINDS };

struct output {
    struct fv_output output;
    FILE *file; /* its stream; NULL: no file */
    const char *path;
    uint64_t written; /* rows */
};

struct fv_results {
    struct fv_ring ring;
    struct output outputs[KINDS];
    uint64_t lost; /* lists that found no room; the loop's */
    bool failed;
    uint8_t memory[RING_BYTES];
};

/* A list in the ring: this, then `count` rows. */
struct record {
    uint64_t sequence;
    uint32_t kind, count, bytes, reserved; /* bytes of the whole record, a multiple of 8 */
};

static const size_t row_bytes[KINDS] = {sizeof(struct fovea_detection),
                                        sizeof(struct fovea_object)};

size_t fv_results_bytes(void)
{
    return sizeof(struct fv_results);
}

static void close_files(struct fv_results *results)
{
    for (int kind = 0; kind < KINDS; kind++)
        fv_output_discard(&results->outputs[kind].output);
}

enum fovea_status fv_results_open(const char *detections_path, const char *objects_path,
                                  struct fv_results **results, struct fovea_error *error)
{
    const char *const paths[KINDS] = {detections_path, objects_path};
    *results = NULL;
    if (detections_path == NULL && objects_path == NULL) return FOVEA_OK;
    struct fv_results *opened = fv_aligned_zeroed(sizeof *opened);
    if (opened == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the results");
    fv_ring_init(&opened->ring, opened->memory, sizeof opened->memory);
    for (int kind = 0; kind < KINDS; kind++) {
        struct output *output = &opened->outputs[kind];
        output->path = paths[kind];
        output->output = FV_OUTPUT_CLOSED;
    }
    enum fovea_status status = FOVEA_OK;
    for (int kind = 0; kind < KINDS && status == FOVEA_OK; kind++) {
        struct output *output = &opened->outputs[kind];
        if (paths[kind] == NULL) continue;
        status = fv_output_open(&output->output, paths[kind], FV_OUTPUT_STREAM, error);
        if (status == FOVEA_OK && (output->file = fv_output_stream(&output->output)) == NULL)
            status =
                fovea_error_set(error, FOVEA_ERROR_MEMORY, "%.200s: out of memory", paths[kind]);
    }
    if (status != FOVEA_OK) {
        close_files(opened);
        free(opened);
        return status;
    }
    *results = opened;
    return FOVEA_OK;
}

/* ---- loop thread ----------------------------------------------------------------------------- */

static size_t record_bytes(enum kind kind, uint32_t count)
{
    return (sizeof(struct record) + count * row_bytes[kind] + 7) / 8 * 8;
}

bool fv_results_room(struct fv_results *results)
{
    const size_t most =
        record_bytes(DETECTIONS, FOVEA_DETECTIONS_MAX) + record_bytes(OBJECTS, FOVEA_OBJECTS_MAX);
    return results == NULL || fv_ring_room(&results->ring) >= most;
}

static void add(struct fv_results *results, enum kind kind, uint64_t sequence, const void *rows,
                uint32_t count)
{
    const struct record record = {sequence, kind, count, (uint32_t)record_bytes(kind, count), 0};
    if (results->outputs[kind].file == NULL || count == 0) return;
    uint8_t *room = fv_ring_reserve(&results->ring, record.bytes);
    if (room == NULL) {
        results->lost++;
        return;
    }
    memcpy(room, &record, sizeof record);
    memcpy(room + sizeof record, rows, count * row_bytes[kind]);
    fv_ring_commit(&results->ring, record.bytes);
}

void fv_results_add(struct fv_results *results, const struct fovea_detections *detections,
                    const struct fovea_objects *objects)
{
    if (results == NULL) return;
    add(results, DETECTIONS, detections->sequence, detections->list, detections->count);
    if (objects->updates > 0)
        add(results, OBJECTS, objects->sequence, objects->list, objects->count);
}

/* ---- the other side -------------------------------------------------------------------------- */

/* Pixels count from the corner of the first one in COCO's files, from 1 at its middle in
 * MOTChallenge's. */
static void write_detection(struct fv_results *results, uint64_t sequence, const void *row)
{
    struct fovea_detection found;
    struct output *output = &results->outputs[DETECTIONS];
    memcpy(&found, row, sizeof found);
    const int bytes =
        fprintf(output->file,
                "%s{\"image_id\": %" PRIu64
                ", \"category_id\": %d, \"bbox\": [%.3f, %.3f, %.3f, %.3f], \"score\": %.6f}",
                output->written == 0 ? "[\n" : ",\n", sequence, found.class_id + 1,
                (double)found.x_min_px + 0.5, (double)found.y_min_px + 0.5,
                (double)found.x_max_px - (double)found.x_min_px,
                (double)found.y_max_px - (double)found.y_min_px, (double)found.score);
    results->failed |= bytes < 0;
    output->written++;
}

static void write_object(struct fv_results *results, uint64_t sequence, const void *row)
{
    struct fovea_object object;
    struct output *output = &results->outputs[OBJECTS];
    memcpy(&object, row, sizeof object);
    if (object.state != FOVEA_OBJECT_CONFIRMED) return;
    const int bytes =
        fprintf(output->file, "%" PRIu64 ",%" PRIu64 ",%.2f,%.2f,%.2f,%.2f,%.4f,-1,-1,-1\n",
                sequence + 1, object.id, (double)object.x_min_px + 1, (double)object.y_min_px + 1,
                (double)object.x_max_px - (double)object.x_min_px,
                (double)object.y_max_px - (double)object.y_min_px, (double)object.score);
    results->failed |= bytes < 0;
    output->written++;
}

void fv_results_drain(struct fv_results *results)
{
    static void (*const write[KINDS])(struct fv_results *, uint64_t,
                                      const void *) = {write_detection, write_object};
    size_t bytes;
    const uint8_t *data;
    if (results == NULL) return;
    while ((data = fv_ring_peek(&results->ring, &bytes)) != NULL) {
        struct record record;
        for (size_t at = 0; at < bytes; at += record.bytes) {
            memcpy(&record, data + at, sizeof record);
            for (uint32_t i = 0; i < record.count; i++)
                write[record.kind](results, record.sequence,
                                   data + at + sizeof record + i * row_bytes[record.kind]);
        }
        fv_ring_release(&results->ring, bytes);
    }
}

enum fovea_status fv_results_close(struct fv_results *results, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    if (results == NULL) return FOVEA_OK;
    fv_results_drain(results);
    struct output *detections = &results->outputs[DETECTIONS];
    if (detections->file != NULL)
        results->failed |= fputs(detections->written == 0 ? "[]\n" : "\n]\n", detections->file) < 0;
    for (int kind = 0; kind < KINDS; kind++) {
        struct output *output = &results->outputs[kind];
        if (output->file == NULL) continue;
        if (fv_output_close(&output->output, error) != FOVEA_OK)
            status = FOVEA_ERROR_SYSTEM;
        else if (results->failed)
            status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: cannot be written",
                                     output->path);
    }
    if (status == FOVEA_OK && results->lost > 0)
        status = fovea_error_set(
            error, FOVEA_ERROR_SYSTEM,
            "%.200s: %" PRIu64 " lists are missing: they came faster than they could be written",
            detections->file != NULL ? detections->path : results->outputs[OBJECTS].path,
            results->lost);
    free(results);
    return status;
}
