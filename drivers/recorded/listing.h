/* Data sets whose frames are PNG, JPEG or BMP files: the list of them, and the player's way to
 * fetch one. */
#ifndef FOVEA_RECORDED_LISTING_H
#define FOVEA_RECORDED_LISTING_H

#include "fovea/source.h"
#include "poses.h"
#include "samples.h"

enum { FV_LISTING_FRAMES_MAX = 1 << 22, FV_LISTING_READS_MAX = 8, FV_PATH_BYTES = 4096 };

struct fv_listing; /* owns the list, the poses and the reader's buffer */

/* An empty list of files below `folder` (joined with '/'; "" for none). NULL: out of memory. */
struct fv_listing *fv_listing_new(const char *folder);
void fv_listing_free(struct fv_listing *listing);

enum fovea_status fv_listing_add(struct fv_listing *listing, int64_t stamp_ns, const char *name,
                                 struct fovea_error *error);
/* A list of frames as a text file: a stamp and the file's name in each line. `stamp_of` reads a
 * stamp, `expected` says which kind. Errors name the line. */
enum fovea_status fv_listing_read(struct fv_listing *listing, const char *path,
                                  const char *separators,
                                  bool (*stamp_of)(const char *text, int64_t *stamp_ns),
                                  const char *expected, struct fovea_error *error);
size_t fv_listing_count(const struct fv_listing *listing);
/* Note a file or folder that is read beside the frames, for fovea_source_ops.reads; at most
 * FV_LISTING_READS_MAX of them. */
void fv_listing_reads(struct fv_listing *listing, const char *path);

/* Poses become the listing's own. */
void fv_listing_set_poses(struct fv_listing *listing, const struct fv_poses *poses);

/* The frames of the rig's next camera, up to FOVEA_CAMERAS_MAX: of each frame the one of `other`
 * with the same stamp; where there is none, or it cannot be read, the image is absent. Its images
 * may have another size. Refused when no frame has one. `other` becomes the listing's own, also on
 * error. */
enum fovea_status fv_listing_pair(struct fv_listing *listing, struct fv_listing *other,
                                  struct fovea_error *error);
/* Samples become the listing's own. */
void fv_listing_set_samples(struct fv_listing *listing, const struct fv_samples *samples);

/* Make a source of a finished list. The size of a camera's images is the one that most of five of
 * them, spread over its list, state. `info` holds what the data set says of itself: the rig
 * (cameras of 0 x 0 get the size of their images), the cameras' origin, rate_hz (0: taken from the
 * stamps). `list_file` names the list in errors.
 * The listing is owned by the source, and freed on error. */
enum fovea_status fv_listing_open(struct fv_listing *listing, const char *list_file,
                                  const struct fovea_source_selection *selection,
                                  struct fovea_source_info *info, struct fovea_source **source,
                                  struct fovea_error *error);

/* "a/b", or an error when it does not fit FV_PATH_BYTES. */
enum fovea_status fv_path_join(char path[FV_PATH_BYTES], const char *folder, const char *name,
                               struct fovea_error *error);
bool fv_path_exists(const char *path);

/* A data set's own calibration file into `info`, where it is there; T_body_cam too when it states
 * one. An unreadable file is ignored where the selection says that a camera is given. */
enum fovea_status fv_info_set_calibration(struct fovea_source_info *info, const char *path,
                                          const struct fovea_source_selection *selection,
                                          double T_body_cam[12], bool *has_T_body_cam,
                                          struct fovea_error *error);

#endif
