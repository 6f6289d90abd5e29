/* What the writers of calibration files share: text in a buffer that is large enough for any of
 * them, with numbers that keep all their bits. Init-only. */
#ifndef FOVEA_SUPPORT_CALIBRATION_WRITER_H
#define FOVEA_SUPPORT_CALIBRATION_WRITER_H

#include "support/calibration.h"

struct fv_calibration_writer {
    char *text; /* FV_CALIBRATION_BYTES_MAX bytes */
    size_t used;
    bool json; /* strings and the record in JSON; YAML otherwise */
};

__attribute__((format(printf, 2, 3))) void fv_calibration_put(struct fv_calibration_writer *w,
                                                              const char *format, ...);

/* "1, 2, 3" with all bits of each number, and always with a point so that no reader takes it for an
 * integer. */
void fv_calibration_put_numbers(struct fv_calibration_writer *w, const double *values,
                                size_t count);

/* A YAML line of a key and a string in double quotes, in which everything may stand. */
void fv_calibration_put_text(struct fv_calibration_writer *w, const char *key, const char *text);

/* YAML: a mapping of rows, cols and data, and "key: [1.0, 2.0]". */
void fv_calibration_put_matrix(struct fv_calibration_writer *w, const char *key, bool opencv,
                               int rows, int cols, const double *values);
void fv_calibration_put_list(struct fv_calibration_writer *w, const char *key, const double *values,
                             size_t count);

/* Coefficients that the file lists: 4 for equidistant, 4, 5 or 8 for radial-tangential, as few as
 * say everything. */
size_t fv_calibration_coefficient_count(const struct fovea_camera *camera, size_t least);

/* Whether the rate is a whole number of frames per second, the only ones that ORB-SLAM3 reads. */
bool fv_calibration_whole_rate(const struct fv_calibration *calibration);

/* The mapping `calibration`, `indent` spaces in: the record and, `with_name`, the name; nothing
 * where neither is stated. In JSON it begins with a comma. */
void fv_calibration_put_record(struct fv_calibration_writer *w, int indent,
                               const struct fv_calibration *calibration, bool with_name);

void fv_calibration_write_orbslam3(struct fv_calibration_writer *w,
                                   const struct fv_calibration *calibration);
void fv_calibration_write_basalt(struct fv_calibration_writer *w,
                                 const struct fv_calibration *calibration);
void fv_calibration_write_photonvision(struct fv_calibration_writer *w,
                                       const struct fv_calibration *calibration);

#endif
