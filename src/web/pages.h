/* A page of another program than fovea-web: the same server, access and login (server.h), in a
 * thread of its own. For programs in C++ too. */
#ifndef FOVEA_WEB_PAGES_H
#define FOVEA_WEB_PAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is sent for a path. */
struct fv_web_made {
    const char *type; /* of the content */
    uint8_t *data;    /* of malloc; the server frees it */
    size_t bytes;
};

struct fv_web_pages_setup {
    const char *address; /* an IPv4 address of this host; 0.0.0.0: all */
    uint16_t port;       /* 0: one that is free */
    const char *name;    /* a further name by which browsers call this host; NULL: none */
    const char *token;   /* file of tokens, made where there is none; NULL: none is asked for */
    const char *certificate, *certificate_key; /* PEM files, for HTTPS; NULL: HTTP */
    const char *index;                         /* the asset that "/" shows: /calibrate */
    /* The answer for a path that is no asset, in the server's thread. False: there is none. */
    bool (*answer)(void *context, const char *path, struct fv_web_made *made);
    void *context;
};

struct fv_web_pages;

/* FOVEA_ERROR_INPUT: not at this address and port, no address, or one that other hosts reach
 * without a token. Says on the terminal where it is. */
enum fovea_status fv_web_pages_open(const struct fv_web_pages_setup *setup,
                                    struct fv_web_pages **pages, struct fovea_error *error);
void fv_web_pages_close(struct fv_web_pages *pages);

#ifdef __cplusplus
}
#endif
#endif
