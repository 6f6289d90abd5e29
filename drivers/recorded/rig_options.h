/* Options of data sets that hold more than one camera's images: "DIR?cameras=2&imu=1". Init-only.
 */
#ifndef FOVEA_RECORDED_RIG_OPTIONS_H
#define FOVEA_RECORDED_RIG_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/status.h"
#include "listing.h"

struct fv_rig_options {
    int32_t cameras; /* 1 or 2; default 1 */
    bool imu;        /* default false */
};

/* Part an address into the folder and the options behind its last '?'; an address that exists as it
 * stands is a folder. `imu_known`: the scheme has the option `imu`. */
enum fovea_status fv_rig_options(const char *scheme, const char *address, bool imu_known,
                                 char folder[FV_PATH_BYTES], struct fv_rig_options *options,
                                 struct fovea_error *error);

#endif
