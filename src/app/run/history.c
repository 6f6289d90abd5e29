#include "app/run/history.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/output.h"
#include "support/stall.h"
#include "support/text.h"

enum { FILE_BYTES_MAX = 4096 };

/* The number of a line "NAME: NUMBER"; false: it is none. */
static bool line_take(const char *line, const char *name, uint64_t *value)
{
    const size_t length = strlen(name);
    int64_t number;
    if (strncmp(line, name, length) != 0 || strncmp(line + length, ": ", 2) != 0 ||
        !fv_text_integer(line + length + 2, &number) || number < 0)
        return false;
    *value = (uint64_t)number;
    return true;
}

enum fovea_status fv_history_parse(const char *name, char *text, struct fv_history *history,
                                   struct fovea_error *error)
{
    static const char *const names[] = {
#define FV_HISTORY_NAME(counter) #counter,
        FV_HISTORY_COUNTERS(FV_HISTORY_NAME)
#undef FV_HISTORY_NAME
    };
    enum { COUNT = sizeof names / sizeof names[0] };
    uint64_t values[COUNT];
    char *rest = text;
    for (int i = 0; i < COUNT; i++) {
        char quoted[64];
        const char *line = rest != NULL ? strsep(&rest, "\n") : "";
        if (!line_take(line, names[i], &values[i]))
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%.200s: line %d: found %s, expected \"%s: NUMBER\"", name,
                                   i + 1, fv_text_quote(line, quoted, sizeof quoted), names[i]);
    }
    if (rest == NULL || rest[0] != '\0')
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.200s: line %d: found more or no end of the line, expected %d lines", name, COUNT,
            COUNT);
    memcpy(history, values, sizeof values);
    if (history->ends <= history->starts) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.200s: line 2: found %" PRIu64 " ends, expected at most the %" PRIu64
                           " starts",
                           name, history->ends, history->starts);
}

_Static_assert(sizeof(struct fv_history) % sizeof(uint64_t) == 0, "counters alone");

void fv_history_path(const char *asked, const char *config, char *path, size_t capacity)
{
    const char *folder = getenv("STATE_DIRECTORY"), *slash = strrchr(config, '/'),
               *name = slash != NULL ? slash + 1 : config;
    path[0] = '\0';
    if (strcmp(asked, "auto") != 0) {
        snprintf(path, capacity, "%s", asked);
        return;
    }
    const char *end = strstr(name, ".yaml");
    const size_t length = end != NULL ? (size_t)(end - name) : strlen(name);
    if (folder == NULL || folder[0] == '\0' || length == 0) return;
    snprintf(path, capacity, "%.*s/%.*s.health", (int)strcspn(folder, ":"), folder, (int)length,
             name);
}

enum fovea_status fv_history_read(const char *path, struct fv_history *history,
                                  struct fovea_error *error)
{
    char *text;
    size_t bytes;
    memset(history, 0, sizeof *history);
    if (access(path, F_OK) != 0) return FOVEA_OK;
    enum fovea_status status = fv_text_read(path, FILE_BYTES_MAX, &text, &bytes, error);
    if (status != FOVEA_OK) return status;
    if (bytes > 0) status = fv_history_parse(path, text, history, error);
    free(text);
    return status;
}

enum fovea_status fv_history_write(const char *path, const struct fv_history *history,
                                   struct fovea_error *error)
{
    struct fv_output output;
    const int call = fv_stall_enter(path);
    enum fovea_status status = fv_output_open(&output, path, FV_OUTPUT_WHOLE, error);
    FILE *file = status == FOVEA_OK ? fv_output_stream(&output) : NULL;
    if (file != NULL) {
#define FV_HISTORY_LINE(name) fprintf(file, #name ": %" PRIu64 "\n", history->name);
        FV_HISTORY_COUNTERS(FV_HISTORY_LINE)
#undef FV_HISTORY_LINE
        status = fv_output_close(&output, error);
    } else if (status == FOVEA_OK) {
        fv_output_discard(&output);
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: no memory to write it", path);
    }
    fv_stall_leave(call);
    return status;
}
