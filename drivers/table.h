/* The drivers built in: of the programs, not in the library. Init-only. */
#ifndef FOVEA_DRIVERS_TABLE_H
#define FOVEA_DRIVERS_TABLE_H

#include <stdbool.h>

#include "fovea/source.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How many frames of a source may be held at once. */
static inline uint32_t fv_source_frames_held(const struct fovea_source_selection *selection)
{
    const uint32_t most = FOVEA_SOURCE_FRAMES_HELD_MAX, usual = FOVEA_SOURCE_FRAMES_HELD,
                   wanted = selection->frames_held;
    return wanted == 0 ? usual : wanted < most ? wanted : most;
}

/* Ended by NULL. */
extern const struct fovea_source_ops *const fv_source_table[];

/* Whether opening the source of a URI would take a device from the program that uses it. False for
 * one that is not known. */
bool fv_source_takes_device(const char *uri);

/* As ops->control. FOVEA_ERROR_UNSUPPORTED, with a line, where the source has none. */
enum fovea_status fv_source_control(const struct fovea_source_ops *ops, struct fovea_source *source,
                                    enum fovea_source_control control, double value,
                                    struct fovea_error *error);

/* As ops->drive. FOVEA_ERROR_UNSUPPORTED, with a line, where the source has none. */
enum fovea_status fv_source_drive(const struct fovea_source_ops *ops, struct fovea_source *source,
                                  const struct fovea_velocity_command *command,
                                  struct fovea_error *error);

/* As ops->failure; FOVEA_AGAIN where the source has none. */
enum fovea_status fv_source_failure(const struct fovea_source_ops *ops,
                                    const struct fovea_source *source, struct fovea_error *error);

/* The line about a source that gave this negative status, by the name that the user knows it by.
 * Returns the status. */
enum fovea_status fv_source_failed(const struct fovea_source_ops *ops,
                                   const struct fovea_source *source, const char *uri,
                                   enum fovea_status status, struct fovea_error *error);

/* The driver for a URI "name:address" and where its address starts; an error that lists the known
 * names otherwise. */
enum fovea_status fv_source_find(const char *uri, const struct fovea_source_ops **ops,
                                 const char **address, struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif
