#include "app/record/recording_types.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "message/fields.h"

#include "fovea_type_texts.h"

enum { TEXTS = (int)(sizeof fv_type_texts / sizeof fv_type_texts[0]), NAME_BYTES = 64 };

static const char mark[] = "//! type ";

static const struct fovea_type *find_type(const char *name)
{
    int32_t count;
    const struct fovea_type *types = fv_message_types(&count);
    for (int32_t i = 0; i < count; i++)
        if (strcmp(types[i].name, name) == 0) return &types[i];
    return NULL;
}

char *fv_recording_types_text(size_t *bytes)
{
    char *text = NULL;
    FILE *stream = open_memstream(&text, bytes);
    if (stream == NULL) return NULL;
    for (int i = 0; i < TEXTS; i++) {
        const struct fovea_type *type = find_type(fv_type_texts[i].name);
        if (type == NULL) continue;
        fprintf(stream, "%s%s %016" PRIx64 "\n%s\n", mark, type->name, (uint64_t)type->hash(),
                fv_type_texts[i].text);
    }
    if (fclose(stream) == 0) return text;
    free(text);
    return NULL;
}

/* One line of a description. */
struct described {
    char name[NAME_BYTES];
    uint64_t hash;
};

/* "fovea.pose_t 0123456789abcdef" up to the end of the line. */
static bool read_line(const char *line, size_t bytes, struct described *found)
{
    char copy[NAME_BYTES + 20], *end;
    if (bytes >= sizeof copy) return false;
    memcpy(copy, line, bytes);
    copy[bytes] = '\0';
    char *space = strchr(copy, ' ');
    if (space == NULL || space == copy || space - copy >= NAME_BYTES || strlen(space + 1) != 16)
        return false;
    *space = '\0';
    memcpy(found->name, copy, (size_t)(space - copy) + 1);
    found->hash = strtoull(space + 1, &end, 16);
    return *end == '\0';
}

/* A recording cannot be replayed without these. */
static const char *const needed[] = {"fovea.recording_t", "fovea.frame_t", "fovea.inputs_t",
                                     "fovea.grants_t", "fovea.recording_end_t"};
enum { NEEDED = sizeof needed / sizeof needed[0] };

/* What is being read, for errors. */
struct reading {
    const char *name;
    int64_t offset;
    int line;       /* of the text, from 1 */
    uint32_t found; /* bit per type of `needed` */
};

static enum fovea_status check_line(struct reading *reading, const char *line, size_t bytes,
                                    struct fovea_error *error)
{
    struct described found;
    if (!read_line(line, bytes, &found))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64
                               ": types: line %d: found no name and hash of a type, expected them",
                               reading->name, reading->offset, reading->line);
    const struct fovea_type *type = find_type(found.name);
    if (type == NULL) return FOVEA_OK;
    if ((uint64_t)type->hash() != found.hash)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: byte %" PRId64
                               ": types: line %d: found %s with hash %016" PRIx64
                               ", expected %016" PRIx64,
                               reading->name, reading->offset, reading->line, type->name,
                               found.hash, (uint64_t)type->hash());
    for (int i = 0; i < NEEDED; i++)
        if (strcmp(type->name, needed[i]) == 0) reading->found |= 1u << i;
    return FOVEA_OK;
}

enum fovea_status fv_recording_types_check(const char *name, int64_t offset, const char *text,
                                           size_t bytes, struct fovea_error *error)
{
    const size_t length = sizeof mark - 1;
    struct reading reading = {.name = name, .offset = offset, .line = 1};
    for (size_t at = 0; at < bytes; reading.line++) {
        const char *end = memchr(text + at, '\n', bytes - at);
        const size_t line = end == NULL ? bytes - at : (size_t)(end - text) - at;
        if (line > length && memcmp(text + at, mark, length) == 0) {
            const enum fovea_status status =
                check_line(&reading, text + at + length, line - length, error);
            if (status != FOVEA_OK) return status;
        }
        at += line + 1;
    }
    for (int i = 0; i < NEEDED; i++)
        if ((reading.found & 1u << i) == 0)
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%s: byte %" PRId64 ": types: found no %s, expected it", name,
                                   offset, needed[i]);
    return FOVEA_OK;
}
