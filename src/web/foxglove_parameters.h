/* Keys of the configuration as Foxglove's parameters: the run is asked for values by parameter_t,
 * a few at a time, and its answers are kept as it gave them, whoever asked. One thread. */
#ifndef FOVEA_WEB_FOXGLOVE_PARAMETERS_H
#define FOVEA_WEB_FOXGLOVE_PARAMETERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "app/config/settings.h"
#include "message/message.h"
#include "web/command.h"

enum {
    FV_FOXGLOVE_ASKED_MAX = 4,  /* a run takes 8 requests that wait */
    FV_FOXGLOVE_PATIENCE_S = 10 /* a run that lacks the processor takes seconds for a frame */
};

enum fv_foxglove_result {
    FV_FOXGLOVE_DONE,
    FV_FOXGLOVE_REFUSED,
    FV_FOXGLOVE_NEEDS_RESTART,
    FV_FOXGLOVE_SILENT /* no answer has come for FV_FOXGLOVE_PATIENCE_S */
};

struct fv_foxglove_answer {
    uint32_t key; /* index */
    int64_t id;   /* of the request; 0: somebody else's */
    enum fv_foxglove_result result;
    const char *reason; /* "": done */
};

struct fv_foxglove_parameters {
    struct fv_web_commander *commander; /* NULL: nobody is asked */
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
    int64_t run_id;
    void (*answered)(void *context, const struct fv_foxglove_answer *answer);
    void *context;
    struct {
        char *value;      /* of malloc; NULL: not known */
        uint32_t version; /* counts its changes */
        bool wanted;      /* to be asked for */
    } keys[FV_SETTINGS_KEYS_MAX];
    struct {
        int64_t id, sent_ns, run_id; /* id 0: free */
        uint32_t key;
    } asked[FV_FOXGLOVE_ASKED_MAX];
};

void fv_foxglove_parameters_free(struct fv_foxglove_parameters *parameters);

/* The index of a key; -1: there is none of this name. */
int32_t fv_foxglove_parameters_find(const char *name);

/* Ask for a key, soon. */
void fv_foxglove_parameters_want(struct fv_foxglove_parameters *parameters, uint32_t key);
/* Send what is to be asked, and give up what was not answered. What another run was asked is asked
 * for again. */
void fv_foxglove_parameters_tick(struct fv_foxglove_parameters *parameters, int64_t now_ns);
/* A message of the run, on a channel without its prefix. */
void fv_foxglove_parameters_take(struct fv_foxglove_parameters *parameters, const char *channel,
                                 const uint8_t *data, size_t bytes);
/* Another run: what is known is asked for again. */
void fv_foxglove_parameters_begin(struct fv_foxglove_parameters *parameters);

#endif
