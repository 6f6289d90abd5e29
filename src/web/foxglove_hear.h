/* What a client of Foxglove's protocol says (github.com/foxglove/ws-protocol, docs/spec.md): JSON,
 * or binary. All of it is a stranger's; what is not understood is said back in one line. JSON is
 * parsed by jansson, whose memory is in proportion to the text, and freed before this returns. */
#ifndef FOVEA_WEB_FOXGLOVE_HEAR_H
#define FOVEA_WEB_FOXGLOVE_HEAR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    FV_FOXGLOVE_WORDS_BYTES = 16384, /* that a client may say at once */
    FV_FOXGLOVE_ID_BYTES = 65,
    FV_FOXGLOVE_SUBSCRIPTIONS = 64, /* in one message; likewise the next two */
    FV_FOXGLOVE_NAMES = 192,
    FV_FOXGLOVE_SETS = 4,
    FV_FOXGLOVE_KEY_BYTES = 64,
    FV_FOXGLOVE_VALUE_BYTES = 400,
    FV_FOXGLOVE_PROBLEM_BYTES = 200
};

enum fv_foxglove_op {
    FV_FOXGLOVE_WRONG, /* `problem` says what */
    FV_FOXGLOVE_SUBSCRIBE,
    FV_FOXGLOVE_UNSUBSCRIBE,
    FV_FOXGLOVE_GET,
    FV_FOXGLOVE_SET,
    FV_FOXGLOVE_WATCH,
    FV_FOXGLOVE_UNWATCH,
};

struct fv_foxglove_said {
    enum fv_foxglove_op op;
    char problem[FV_FOXGLOVE_PROBLEM_BYTES];
    char id[FV_FOXGLOVE_ID_BYTES]; /* of a request; "": none */
    uint32_t count;                /* of what follows */
    struct {
        uint32_t id, channel;
    } subscriptions[FV_FOXGLOVE_SUBSCRIPTIONS];
    char names[FV_FOXGLOVE_NAMES][FV_FOXGLOVE_KEY_BYTES];   /* cut: then no key's */
    char values[FV_FOXGLOVE_SETS][FV_FOXGLOVE_VALUE_BYTES]; /* as a configuration has them */
    const char *refused[FV_FOXGLOVE_SETS];                  /* why a value is none; NULL: it is */
};

void fv_foxglove_hear(const uint8_t *words, size_t bytes, bool binary,
                      struct fv_foxglove_said *said);

#endif
