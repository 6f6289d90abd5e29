/* Lists of a network's classes in the configuration, by label or number: "person car", "person:1.7
 * 0:0.22". Among the movable classes `auto` stands for those of the network's that are known to
 * move (people, animals, vehicles, balls ...). Init-only. */
#ifndef FOVEA_APP_CONFIG_CLASSES_H
#define FOVEA_APP_CONFIG_CLASSES_H

#include "app/config/settings.h"
#include "nn/model.h"

/* Fill settings->runtime.objects's heights and movable classes from settings->heights and
 * settings->movable. FOVEA_ERROR_INPUT: `error` begins with the key and names the entry. */
enum fovea_status fv_classes_resolve(struct fv_settings *settings, const struct fv_model *model,
                                     struct fovea_error *error);

/* Fill settings->runtime.grid_job's labels from settings->grid_floor, grid_movable, grid_beyond and
 * grid_ignored for the first of the networks that labels pixels; nothing where the grid is off.
 * `model2` may be NULL. FOVEA_ERROR_INPUT: `error` begins with the key. */
enum fovea_status fv_classes_resolve_grid(struct fv_settings *settings,
                                          const struct fv_model *model,
                                          const struct fv_model *model2, struct fovea_error *error);

/* The names of the classes that are floor to the grid, their numbers where they have none, with
 * commas between, cut where `text` is full; "" where the grid is off. After fv_classes_resolve_grid
 * with the same networks. */
void fv_classes_floor(const struct fv_settings *settings, const struct fv_model *model,
                      const struct fv_model *model2, char *text, size_t capacity);

/* What is wrong with the lists whatever the network is: the form of an entry, a number that no
 * class has. FOVEA_ERROR_INPUT as above. */
enum fovea_status fv_classes_check(const struct fv_settings *settings, struct fovea_error *error);

#endif
