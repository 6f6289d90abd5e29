/* Checks of struct fovea_config; defaults are fovea_config_default in fovea/fovea.h. */
#ifndef FOVEA_RUNTIME_CONFIG_H
#define FOVEA_RUNTIME_CONFIG_H

#include "fovea/fovea.h"

/* Every member against its documented range; `error` names the member, what was found and what was
 * expected. The camera must have been prepared. Init-only. FOVEA_OK or FOVEA_ERROR_ARGUMENT. */
enum fovea_status fv_config_check(const struct fovea_config *config, struct fovea_error *error);

/* Whether any class is said to move on its own. */
bool fv_config_movable(const struct fovea_config *config);

#endif
