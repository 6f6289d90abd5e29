#include "web/keys.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "app/config/settings.h"
#include "support/json.h"

static const char *kind_of(const struct fv_settings_key *key)
{
    switch (key->kind) {
    case FV_CONFIG_BOOL:
        return "boolean";
    case FV_CONFIG_CHOICE:
        return "choice";
    case FV_CONFIG_U32:
    case FV_CONFIG_U64:
    case FV_CONFIG_I32:
    case FV_CONFIG_REAL:
        return "number";
    default:
        return "text";
    }
}

static void put_text(FILE *file, const char *member, const char *text)
{
    fprintf(file, ",\"%s\":", member);
    fv_json_text(file, text);
}

static void put_default(FILE *file, const struct fv_settings *settings,
                        const struct fv_settings_key *key)
{
    char *text = fv_settings_value_text(settings, key);
    if (text != NULL) put_text(file, "default", text);
    free(text);
}

static void put_key(FILE *file, const struct fv_settings *settings,
                    const struct fv_settings_key *key)
{
    char range[FV_SETTINGS_RANGE_BYTES];
    fv_settings_range_print(key, range, sizeof range);
    fputs("{\"name\":", file);
    fv_json_text(file, key->name);
    put_text(file, "kind", kind_of(key));
    put_text(file, "range", range);
    put_text(file, "help", key->help);
    if (key->cost != NULL) put_text(file, "cost", key->cost);
    put_default(file, settings, key);
    if (key->kind == FV_CONFIG_CHOICE) {
        fputs(",\"words\":[", file);
        for (size_t i = 0; key->choices[i] != NULL; i++) {
            if (i > 0) fputc(',', file);
            fv_json_text(file, key->choices[i]);
        }
        fputc(']', file);
    }
    fprintf(file, ",\"live\":%s}", key->live ? "true" : "false");
}

uint8_t *fv_web_keys_json(size_t *bytes)
{
    char *text = NULL;
    struct fv_settings *settings = malloc(sizeof *settings);
    FILE *file = settings != NULL ? open_memstream(&text, bytes) : NULL;
    if (file != NULL) {
        fv_settings_default(settings);
        for (size_t i = 0; i < fv_settings_key_count; i++) {
            fputs(i == 0 ? "[" : ",\n", file);
            put_key(file, settings, &fv_settings_keys[i]);
        }
        fputs("]\n", file);
        if (fclose(file) != 0) {
            free(text);
            text = NULL;
        }
    }
    free(settings);
    return (uint8_t *)text;
}

uint8_t *fv_web_keys_gzip(size_t *bytes)
{
    size_t plain_bytes;
    uint8_t *plain = fv_web_keys_json(&plain_bytes), *packed = NULL;
    z_stream stream = {.next_in = plain, .avail_in = (uInt)plain_bytes};
    if (plain == NULL) return NULL;
    if (deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY) ==
        Z_OK) {
        const size_t most = deflateBound(&stream, (uLong)plain_bytes);
        packed = malloc(most);
        stream.next_out = packed;
        stream.avail_out = (uInt)most;
        if (packed != NULL && deflate(&stream, Z_FINISH) != Z_STREAM_END) {
            free(packed);
            packed = NULL;
        }
        *bytes = most - stream.avail_out;
        deflateEnd(&stream);
    }
    free(plain);
    return packed;
}
