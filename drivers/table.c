/* The drivers built in. A new driver adds its table here;
 * tests/unit/drivers/test_source_conformance.c then runs against it. */
#include "table.h"

#include <stdio.h>
#include <string.h>

#include "support/text.h"
#include "fault/fault.h"
#include "live/live.h"
#include "pair.h"
#include "recorded/player.h"
#include "sequence.h"
#include "sim/sim.h"

const struct fovea_source_ops *const fv_source_table[] = {
    &fv_source_sim,
    &fv_source_euroc,
    &fv_source_tum,
    &fv_source_kitti,
    &fv_source_images,
    &fv_source_lcmlog,
    &fv_source_video,
    &fv_source_sequence,
    &fv_source_fault,
    &fv_source_pair,
    &fv_source_v4l2,
    &fv_source_libcamera,
    NULL,
};

enum { NAMES_MAX = 32 };

static enum fovea_status unknown_name(const char *uri, size_t length, struct fovea_error *error)
{
    const char *names[NAMES_MAX];
    char list[256] = "", word[64], quoted[FV_TEXT_QUOTED_BYTES];
    size_t count = 0;
    for (; fv_source_table[count] != NULL && count < NAMES_MAX; count++) {
        names[count] = fv_source_table[count]->name;
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s:", count > 0 ? " " : "", names[count]);
    }
    snprintf(word, sizeof word, "%.*s", (int)(length < sizeof word ? length : sizeof word - 1),
             uri);
    const char *nearest = fv_text_nearest(word, names, count);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "source: found %s, expected one of %s%s%s%s",
                           fv_text_quote(uri, quoted, sizeof quoted), list,
                           nearest != NULL ? " (did you mean " : "", nearest != NULL ? nearest : "",
                           nearest != NULL ? ":?)" : "");
}

static const struct fovea_source_ops *find(const char *uri, const char **address)
{
    const char *colon = strchr(uri, ':');
    const size_t length = colon != NULL ? (size_t)(colon - uri) : strlen(uri);
    for (size_t i = 0; colon != NULL && fv_source_table[i] != NULL; i++) {
        const char *name = fv_source_table[i]->name;
        if (strlen(name) != length || memcmp(name, uri, length) != 0) continue;
        *address = colon + 1;
        return fv_source_table[i];
    }
    return NULL;
}

bool fv_source_takes_device(const char *uri)
{
    const char *address;
    const struct fovea_source_ops *ops = find(uri, &address);
    return ops != NULL && ops->takes_device != NULL && ops->takes_device(address);
}

enum fovea_status fv_source_find(const char *uri, const struct fovea_source_ops **ops,
                                 const char **address, struct fovea_error *error)
{
    const struct fovea_source_ops *found = find(uri, address);
    if (found == NULL) return unknown_name(uri, strcspn(uri, ":"), error);
    *ops = found;
    return FOVEA_OK;
}

enum fovea_status fv_source_control(const struct fovea_source_ops *ops, struct fovea_source *source,
                                    enum fovea_source_control control, double value,
                                    struct fovea_error *error)
{
    if (error != NULL) error->text[0] = '\0';
    if (ops->control != NULL) return ops->control(source, control, value, error);
    return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                           "%s: found a recording, expected a camera whose %s can be set: v4l2, "
                           "libcamera or sim",
                           ops->name, control == FOVEA_SOURCE_EXPOSURE ? "exposure" : "gain");
}

enum fovea_status fv_source_drive(const struct fovea_source_ops *ops, struct fovea_source *source,
                                  const struct fovea_velocity_command *command,
                                  struct fovea_error *error)
{
    if (ops->drive != NULL) return ops->drive(source, command, error);
    return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                           "%s: found a velocity command, expected a source that can be driven",
                           ops->name);
}

enum fovea_status fv_source_failure(const struct fovea_source_ops *ops,
                                    const struct fovea_source *source, struct fovea_error *error)
{
    return ops->failure != NULL ? ops->failure(source, error) : FOVEA_AGAIN;
}

enum fovea_status fv_source_failed(const struct fovea_source_ops *ops,
                                   const struct fovea_source *source, const char *uri,
                                   enum fovea_status status, struct fovea_error *error)
{
    struct fovea_error why = {.text = ""};
    if (fv_source_failure(ops, source, &why) == FOVEA_OK)
        return fovea_error_set(error, status, "%.200s: %s", uri, why.text);
    return fovea_error_set(error, status,
                           "%.200s: found an error of the source (%s), expected a frame", uri,
                           fovea_status_name(status));
}
