/* Features and descriptors of one picture, for the commands that look at pictures: fovea/extract.h
 * on memory of its own. The heap is used. */
#ifndef FOVEA_APP_LAB_EXTRACT_H
#define FOVEA_APP_LAB_EXTRACT_H

#include "app/lab/member_options.h"
#include "features/mask.h"
#include "fovea/extract.h"

struct fv_extract {
    struct fovea_image image; /* data from malloc */
    struct fovea_extract_config config;
    struct fovea_extracted found; /* in `memory` */
    void *memory;
};

/* Where not to look: a picture (NULL: none) and boxes. */
struct fv_extract_ignore {
    const char *mask_path;
    const struct fv_mask_box *boxes;
    uint32_t box_count;
};

/* Read a picture and find its features; `ignore` may be NULL. Errors are one line. Freed with
 * fv_extract_free, also after errors. */
enum fovea_status fv_extract(const char *path, const struct fv_extract_ignore *ignore,
                             const struct fovea_extract_config *config, struct fv_extract *extract,
                             struct fovea_error *error);
/* The same for an image in memory, which is copied. */
enum fovea_status fv_extract_image(const struct fovea_image *image,
                                   const struct fv_extract_ignore *ignore,
                                   const struct fovea_extract_config *config,
                                   struct fv_extract *extract, struct fovea_error *error);
void fv_extract_free(struct fv_extract *extract);

/* What the command line says about features. */
struct fv_extract_request {
    const char *method, *descriptor;
    uint64_t max;
    struct fv_member_options members;
};

/* Append the options about features to those of a command, which {0} ends; `max` is the default of
 * the most features. */
void fv_extract_offer(struct fv_extract_request *request, uint64_t max, struct fv_option *options);

/* The configuration that is asked for, checked. Errors name the option. */
enum fovea_status fv_extract_config(const struct fv_extract_request *request,
                                    struct fovea_extract_config *config, struct fovea_error *error);

#endif
