/* What the readers of calibration files share: values that several formats have, checked the same
 * way everywhere. Each refuses in one line with file, line, key, found and expected. */
#ifndef FOVEA_SUPPORT_CALIBRATION_READER_H
#define FOVEA_SUPPORT_CALIBRATION_READER_H

#include "support/calibration.h"
#include "support/yaml_tree.h"

struct fv_calibration_reader {
    const struct fv_yaml_tree *tree;
    struct fv_calibration *calibration; /* what was found so far */
    struct fovea_error *error;
    bool *absent; /* set: the file has other cameras, but not the one that was asked for */
};

/* Refuse what Fovea does not have. Returns FOVEA_ERROR_UNSUPPORTED. */
enum fovea_status fv_calibration_unsupported(const struct fv_calibration_reader *r,
                                             const struct fv_yaml_node *where,
                                             const char *expected);

/* Focal lengths and centre from `values` at the indices of fx fy cx cy; errors name the leaf of
 * `data`. */
enum fovea_status fv_calibration_set_pinhole(const struct fv_calibration_reader *r,
                                             const struct fv_yaml_node *data, const double *values,
                                             const size_t index[4]);

/* [fx s cx; 0 fy cy; 0 0 1] with no skew. */
enum fovea_status fv_calibration_read_matrix(const struct fv_calibration_reader *r,
                                             const struct fv_yaml_node *matrix);

/* Coefficients in the order of the lens model, which is known before. */
enum fovea_status fv_calibration_read_distortion(const struct fv_calibration_reader *r,
                                                 const struct fv_yaml_node *list);

/* A rigid 4x4 or 3x4 transform, and its inverse. */
enum fovea_status fv_calibration_read_transform(const struct fv_calibration_reader *r,
                                                const struct fv_yaml_node *list, double T[12]);
void fv_calibration_invert(const double T[12], double inverse[12]);
void fv_calibration_multiply(const double a[12], const double b[12], double product[12]);

enum fovea_status fv_calibration_read_size(const struct fv_calibration_reader *r,
                                           const struct fv_yaml_node *width_node,
                                           const struct fv_yaml_node *height_node);

/* The mapping `calibration` below `parent`, where it is there and of fovea-calibrate. */
enum fovea_status fv_calibration_read_record(const struct fv_calibration_reader *r,
                                             const struct fv_yaml_node *parent);

/* Formats of single programs. `*is` says whether the file is of that format; `which` as in
 * fv_calibration_read. */
enum fovea_status fv_calibration_read_orbslam3(const struct fv_calibration_reader *r,
                                               const char *which, bool *is);
enum fovea_status fv_calibration_read_basalt(const struct fv_calibration_reader *r,
                                             const char *which, bool *is);
enum fovea_status fv_calibration_read_photonvision(const struct fv_calibration_reader *r, bool *is);

#endif
