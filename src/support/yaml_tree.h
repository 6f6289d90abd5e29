/* A YAML file as a read-only tree in which every value knows its line: what configuration and
 * calibration files are read from.
 *
 * Reading is done by libyaml. Limits, since files may be hostile: FV_YAML_* below. Refused, each
 * with its line: anchors and aliases, keys that are not scalars, a key twice in one mapping, a
 * second document (an empty one at the end is none), zero bytes in text. The first line "%YAML:1.0"
 * of OpenCV's FileStorage, which is not YAML, is taken for a comment; tags are ignored. Every error
 * line reads "file:line: key: found
 * ..., expected ...". Init-only, any thread. Of the drivers and the command, which need libyaml:
 * not in the library, and not installed. */
#ifndef FOVEA_SUPPORT_YAML_TREE_H
#define FOVEA_SUPPORT_YAML_TREE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"
#include "support/text.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_YAML_BYTES_MAX = 1 << 20,
    FV_YAML_NODES_MAX = 1 << 16,
    FV_YAML_KEYS_MAX = 1024, /* of one mapping */
    FV_YAML_DEPTH_MAX = 32,
    FV_YAML_PATH_BYTES = 256
};

enum fv_yaml_kind { FV_YAML_SCALAR = 0, FV_YAML_SEQUENCE = 1, FV_YAML_MAPPING = 2 };

struct fv_yaml_node {
    enum fv_yaml_kind kind;
    bool quoted;       /* scalar in quotes: text, never a number, a truth value or null */
    uint32_t line;     /* from 1; of the key where there is one */
    uint32_t index;    /* position among the children of its parent, from 0 */
    uint32_t count;    /* children */
    const char *key;   /* in a mapping; NULL otherwise */
    const char *value; /* of a scalar; "" otherwise */
    const struct fv_yaml_node *parent, *first, *next;
};

struct fv_yaml_tree {
    const char *file;                /* as named in errors */
    const struct fv_yaml_node *root; /* never NULL: an empty file is an empty mapping */
    uint32_t node_count;
};

/* Read a file, or `bytes` bytes of text that errors call `name`. On success the caller owns
 * `*tree`. */
enum fovea_status fv_yaml_read(const char *path, struct fv_yaml_tree **tree,
                               struct fovea_error *error);
enum fovea_status fv_yaml_parse(const char *name, const char *text, size_t bytes,
                                struct fv_yaml_tree **tree, struct fovea_error *error);
void fv_yaml_free(struct fv_yaml_tree *tree);

/* Child of a mapping by key, NULL where absent or `node` is no mapping. Children of both kinds of
 * collection are also linked: node->first, ->next. */
const struct fv_yaml_node *fv_yaml_child(const struct fv_yaml_node *node, const char *key);

/* The child, or an error that says which key is missing and, if one is like it, which was found
 * instead. */
enum fovea_status fv_yaml_require(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                  const char *key, const struct fv_yaml_node **child,
                                  struct fovea_error *error);

/* The scalar number `index` (from 0) at or below `node` in reading order, NULL past the last. */
const struct fv_yaml_node *fv_yaml_leaf(const struct fv_yaml_node *node, size_t index);

/* Where a node is, for people: "camera_matrix.data[3]"; "the file" for the root. Returns `path`. */
const char *fv_yaml_path(const struct fv_yaml_node *node, char path[FV_YAML_PATH_BYTES]);

/* Fill `error` with "file:line: path: found <the node>, expected <expected>". Returns
 * FOVEA_ERROR_INPUT. */
enum fovea_status fv_yaml_refuse(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 const char *expected, struct fovea_error *error);

/* Typed values, range inclusive. FOVEA_ERROR_INPUT (outputs untouched) says what was found and
 * expected. */
enum fovea_status fv_yaml_number(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 double min, double max, double *value, struct fovea_error *error);
enum fovea_status fv_yaml_integer(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                  int64_t min, int64_t max, int64_t *value,
                                  struct fovea_error *error);
/* true/false, yes/no, on/off. */
enum fovea_status fv_yaml_bool(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                               bool *value, struct fovea_error *error);
/* Any scalar but null, of at most max_bytes bytes without its zero; lives as long as the tree. */
enum fovea_status fv_yaml_string(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 size_t max_bytes, const char **value, struct fovea_error *error);
/* One of `choice_count` words; the error lists them. */
enum fovea_status fv_yaml_choice(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                 const char *const *choices, size_t choice_count, size_t *index,
                                 struct fovea_error *error);
/* A sequence of finite numbers, nested sequences read through in order (so rows of a matrix may be
 * bracketed or not). Between count_min and count_max of them; `*count` may be NULL. */
enum fovea_status fv_yaml_numbers(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                                  size_t count_min, size_t count_max, double *values, size_t *count,
                                  struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif
