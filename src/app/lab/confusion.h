/* Labelled pictures against a network's masks: which of the numbers in label pictures is which
 * class of the network, the confusion matrix, and what follows from it. */
#ifndef FOVEA_APP_LAB_CONFUSION_H
#define FOVEA_APP_LAB_CONFUSION_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/segmentation.h"
#include "fovea/status.h"
#include "nn/model.h"

enum { FV_CONFUSION_CLASSES_MAX = FOVEA_SEGMENTATION_CLASSES_MAX, FV_CONFUSION_NAME_BYTES = 64 };

/* Judged are the network's classes that the map names. Of the last row and column, "other", are the
 * labels that the map calls so, and what the network takes for a class that is not judged or for
 * none. Where the network has a class labelled "other" the map means that one, and the last row and
 * column are called "none of them". Pixels whose label the map does not name, or ignores, do not
 * count. */
struct fv_confusion {
    int32_t count; /* judged classes */
    char names[FV_CONFUSION_CLASSES_MAX + 1][FV_CONFUSION_NAME_BYTES];
    int32_t row_of[256];       /* of a label; -1: ignored */
    uint8_t column_of[256];    /* of a class of the network */
    uint64_t pictures, pixels; /* judged */
    uint64_t ignored;          /* pixels */
    uint64_t cells[FV_CONFUSION_CLASSES_MAX + 1][FV_CONFUSION_CLASSES_MAX + 1]; /* [truth][network]
                                                                                 */
};

/* Read the map: lines "LABEL CLASS", LABEL a number from 0 to 255, CLASS a label or number of the
 * network's, `other` or `ignore`; # begins a comment, and a byte order mark at the start is none.
 * FOVEA_ERROR_INPUT: `error` names file and line. */
enum fovea_status fv_confusion_open(struct fv_confusion *confusion, const char *path,
                                    const struct fv_model *model, struct fovea_error *error);

/* Count a picture's pixels. FOVEA_ERROR_SYSTEM: out of memory. */
enum fovea_status fv_confusion_add(struct fv_confusion *confusion, const uint8_t *labels,
                                   const struct fovea_segmentation *segmentation);

/* To stdout: a table, or a line of JSON. */
void fv_confusion_print(const struct fv_confusion *confusion, bool json);

#endif
