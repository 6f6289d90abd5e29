#include "rig_options.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "support/uri_options.h"

enum fovea_status fv_rig_options(const char *scheme, const char *address, bool imu_known,
                                 char folder[FV_PATH_BYTES], struct fv_rig_options *options,
                                 struct fovea_error *error)
{
    static const struct fv_uri_option rows[] = {
        {"cameras", FV_URI_I32, offsetof(struct fv_rig_options, cameras), 1, 2, "cameras", NULL},
        {"imu", FV_URI_FLAG, offsetof(struct fv_rig_options, imu), 0, 1, "0 or 1", NULL}};
    const struct fv_uri_table table = {scheme, rows, imu_known ? 2 : 1, NULL, NULL, NULL};
    const char *mark = strrchr(address, '?');
    uint64_t given;
    *options = (struct fv_rig_options){.cameras = 1};
    if (mark == NULL || fv_path_exists(address)) return fv_path_join(folder, "", address, error);
    if (mark - address >= FV_PATH_BYTES)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found a path of more than %d bytes, expected less", scheme,
                               FV_PATH_BYTES - 1);
    snprintf(folder, FV_PATH_BYTES, "%.*s", (int)(mark - address), address);
    return fv_uri_options_parse(&table, mark + 1, options, &given, error);
}
