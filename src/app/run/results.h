/* Detections and objects, from the loop thread through a wait-free ring to files that
 * evaluation tools read. All memory is taken at open, whatever the length of the run.
 *
 * Detections are written as a COCO results file: one JSON array of {"image_id", "category_id",
 * "bbox": [x, y, w, h], "score"}. image_id is the number of the frame in its source, category_id
 * the class's number counted from 1 (for a network with COCO's 90 classes: COCO's own), bbox in
 * pixels of the raw image from the top left corner of its top left pixel.
 *
 * Objects are written as MOTChallenge text: one line
 * "frame,id,left,top,width,height,score,-1,-1,-1" per object that was seen in the image; frames and
 * pixels count from 1. */
#ifndef FOVEA_APP_RUN_RESULTS_H
#define FOVEA_APP_RUN_RESULTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/detect.h"
#include "fovea/status.h"
#include "fovea/objects.h"

struct fv_results;

/* NULL paths: nothing is written, `*results` is NULL, which every function takes.
 * FOVEA_ERROR_INPUT: a file cannot be made. Init-only. */
enum fovea_status fv_results_open(const char *detections_path, const char *objects_path,
                                  struct fv_results **results, struct fovea_error *error);

/* Bytes that open results take. */
size_t fv_results_bytes(void);

/* Hand over what an inference found, and the objects after it. When the ring is full they are
 * counted as lost. Loop thread, real-time safe. */
void fv_results_add(struct fv_results *results, const struct fovea_detections *detections,
                    const struct fovea_objects *objects);
/* Whether there is room for more; for a loop that may wait. Loop thread. */
bool fv_results_room(struct fv_results *results);

/* Write what has come. The thread that opened it; at least four times a second. */
void fv_results_drain(struct fv_results *results);

/* Drain, end the files and close them. FOVEA_ERROR_SYSTEM: one is not whole; `error` names it and
 * says why. */
enum fovea_status fv_results_close(struct fv_results *results, struct fovea_error *error);

#endif
