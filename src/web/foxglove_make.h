/* One message of ours as one of Foxglove's: what each topic of foxglove_views.h is made of, field
 * by field as tools/foxglove/views.py has it. Messages were checked as their type. What does not
 * fit sets `to->full`. */
#ifndef FOVEA_WEB_FOXGLOVE_MAKE_H
#define FOVEA_WEB_FOXGLOVE_MAKE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "web/foxglove_views.h"
#include "web/protobuf.h"

#include "fovea_pose_t.h"

typedef void fv_foxglove_make(const struct fv_foxglove_views *views, const uint8_t *data,
                              size_t bytes, struct fv_protobuf *to);

/* A stamp in UTC where its offset is known; 0 of one before 1970. */
int64_t fv_foxglove_make_time(const fovea_stamp_t *stamp);

/* Whether a pose can be shown: it is in a map, and all its numbers are known. */
bool fv_foxglove_make_known(const fovea_pose_t *pose);

fv_foxglove_make fv_foxglove_make_pose, fv_foxglove_make_transforms, fv_foxglove_make_features,
    fv_foxglove_make_detections, fv_foxglove_make_objects, fv_foxglove_make_keypoints,
    fv_foxglove_make_preview;
/* Of what the views hold: landmarks of all messages so far, and the rows of the grid. */
fv_foxglove_make fv_foxglove_make_map, fv_foxglove_make_grid;

void fv_foxglove_make_image(int64_t time_ns, int32_t camera, const uint8_t *jpeg, size_t bytes,
                            struct fv_protobuf *to);
/* A line: `who` says `text`; a warning if `bad`. */
void fv_foxglove_make_log(int64_t time_ns, bool bad, const char *who, const char *text,
                          struct fv_protobuf *to);

#endif
