/* Typed values out of a YAML tree, and the error lines when they do not fit. */
#include "support/yaml_tree.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

/* Prepends, walking up from the node; what does not fit is cut at the front. */
const char *fv_yaml_path(const struct fv_yaml_node *node, char path[FV_YAML_PATH_BYTES])
{
    size_t at = FV_YAML_PATH_BYTES - 1;
    path[at] = '\0';
    for (; node->parent != NULL; node = node->parent) {
        char part[FV_TEXT_QUOTED_BYTES + 16], quoted[FV_TEXT_QUOTED_BYTES];
        size_t length;
        if (node->key != NULL) {
            fv_text_quote(node->key, quoted, sizeof quoted);
            quoted[strlen(quoted) - 1] = '\0'; /* without its quotes */
            length = (size_t)snprintf(part, sizeof part, "%s%s",
                                      node->parent->parent != NULL ? "." : "", quoted + 1);
        } else {
            length = (size_t)snprintf(part, sizeof part, "[%u]", node->index);
        }
        if (length > at) break;
        at -= length;
        memcpy(path + at, part, length);
    }
    if (path[at] == '\0') return strcpy(path, "the file");
    return memmove(path, path + at, FV_YAML_PATH_BYTES - at);
}

enum fovea_status fv_yaml_refuse(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 const char *expected, struct fovea_error *error)
{
    char path[FV_YAML_PATH_BYTES], quoted[FV_TEXT_QUOTED_BYTES], found[FV_TEXT_QUOTED_BYTES + 16];
    if (node->kind == FV_YAML_SCALAR && node->quoted) /* "0" is no number */
        snprintf(found, sizeof found, "the text %s",
                 fv_text_quote(node->value, quoted, sizeof quoted));
    else if (node->kind == FV_YAML_SCALAR)
        fv_text_quote(node->value, found, sizeof found);
    else
        snprintf(found, sizeof found, "a %s of %u",
                 node->kind == FV_YAML_MAPPING ? "mapping" : "list", node->count);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s:%u: %s: found %s, expected %s", tree->file,
                           node->line, fv_yaml_path(node, path), found, expected);
}

enum fovea_status fv_yaml_require(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                  const char *key, const struct fv_yaml_node **child,
                                  struct fovea_error *error)
{
    if (node->kind != FV_YAML_MAPPING) {
        char expected[128];
        snprintf(expected, sizeof expected, "a mapping with the key '%s'", key);
        return fv_yaml_refuse(tree, node, expected, error);
    }
    const struct fv_yaml_node *found = fv_yaml_child(node, key);
    if (found != NULL) {
        *child = found;
        return FOVEA_OK;
    }
    const struct fv_yaml_node *like = NULL;
    for (const struct fv_yaml_node *each = node->first; each != NULL && like == NULL;
         each = each->next)
        if (fv_text_nearest(each->key, &key, 1) != NULL) like = each;
    char path[FV_YAML_PATH_BYTES], quoted[FV_TEXT_QUOTED_BYTES];
    if (like != NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s:%u: %s: found the key %s, expected '%s'", tree->file, like->line,
                               fv_yaml_path(node, path),
                               fv_text_quote(like->key, quoted, sizeof quoted), key);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s:%u: %s: found no key '%s', expected it",
                           tree->file, node->line, fv_yaml_path(node, path), key);
}

enum fovea_status fv_yaml_number(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 double min, double max, double *value, struct fovea_error *error)
{
    double number;
    const bool is_number =
        node->kind == FV_YAML_SCALAR && !node->quoted && fv_text_number(node->value, &number);
    if (is_number && number >= min && number <= max) {
        *value = number;
        return FOVEA_OK;
    }
    char expected[96];
    snprintf(expected, sizeof expected, "a number in [%.9g, %.9g]", min, max);
    return fv_yaml_refuse(tree, node, expected, error);
}

enum fovea_status fv_yaml_integer(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                  int64_t min, int64_t max, int64_t *value,
                                  struct fovea_error *error)
{
    int64_t number;
    const bool is_number =
        node->kind == FV_YAML_SCALAR && !node->quoted && fv_text_integer(node->value, &number);
    if (is_number && number >= min && number <= max) {
        *value = number;
        return FOVEA_OK;
    }
    char expected[96];
    snprintf(expected, sizeof expected, "a whole number in [%lld, %lld]", (long long)min,
             (long long)max);
    return fv_yaml_refuse(tree, node, expected, error);
}

enum fovea_status fv_yaml_bool(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                               bool *value, struct fovea_error *error)
{
    static const char *const words[] = {"false", "true", "no", "yes", "off", "on"};
    if (node->kind == FV_YAML_SCALAR && !node->quoted) {
        for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
            if (strcasecmp(node->value, words[i]) != 0) continue;
            *value = i % 2 == 1;
            return FOVEA_OK;
        }
    }
    return fv_yaml_refuse(tree, node, "true or false", error);
}

enum fovea_status fv_yaml_string(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 size_t max_bytes, const char **value, struct fovea_error *error)
{
    const bool null = !node->quoted && (node->value[0] == '\0' || strcmp(node->value, "~") == 0 ||
                                        strcasecmp(node->value, "null") == 0);
    if (node->kind == FV_YAML_SCALAR && !null && strlen(node->value) <= max_bytes) {
        *value = node->value;
        return FOVEA_OK;
    }
    char expected[96];
    snprintf(expected, sizeof expected, "text of at most %zu bytes", max_bytes);
    return fv_yaml_refuse(tree, node, expected, error);
}

enum fovea_status fv_yaml_choice(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 const char *const *choices, size_t choice_count, size_t *index,
                                 struct fovea_error *error)
{
    char expected[FOVEA_ERROR_TEXT_BYTES] = "one of";
    for (size_t i = 0; i < choice_count; i++) {
        if (node->kind == FV_YAML_SCALAR && strcmp(node->value, choices[i]) == 0) {
            *index = i;
            return FOVEA_OK;
        }
        const size_t used = strlen(expected);
        snprintf(expected + used, sizeof expected - used, "%s %s", i > 0 ? "," : "", choices[i]);
    }
    return fv_yaml_refuse(tree, node, expected, error);
}

/* The next node in reading order below `top`; depth is bounded by the tree's own limit. */
static const struct fv_yaml_node *following(const struct fv_yaml_node *node,
                                            const struct fv_yaml_node *top)
{
    if (node->first != NULL) return node->first;
    while (node != top && node->next == NULL)
        node = node->parent;
    return node == top ? NULL : node->next;
}

const struct fv_yaml_node *fv_yaml_leaf(const struct fv_yaml_node *node, size_t index)
{
    for (const struct fv_yaml_node *each = node; each != NULL; each = following(each, node))
        if (each->kind == FV_YAML_SCALAR && index-- == 0) return each;
    return NULL;
}

enum fovea_status fv_yaml_numbers(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                  size_t count_min, size_t count_max, double *values, size_t *count,
                                  struct fovea_error *error)
{
    char expected[96];
    if (count_min == count_max)
        snprintf(expected, sizeof expected, "a list of %zu numbers", count_min);
    else
        snprintf(expected, sizeof expected, "a list of %zu to %zu numbers", count_min, count_max);
    if (node->kind != FV_YAML_SEQUENCE) return fv_yaml_refuse(tree, node, expected, error);
    for (int pass = 0; pass < 2;
         ++pass) { /* the first only checks, so that outputs stay untouched on error */
        size_t found = 0;
        for (const struct fv_yaml_node *each = following(node, node); each != NULL;
             each = following(each, node)) {
            double number;
            if (each->kind == FV_YAML_SEQUENCE) continue;
            if (each->kind != FV_YAML_SCALAR || each->quoted ||
                !fv_text_number(each->value, &number))
                return fv_yaml_refuse(tree, each, "a finite number", error);
            if (pass == 1) values[found] = number;
            if (++found > count_max) return fv_yaml_refuse(tree, node, expected, error);
        }
        if (found < count_min) return fv_yaml_refuse(tree, node, expected, error);
        if (pass == 1 && count != NULL) *count = found;
    }
    return FOVEA_OK;
}
