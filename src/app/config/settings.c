#include "app/config/settings.h"

#include <stdlib.h>
#include <string.h>

#include "support/input.h"
#include "app/config/classes.h"
#include "app/config/settings_renamed.h"
#include "app/network/command_gate.h"
#include "app/network/transport_url.h"
#include "support/utf8.h"
#include "support/yaml_tree.h"
#include "runtime/config.h"

/* ---- reading --------------------------------------------------------------------------------- */

struct reading {
    struct fv_settings *settings;
    const struct fv_yaml_tree *tree;
    struct fovea_error *error;
    bool from_set;
};

static size_t choice_count(const struct fv_settings_key *key)
{
    size_t count = 0;
    while (key->choices[count] != NULL)
        count++;
    return count;
}

/* Three rows of four numbers; a fourth row may follow that is that of every rigid motion. */
static enum fovea_status take_transform(const struct reading *r, const struct fv_yaml_node *node,
                                        double T[12])
{
    double all[16];
    if (fv_yaml_numbers(r->tree, node, 16, 16, all, NULL, NULL) != FOVEA_OK || all[12] != 0 ||
        all[13] != 0 || all[14] != 0 || all[15] != 1)
        return fv_yaml_numbers(r->tree, node, 12, 12, T, NULL, r->error);
    memcpy(T, all, 12 * sizeof T[0]);
    return FOVEA_OK;
}

/* A list of words in their order, or one word. */
static enum fovea_status take_list(const struct reading *r, const struct fv_settings_key *key,
                                   const struct fv_yaml_node *node, uint32_t *list)
{
    const struct fv_yaml_node *leaf;
    uint32_t count = 0;
    size_t index;
    char expected[128];
    if (node->kind == FV_YAML_MAPPING)
        return fv_yaml_refuse(r->tree, node, "a list like [denoise, sharpen]", r->error);
    for (; (leaf = fv_yaml_leaf(node, count)) != NULL; count++) {
        if (count == (uint32_t)key->max) {
            snprintf(expected, sizeof expected, "at most %u words", count);
            return fv_yaml_refuse(r->tree, leaf, expected, r->error);
        }
        const enum fovea_status status =
            fv_yaml_choice(r->tree, leaf, key->choices, choice_count(key), &index, r->error);
        if (status != FOVEA_OK) return status;
        list[1 + count] = (uint32_t)index;
    }
    list[0] = count;
    for (int64_t i = count; i < key->max; i++) /* equal lists are equal bytes */
        list[1 + i] = 0;
    return FOVEA_OK;
}

/* A list of words, or one word; `auto` alone, where the key has it. */
static enum fovea_status take_flags(const struct reading *r, const struct fv_settings_key *key,
                                    const struct fv_yaml_node *node, uint32_t *flags)
{
    static const char *const automatic[] = {"auto"};
    const struct fv_yaml_node *leaf;
    uint32_t found = 0;
    size_t index;
    if (fv_settings_has_auto(key) && node->kind == FV_YAML_SCALAR &&
        fv_yaml_choice(r->tree, node, automatic, 1, &index, NULL) == FOVEA_OK) {
        *flags = (uint32_t)key->max;
        return FOVEA_OK;
    }
    if (node->kind == FV_YAML_MAPPING)
        return fv_yaml_refuse(r->tree, node,
                              fv_settings_has_auto(key) ? "a list like [save, pause], or auto"
                                                        : "a list of words",
                              r->error);
    for (size_t i = 0; (leaf = fv_yaml_leaf(node, i)) != NULL; i++) {
        const enum fovea_status status =
            fv_yaml_choice(r->tree, leaf, key->choices, choice_count(key), &index, r->error);
        if (status != FOVEA_OK) return status;
        found |= 1u << index;
    }
    *flags = found;
    return FOVEA_OK;
}

/* Methods that pictures have and the loop has not. */
static bool is_for_pictures(const char *key, const char *value)
{
    return strcmp(key, "features.method") == 0 &&
           (strcmp(value, "sift") == 0 || strcmp(value, "surf") == 0);
}

/* One of the key's words; a word of 0.1 is refused with that of now. */
static enum fovea_status take_choice(const struct reading *r, const struct fv_settings_key *key,
                                     const struct fv_yaml_node *node, int *choice)
{
    size_t index = 0;
    char expected[128];
    const char *now =
        node->kind == FV_YAML_SCALAR ? fv_settings_renamed_value(key->name, node->value) : NULL;
    if (now != NULL) {
        snprintf(expected, sizeof expected, "'%s': Fovea 0.1 reads the old word", now);
        return fv_yaml_refuse(r->tree, node, expected, r->error);
    }
    if (node->kind == FV_YAML_SCALAR && is_for_pictures(key->name, node->value))
        return fv_yaml_refuse(r->tree, node,
                              "fast, orb, harris or shi_tomasi: the loop compares binary "
                              "descriptors, which sift and surf have not",
                              r->error);
    const enum fovea_status status =
        fv_yaml_choice(r->tree, node, key->choices, choice_count(key), &index, r->error);
    if (status == FOVEA_OK) *choice = (int)index;
    return status;
}

static enum fovea_status take(const struct reading *r, const struct fv_settings_key *key,
                              const struct fv_yaml_node *node)
{
    char *target = (char *)r->settings + key->offset;
    int64_t whole = 0;
    const char *text = NULL;
    enum fovea_status status = FOVEA_OK;
    switch (key->kind) {
    case FV_CONFIG_U32:
    case FV_CONFIG_U64:
    case FV_CONFIG_I32:
        status = fv_yaml_integer(r->tree, node, key->min, key->max, &whole, r->error);
        if (status == FOVEA_OK && key->kind == FV_CONFIG_U32) *(uint32_t *)target = (uint32_t)whole;
        if (status == FOVEA_OK && key->kind == FV_CONFIG_U64) *(uint64_t *)target = (uint64_t)whole;
        if (status == FOVEA_OK && key->kind == FV_CONFIG_I32) *(int32_t *)target = (int32_t)whole;
        return status;
    case FV_CONFIG_REAL:
        return fv_yaml_number(r->tree, node, key->real_min, key->real_max, (double *)target,
                              r->error);
    case FV_CONFIG_BOOL:
        return fv_yaml_bool(r->tree, node, (bool *)target, r->error);
    case FV_CONFIG_TEXT:
        status = fv_yaml_string(r->tree, node, (size_t)key->max, &text, r->error);
        if (status == FOVEA_OK) strcpy(target, text);
        return status;
    case FV_CONFIG_CHOICE:
        return take_choice(r, key, node, (int *)target);
    case FV_CONFIG_FLAGS:
        return take_flags(r, key, node, (uint32_t *)target);
    case FV_CONFIG_LIST:
        return take_list(r, key, node, (uint32_t *)target);
    case FV_CONFIG_TRANSFORM:
        return take_transform(r, node, (double *)target);
    }
    return FOVEA_ERROR_UNSUPPORTED;
}

/* "features" of "features.count_max"; empty for keys outside sections. */
static size_t section_length(const char *name)
{
    const char *dot = strchr(name, '.');
    return dot != NULL ? (size_t)(dot - name) : 0;
}

static bool is_section(const char *name)
{
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        size_t length = section_length(fv_settings_keys[i].name);
        if (length > 0 && strncmp(fv_settings_keys[i].name, name, length) == 0 &&
            name[length] == '\0')
            return true;
    }
    return false;
}

/* The nearest full name to `name`, or the one whose last part is `name` (a key written outside its
 * section).
 */
static const char *name_nearest(const char *name)
{
    const char *names[FV_SETTINGS_KEYS_MAX], *leaves[FV_SETTINGS_KEYS_MAX];
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        names[i] = fv_settings_keys[i].name;
        leaves[i] = names[i] + section_length(names[i]) + (strchr(names[i], '.') != NULL);
    }
    const char *nearest = fv_text_nearest(name, names, fv_settings_key_count);
    if (nearest != NULL) return nearest;
    const char *dot = strrchr(name, '.');
    const char *leaf = fv_text_nearest(dot != NULL ? dot + 1 : name, leaves, fv_settings_key_count);
    for (size_t i = 0; leaf != NULL && i < fv_settings_key_count; i++)
        if (leaves[i] == leaf) return names[i];
    return NULL;
}

static size_t word_length(const char *at)
{
    return strcspn(at, "._-");
}

static bool has_word(const char *name, const char *word, size_t length)
{
    for (const char *at = name; *at != '\0'; at += word_length(at), at += *at != '\0')
        if (word_length(at) == length && strncmp(at, word, length) == 0) return true;
    return false;
}

/* Where no name is like it: the one that shares most words with the last part of `name`, in its
 * section rather than elsewhere, and one that is such a word rather than one of several
 * ("features.max_count", "lcm", "frame_rate"); NULL when none does. */
static const char *name_by_words(const char *name)
{
    const char *dot = strrchr(name, '.'), *best = NULL;
    const size_t section = dot != NULL ? (size_t)(dot - name) : 0;
    int most = 0;
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const char *key = fv_settings_keys[i].name;
        int shared = section_length(key) == section && strncmp(key, name, section) == 0;
        for (const char *at = name + section + (dot != NULL); *at != '\0';
             at += word_length(at), at += *at != '\0')
            shared += word_length(at) > 2 && has_word(key, at, word_length(at)) ? 2 : 0;
        const bool is_word = key[word_length(key)] == '\0';
        if (shared < 2 || shared < most || (shared == most && !is_word)) continue;
        most = shared;
        best = key;
    }
    return best;
}

/* A whole section of 0.1 is named by its first key where that is one of 0.1 too. */
static enum fovea_status refuse_renamed(const struct reading *r, const struct fv_yaml_node *node,
                                        const char *now)
{
    char path[FV_YAML_PATH_BYTES], name[128];
    if (node->kind == FV_YAML_MAPPING && node->first != NULL) {
        snprintf(name, sizeof name, "%.60s.%.60s", node->key, node->first->key);
        const char *inner = fv_settings_renamed(name);
        if (inner != NULL) now = inner, node = node->first;
    }
    return fovea_error_set(r->error, FOVEA_ERROR_INPUT,
                           "%s:%u: %s: found a key that Fovea 0.1 reads, expected its name now, "
                           "'%s'",
                           r->tree->file, node->line, fv_yaml_path(node, path), now);
}

static enum fovea_status unknown(const struct reading *r, const struct fv_yaml_node *node,
                                 const char *name)
{
    char path[FV_YAML_PATH_BYTES];
    static char section[64];
    const char *now = fv_settings_renamed(name);
    if (now != NULL) return refuse_renamed(r, node, now);
    const char *nearest = name_nearest(name);
    size_t length = 0;
    /* A section may be mistyped as a whole: then its name is what is near. */
    for (size_t i = 0; nearest == NULL && i < fv_settings_key_count; i++) {
        length = section_length(fv_settings_keys[i].name);
        if (length == 0 || length >= sizeof section) continue;
        snprintf(section, sizeof section, "%.*s", (int)length, fv_settings_keys[i].name);
        const char *const one[] = {section};
        nearest = fv_text_nearest(name, one, 1);
    }
    if (nearest == NULL) nearest = name_by_words(name);
    return fovea_error_set(
        r->error, FOVEA_ERROR_INPUT,
        "%s:%u: %s: found an unknown key, expected a known one%s%s%s ('fovea config' lists all)",
        r->tree->file, node->line, fv_yaml_path(node, path), nearest ? ", nearest is '" : "",
        nearest ? nearest : "", nearest ? "'" : "");
}

static enum fovea_status take_key(const struct reading *r, const struct fv_yaml_node *node,
                                  const char *name)
{
    const struct fv_settings_key *key = fv_settings_key_find(name);
    if (key == NULL) return unknown(r, node, name);
    uint32_t *line = &r->settings->line[key - fv_settings_keys];
    if (!r->from_set && *line != 0) /* once in its section and once as section.key */
        return fovea_error_set(
            r->error, FOVEA_ERROR_INPUT,
            "%s:%u: %s: found it again (first on line %u), expected each key once", r->tree->file,
            node->line, name, *line);
    enum fovea_status status = take(r, key, node);
    if (status == FOVEA_OK) *line = r->from_set ? FV_SETTINGS_SET : node->line;
    return status;
}

static enum fovea_status take_tree(const struct reading *r)
{
    const struct fv_yaml_node *root = r->tree->root;
    if (root->kind != FV_YAML_MAPPING)
        return fv_yaml_refuse(r->tree, root, "keys with values ('fovea config' shows how)",
                              r->error);
    for (const struct fv_yaml_node *node = root->first; node != NULL; node = node->next) {
        enum fovea_status status = FOVEA_OK;
        if (!is_section(node->key)) {
            status = take_key(r, node, node->key);
            if (status != FOVEA_OK) return status;
            continue;
        }
        bool empty = node->kind == FV_YAML_SCALAR && !node->quoted &&
                     (node->value[0] == '\0' || strcmp(node->value, "~") == 0 ||
                      strcmp(node->value, "null") == 0);
        if (node->kind != FV_YAML_MAPPING && !empty)
            return fv_yaml_refuse(r->tree, node, "a section with keys in it", r->error);
        for (const struct fv_yaml_node *child = node->first; child != NULL; child = child->next) {
            char name[128];
            snprintf(name, sizeof name, "%.60s.%.60s", node->key, child->key);
            status = take_key(r, child, name);
            if (status != FOVEA_OK) return status;
        }
    }
    return FOVEA_OK;
}

enum fovea_status fv_settings_parse(struct fv_settings *settings, const char *name,
                                    const char *text, size_t bytes, struct fovea_error *error)
{
    struct fv_yaml_tree *tree;
    enum fovea_status status = fv_yaml_parse(name, text, bytes, &tree, error);
    if (status != FOVEA_OK) return status;
    snprintf(settings->file, sizeof settings->file, "%s", name);
    memset(settings->line, 0, sizeof settings->line);
    struct reading reading = {settings, tree, error, false};
    status = take_tree(&reading);
    fv_yaml_free(tree);
    return status;
}

enum fovea_status fv_settings_read(struct fv_settings *settings, const char *path,
                                   struct fovea_error *error)
{
    char *text;
    size_t bytes;
    enum fovea_status status = fv_text_read(path, FV_INPUT_YAML_BYTES_MAX, &text, &bytes, error);
    if (status != FOVEA_OK) return status;
    status = fv_settings_parse(settings, path, text, bytes, error);
    free(text);
    return status;
}

/* ---- --set ----------------------------------------------------------------------------------- */

static enum fovea_status set_refuse(const char *key, const char *found, const char *expected,
                                    struct fovea_error *error)
{
    char quoted[FV_TEXT_QUOTED_BYTES];
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "--set: %s: found %s, expected %s", key,
                           fv_text_quote(found, quoted, sizeof quoted), expected);
}

/* "1, seed: 2" is more than a value. */
static bool one_value(const struct fv_yaml_tree *tree, bool in_section)
{
    const struct fv_yaml_node *value = tree->root;
    for (int level = 0; level <= (int)in_section; level++) {
        if (value->kind != FV_YAML_MAPPING || value->count != 1) return false;
        value = value->first;
    }
    return true;
}

/* The line number of a text that has but one line says nothing: "--set:1: key" becomes "--set:
 * key". */
static void drop_line(struct fovea_error *error)
{
    static const char with[] = "--set:1: ", without[] = "--set: ";
    if (error == NULL || strncmp(error->text, with, sizeof with - 1) != 0) return;
    memmove(error->text + sizeof without - 1, error->text + sizeof with - 1,
            strlen(error->text + sizeof with - 1) + 1);
    memcpy(error->text, without, sizeof without - 1);
}

static enum fovea_status set_parsed(struct fv_settings *settings, const char *name,
                                    const char *value, struct fovea_error *error)
{
    enum { VALUE_MAX = 2048 };
    char text[VALUE_MAX + 256];
    if (strlen(value) > VALUE_MAX || strpbrk(value, "\n\r#") != NULL)
        return set_refuse(name, value, "a value in one line", error);
    int section = (int)section_length(name);
    int bytes = section > 0 ? snprintf(text, sizeof text, "{%.*s: {%s: %s}}", section, name,
                                       name + section + 1, value)
                            : snprintf(text, sizeof text, "{%s: %s}", name, value);
    struct fv_yaml_tree *tree;
    if (fv_yaml_parse("--set", text, (size_t)bytes, &tree, NULL) != FOVEA_OK)
        return set_refuse(name, value, "one value", error);
    struct reading reading = {settings, tree, error, true};
    const bool one = one_value(tree, section > 0);
    enum fovea_status status =
        one ? take_tree(&reading) : set_refuse(name, value, "one value", error);
    fv_yaml_free(tree);
    drop_line(error);
    return status;
}

enum fovea_status fv_settings_set(struct fv_settings *settings, const char *assignment,
                                  struct fovea_error *error)
{
    char name[64], quoted[FV_TEXT_QUOTED_BYTES];
    size_t length = strcspn(assignment, "=");
    if (assignment[length] == '\0' || length == 0 || length >= sizeof name)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "--set: found %s, expected key=value",
                               fv_text_quote(assignment, quoted, sizeof quoted));
    snprintf(name, sizeof name, "%.*s", (int)length, assignment);
    const char *value = assignment + length + 1;
    const struct fv_settings_key *key = fv_settings_key_find(name);
    const char *now = key == NULL ? fv_settings_renamed(name) : NULL;
    if (now != NULL)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "--set: %s: found a key that Fovea 0.1 reads, expected its name now, '%s'", name, now);
    if (key == NULL) {
        const char *nearest = name_nearest(name);
        if (nearest == NULL) nearest = name_by_words(name);
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "--set: %s: found an unknown key, expected a known one%s%s%s ('fovea config' lists all)",
            fv_text_quote(name, quoted, sizeof quoted), nearest ? ", nearest is '" : "",
            nearest ? nearest : "", nearest ? "'" : "");
    }
    if (key->kind != FV_CONFIG_TEXT) return set_parsed(settings, name, value, error);
    /* Texts are taken as they stand: "sim:" would otherwise need quotes within the shell's. */
    if (!fv_utf8_check(value)) return set_refuse(name, value, "UTF-8 text", error);
    if (strlen(value) > (size_t)key->max) return set_refuse(name, value, "a shorter text", error);
    strcpy((char *)settings + key->offset, value);
    settings->line[key - fv_settings_keys] = FV_SETTINGS_SET;
    return FOVEA_OK;
}

/* ---- checks ---------------------------------------------------------------------------------- */

void fv_settings_locate(const struct fv_settings *settings, struct fovea_error *error)
{
    char text[FOVEA_ERROR_TEXT_BYTES];
    if (error == NULL) return;
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        size_t length = strlen(fv_settings_keys[i].name);
        if (strncmp(error->text, fv_settings_keys[i].name, length) != 0 ||
            error->text[length] != ':')
            continue;
        memcpy(text, error->text, sizeof text);
        if (settings->line[i] == FV_SETTINGS_SET)
            fovea_error_set(error, error->status, "--set: %s", text);
        else if (settings->line[i] == FV_SETTINGS_KEPT)
            fovea_error_set(error, error->status, "%.200s: %s", settings->parameters_file, text);
        else if (settings->line[i] > 0)
            fovea_error_set(error, error->status, "%.200s:%u: %s", settings->file,
                            settings->line[i], text);
        else /* a default that what was set does not go with */
            fovea_error_set(error, error->status, "%.200s: %.*s (default)%s",
                            settings->file[0] != '\0' ? settings->file : "--set", (int)length, text,
                            text + length);
        return;
    }
}

void fv_settings_blame(const struct fv_settings *settings, const char *key,
                       struct fovea_error *error)
{
    char text[FOVEA_ERROR_TEXT_BYTES];
    const uint32_t line = settings->line[fv_settings_key_find(key) - fv_settings_keys];
    const size_t length = strlen(key);
    if (error == NULL || line == 0 || line >= FV_SETTINGS_KEPT) return;
    memcpy(text, error->text, sizeof text);
    const bool named = strncmp(text, key, length) == 0 && text[length] == ':';
    fovea_error_set(error, error->status, "%.200s:%u: %s%s%.280s", settings->file, line,
                    named ? "" : key, named ? "" : ": ", text);
}

/* Keys that would do nothing without another. */
static enum fovea_status check_pairs(const struct fv_settings *settings, struct fovea_error *error)
{
    const bool load = settings->map_load[0] != '\0', save = settings->map_save[0] != '\0';
    if (settings->model2[0] != '\0' && settings->model[0] == '\0')
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "detect2.model: found '%.200s' without detect.model, expected both",
                               settings->model2);
    if (settings->imu_file[0] != '\0' && settings->imu[0] == '\0')
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "imu_file: found '%.200s' without imu, expected both or neither",
                               settings->imu_file);
    if (!settings->runtime.odometry.enabled && (load || save))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "map.%s: found '%.200s' without odometry, expected odometry.enabled true",
            load ? "load" : "save", load ? settings->map_load : settings->map_save);
    return FOVEA_OK;
}

enum fovea_status fv_settings_check(const struct fv_settings *settings, struct fovea_error *error)
{
    struct fovea_config runtime = settings->runtime;
    struct fovea_camera *camera = &runtime.rig.cameras[0].camera;
    if (camera->width == 0) { /* not known before the source is open */
        *camera = (struct fovea_camera){.width = FOVEA_IMAGE_WIDTH_MIN,
                                        .height = FOVEA_IMAGE_HEIGHT_MIN,
                                        .fx = 1,
                                        .fy = 1,
                                        .field_max_rad = 1};
    }
    /* Nor is the rest of the rig: fovea_size holds it against what odometry is to use. */
    if ((unsigned)runtime.odometry.sensors <= FOVEA_SENSORS_STEREO_INERTIAL)
        runtime.odometry.sensors = FOVEA_SENSORS_AUTO;
    enum fovea_status status = fv_config_check(&runtime, error);
    if (status == FOVEA_OK && settings->lcm_url[0] != '\0')
        status = fv_transport_url_check(settings->lcm_url, error);
    if (status == FOVEA_OK && !fv_receiver_listen_valid(settings->listen))
        status =
            fovea_error_set(error, FOVEA_ERROR_INPUT,
                            "listen: found \"%s\", expected none, loopback, any or the name of "
                            "an interface",
                            settings->listen);
    if (status == FOVEA_OK) status = fv_classes_check(settings, error);
    if (status == FOVEA_OK) status = check_pairs(settings, error);
    if (status == FOVEA_OK) return FOVEA_OK;
    fv_settings_locate(settings, error);
    return FOVEA_ERROR_INPUT;
}
