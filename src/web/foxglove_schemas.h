/* The schemas of Foxglove (docs.foxglove.dev/docs/visualization/message-schemas) that our messages
 * are shown by: names, numbers and types of their fields as the published ones have them, which a
 * test compares. Their text is not here: a client is sent a FileDescriptorSet made of this table.
 */
#ifndef FOVEA_WEB_FOXGLOVE_SCHEMAS_H
#define FOVEA_WEB_FOXGLOVE_SCHEMAS_H

#include <stddef.h>
#include <stdint.h>

enum fv_foxglove_schema {
    FV_FOXGLOVE_COMPRESSED_IMAGE,
    FV_FOXGLOVE_IMAGE_ANNOTATIONS,
    FV_FOXGLOVE_POSE_IN_FRAME,
    FV_FOXGLOVE_FRAME_TRANSFORMS,
    FV_FOXGLOVE_POINT_CLOUD,
    FV_FOXGLOVE_GRID,
    FV_FOXGLOVE_LOG,
    FV_FOXGLOVE_SCHEMAS /* their number */
};

/* "foxglove.Log" */
const char *fv_foxglove_schema_name(enum fv_foxglove_schema schema);

/* Its FileDescriptorSet, of at most `capacity` bytes. Returns its bytes; 0: it does not fit. */
size_t fv_foxglove_schema_describe(enum fv_foxglove_schema schema, uint8_t *to, size_t capacity);

#endif
