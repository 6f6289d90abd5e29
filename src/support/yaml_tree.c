#include "support/yaml_tree.h"
#include "support/input.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

/* The parser runs twice over the text: once counting nodes and bytes, once filling memory of
 * exactly that size. */
struct block {
    struct fv_yaml_tree tree;
    char *text;
    struct fv_yaml_node nodes[];
};

struct builder {
    const char *file;
    struct fovea_error *error;
    struct block *block; /* NULL: counting */
    size_t nodes, bytes;
    size_t skipped; /* bytes of the file that the parser was not given */
    uint32_t documents, depth;
    yaml_mark_t document; /* where the last one starts */
    struct level {
        struct fv_yaml_node *node,
            *last; /* the collection and its youngest child; NULL when counting */
        bool mapping, has_key;
        uint32_t count, key_line;
        char *key;
    } levels[FV_YAML_DEPTH_MAX];
};

static enum fovea_status refuse(struct builder *b, const yaml_mark_t *mark, const char *found,
                                const char *expected)
{
    return fovea_error_set(b->error, FOVEA_ERROR_INPUT, "%s:%zu: found %s, expected %s", b->file,
                           mark->line + 1, found, expected);
}

static char *copy_text(struct builder *b, const yaml_event_t *event)
{
    const size_t length = event->data.scalar.length;
    char *copy = NULL;
    if (b->block != NULL) {
        copy = b->block->text + b->bytes;
        memcpy(copy, event->data.scalar.value, length);
        copy[length] = '\0';
    }
    b->bytes += length + 1;
    return copy;
}

static enum fovea_status take_key(struct builder *b, struct level *level, const yaml_event_t *event)
{
    char found[FV_TEXT_QUOTED_BYTES + 64], quoted[FV_TEXT_QUOTED_BYTES];
    if (event->type != YAML_SCALAR_EVENT)
        return refuse(b, &event->start_mark, "a collection as a key", "a plain key");
    if (level->count >= FV_YAML_KEYS_MAX)
        return refuse(b, &event->start_mark, "more keys than one mapping may have", "at most 1024");
    level->key = copy_text(b, event);
    level->key_line = (uint32_t)event->start_mark.line + 1;
    level->has_key = true;
    if (b->block == NULL) return FOVEA_OK;
    const struct fv_yaml_node *earlier = fv_yaml_child(level->node, level->key);
    if (earlier == NULL) return FOVEA_OK;
    snprintf(found, sizeof found, "the key %s again (first on line %u)",
             fv_text_quote(level->key, quoted, sizeof quoted), earlier->line);
    return refuse(b, &event->start_mark, found, "each key once");
}

/* Append a node to the collection on top of the stack. */
static enum fovea_status add_node(struct builder *b, const yaml_event_t *event,
                                  enum fv_yaml_kind kind, struct fv_yaml_node **added)
{
    if (b->nodes >= FV_YAML_NODES_MAX)
        return refuse(b, &event->start_mark, "more values than a file may have", "at most 65536");
    struct level *level = b->depth > 0 ? &b->levels[b->depth - 1] : NULL;
    struct fv_yaml_node *node = b->block != NULL ? &b->block->nodes[b->nodes] : NULL;
    b->nodes++;
    *added = node;
    if (node != NULL) {
        *node = (struct fv_yaml_node){
            .kind = kind, .value = "", .line = (uint32_t)event->start_mark.line + 1};
        if (level != NULL) {
            node->parent = level->node;
            node->index = level->count;
            if (level->mapping) {
                node->key = level->key;
                node->line = level->key_line;
            }
            if (level->last != NULL)
                level->last->next = node;
            else
                level->node->first = node;
            level->last = node;
            level->node->count = level->count + 1;
        }
    }
    if (level != NULL) {
        level->count++;
        level->has_key = false;
    }
    return FOVEA_OK;
}

static enum fovea_status add_value(struct builder *b, const yaml_event_t *event)
{
    struct level *level = b->depth > 0 ? &b->levels[b->depth - 1] : NULL;
    if (level != NULL && level->mapping && !level->has_key) return take_key(b, level, event);
    const enum fv_yaml_kind kind = event->type == YAML_SCALAR_EVENT          ? FV_YAML_SCALAR
                                   : event->type == YAML_MAPPING_START_EVENT ? FV_YAML_MAPPING
                                                                             : FV_YAML_SEQUENCE;
    struct fv_yaml_node *node = NULL;
    const enum fovea_status status = add_node(b, event, kind, &node);
    if (status != FOVEA_OK) return status;
    if (kind == FV_YAML_SCALAR) {
        const char *text = copy_text(b, event);
        if (node != NULL) {
            node->value = text;
            node->quoted = event->data.scalar.style != YAML_PLAIN_SCALAR_STYLE;
        }
        return FOVEA_OK;
    }
    if (b->depth >= FV_YAML_DEPTH_MAX)
        return refuse(b, &event->start_mark, "collections nested too deeply", "at most 32 levels");
    b->levels[b->depth++] = (struct level){.node = node, .mapping = kind == FV_YAML_MAPPING};
    return FOVEA_OK;
}

static bool has_anchor(const yaml_event_t *event)
{
    switch (event->type) {
    case YAML_SCALAR_EVENT:
        return event->data.scalar.anchor != NULL;
    case YAML_SEQUENCE_START_EVENT:
        return event->data.sequence_start.anchor != NULL;
    case YAML_MAPPING_START_EVENT:
        return event->data.mapping_start.anchor != NULL;
    default:
        return event->type == YAML_ALIAS_EVENT;
    }
}

/* A line of dashes at the end, with nothing after it, is how `ros2 topic echo` ends a message. */
static bool is_nothing(const yaml_event_t *event)
{
    return event->type == YAML_SCALAR_EVENT && event->data.scalar.length == 0 &&
           event->data.scalar.style == YAML_PLAIN_SCALAR_STYLE;
}

static enum fovea_status take_event(struct builder *b, const yaml_event_t *event)
{
    if (has_anchor(event))
        return refuse(b, &event->start_mark, "an anchor or alias", "every value written out");
    if (event->type == YAML_SCALAR_EVENT &&
        memchr(event->data.scalar.value, '\0', event->data.scalar.length) != NULL)
        return refuse(b, &event->start_mark, "a zero byte in a value", "text");
    switch (event->type) {
    case YAML_DOCUMENT_START_EVENT:
        b->document = event->start_mark;
        return ++b->documents > 2
                   ? refuse(b, &event->start_mark, "a third document", "one per file")
                   : FOVEA_OK;
    case YAML_SCALAR_EVENT:
    case YAML_SEQUENCE_START_EVENT:
    case YAML_MAPPING_START_EVENT:
        if (b->documents > 1)
            return is_nothing(event) ? FOVEA_OK
                                     : refuse(b, &b->document, "a second document", "one per file");
        return add_value(b, event);
    case YAML_SEQUENCE_END_EVENT:
    case YAML_MAPPING_END_EVENT:
        b->depth--;
        return FOVEA_OK;
    default:
        return FOVEA_OK;
    }
}

static enum fovea_status syntax_error(const struct builder *b, const yaml_parser_t *parser)
{
    if (parser->error == YAML_MEMORY_ERROR)
        return fovea_error_set(b->error, FOVEA_ERROR_SYSTEM, "%s: out of memory", b->file);
    const char *problem = parser->problem != NULL ? parser->problem : "malformed";
    if (parser->error == YAML_READER_ERROR)
        return fovea_error_set(b->error, FOVEA_ERROR_INPUT, "%s: byte %zu: not YAML: %s", b->file,
                               parser->problem_offset + b->skipped, problem);
    return fovea_error_set(b->error, FOVEA_ERROR_INPUT, "%s:%zu: column %zu: not YAML: %s", b->file,
                           parser->problem_mark.line + 1, parser->problem_mark.column + 1, problem);
}

static enum fovea_status run_parser(struct builder *b, const char *text, size_t bytes)
{
    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser))
        return fovea_error_set(b->error, FOVEA_ERROR_SYSTEM, "%s: out of memory", b->file);
    yaml_parser_set_encoding(&parser, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, bytes);
    enum fovea_status status = FOVEA_OK;
    for (bool ended = false; status == FOVEA_OK && !ended;) {
        yaml_event_t event;
        if (!yaml_parser_parse(&parser, &event)) {
            status = syntax_error(b, &parser);
        } else {
            ended = event.type == YAML_STREAM_END_EVENT;
            status = take_event(b, &event);
            yaml_event_delete(&event);
        }
    }
    yaml_parser_delete(&parser);
    return status;
}

/* Bytes that the parser is not given: the mark with which some editors begin UTF-8, which libyaml
 * takes for a column, and OpenCV's "%YAML:1.0" to the end of its line, which stays so that line
 * numbers hold. */
static size_t head_bytes(const char *text, size_t bytes)
{
    static const char mark[] = "\xef\xbb\xbf", head[] = "%YAML:";
    size_t at = 0;
    if (bytes >= sizeof mark - 1 && memcmp(text, mark, sizeof mark - 1) == 0) at = sizeof mark - 1;
    if (bytes - at < sizeof head - 1 || memcmp(text + at, head, sizeof head - 1) != 0) return at;
    const char *end = memchr(text + at, '\n', bytes - at);
    return end != NULL ? (size_t)(end - text) : bytes;
}

static struct block *block_new(const struct builder *counted)
{
    const size_t name_bytes = strlen(counted->file) + 1;
    const size_t nodes_bytes =
        (counted->nodes + 1) * sizeof(struct fv_yaml_node); /* one for an empty root */
    struct block *block = malloc(sizeof *block + nodes_bytes + counted->bytes + name_bytes);
    if (block == NULL) return NULL;
    block->text = (char *)block->nodes + nodes_bytes;
    char *name = block->text + counted->bytes;
    memcpy(name, counted->file, name_bytes);
    block->nodes[0] = (struct fv_yaml_node){.kind = FV_YAML_MAPPING, .line = 1, .value = ""};
    block->tree = (struct fv_yaml_tree){
        .file = name, .root = block->nodes, .node_count = (uint32_t)counted->nodes};
    return block;
}

enum fovea_status fv_yaml_parse(const char *name, const char *text, size_t bytes,
                                struct fv_yaml_tree **tree, struct fovea_error *error)
{
    if (bytes > FV_YAML_BYTES_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found %zu bytes, expected at most %d",
                               name, bytes, (int)FV_YAML_BYTES_MAX);
    const size_t skipped = head_bytes(text, bytes);
    text += skipped;
    bytes -= skipped;
    struct builder builder = {.file = name, .error = error, .skipped = skipped};
    enum fovea_status status = run_parser(&builder, text, bytes);
    if (status != FOVEA_OK) return status;
    struct block *block = block_new(&builder);
    if (block == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", name);
    builder = (struct builder){.file = name, .error = error, .block = block, .skipped = skipped};
    status = run_parser(&builder, text, bytes);
    if (status != FOVEA_OK) {
        free(block);
        return status;
    }
    *tree = &block->tree;
    return FOVEA_OK;
}

enum fovea_status fv_yaml_read(const char *path, struct fv_yaml_tree **tree,
                               struct fovea_error *error)
{
    char *text;
    size_t bytes;
    enum fovea_status status = fv_text_read(path, FV_INPUT_YAML_BYTES_MAX, &text, &bytes, error);
    if (status != FOVEA_OK) return status;
    status = fv_yaml_parse(path, text, bytes, tree, error);
    free(text);
    return status;
}

void fv_yaml_free(struct fv_yaml_tree *tree)
{
    free(tree); /* the first member of its block */
}

const struct fv_yaml_node *fv_yaml_child(const struct fv_yaml_node *node, const char *key)
{
    if (node == NULL || node->kind != FV_YAML_MAPPING) return NULL;
    for (const struct fv_yaml_node *child = node->first; child != NULL; child = child->next)
        if (strcmp(child->key, key) == 0) return child;
    return NULL;
}
