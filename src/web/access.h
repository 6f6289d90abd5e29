/* Who may see the page, and who may command: names of hosts, origins, tokens, cookies, tries. All
 * text here is a stranger's. No heap but where a file is read. */
#ifndef FOVEA_WEB_ACCESS_H
#define FOVEA_WEB_ACCESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

enum {
    FV_WEB_TOKEN_DIGITS = 32, /* hexadecimal: 128 bits */
    FV_WEB_NAMES_MAX = 16,
    FV_WEB_NAME_BYTES = 128, /* of a Host header */
    FV_WEB_TRIES = 5,        /* wrong tokens of an address, before it has to wait */
    FV_WEB_TRIERS_MAX = 64   /* addresses that are known at once */
};
#define FV_WEB_TRY_WAIT_NS INT64_C(30000000000)

enum fv_web_role { FV_WEB_NOBODY, FV_WEB_VIEW, FV_WEB_OPERATE };

struct fv_web_tokens {
    char view[FV_WEB_TOKEN_DIGITS + 1], operate[FV_WEB_TOKEN_DIGITS + 1];
};

/* FOVEA_ERROR_INPUT: `address` is no IPv4 address, or one that other hosts reach and no token is
 * asked for. Init-only. */
enum fovea_status fv_web_address_check(const char *address, bool has_token,
                                       struct fovea_error *error);

/* Read the tokens of the file, or make both and the file, with mode 0600, where there is none.
 * FOVEA_ERROR_INPUT: others may use the file, it is neither root's nor ours, or it holds something
 * else. Init-only. */
enum fovea_status fv_web_tokens_read(const char *path, struct fv_web_tokens *tokens, bool *made,
                                     struct fovea_error *error);

/* What a token allows. The time it takes tells nothing about the tokens. */
enum fv_web_role fv_web_tokens_role(const struct fv_web_tokens *tokens, const char *token);

/* Whether a Host header names this server: with our port (which 80 need not state,
 * nor 443 of HTTPS), a loopback address, localhost, the
 * address `local` that the connection came to, or one of `names`. An address cannot be rebound to
 * another host by a name server, a name can. */
bool fv_web_host_is_ours(const char *host, uint16_t port, bool encrypted, const char *local,
                         const char *const *names, int count);

/* Whether a Host header names the loopback, whose pages browsers trust as encrypted ones. */
bool fv_web_host_is_loopback(const char *host);

/* Whether the Origin header is that of our own page: http:// (https:// where it is encrypted) and
 * the Host header. */
bool fv_web_origin_is_ours(const char *origin, const char *host, bool encrypted);

/* Whether it is one of a list with spaces between; NULL: none is. */
bool fv_web_origin_is_listed(const char *origin, const char *list);

/* FOVEA_ERROR_INPUT: a word of the list is no origin: a scheme, :// and a host without a path, or
 * null. Init-only. */
enum fovea_status fv_web_origins_check(const char *list, struct fovea_error *error);

/* The value of a cookie that holds a token; false: there is none of this name. */
bool fv_web_cookie_token(const char *cookies, const char *name,
                         char token[FV_WEB_TOKEN_DIGITS + 1]);

/* Wrong tokens, by address. Zeroed at first. An address that is not known takes the place of the
 * one that was heard of longest ago. */
struct fv_web_tries {
    struct fv_web_trier {
        char address[48];
        uint32_t count;
        int64_t last_ns, heard_ns;           /* of a wrong one; of any */
        bool is_in;                          /* a right cookie came, while it might try */
        char wrong[FV_WEB_TOKEN_DIGITS + 1]; /* of the last wrong cookie */
    } list[FV_WEB_TRIERS_MAX];
};

/* Whether this address may try a token at `now_ns` (CLOCK_MONOTONIC). */
bool fv_web_tries_left(struct fv_web_tries *tries, const char *address, int64_t now_ns);
void fv_web_tries_failed(struct fv_web_tries *tries, const char *address, int64_t now_ns);

/* Whether the cookie of this address, which holds a token that is right or not, lets it in. A wrong
 * one is a try as at the login, once however often the browser sends it; and a right one that comes
 * when none is left lets in only who was in before, so that nobody is locked out of an open page.
 */
bool fv_web_tries_cookie(struct fv_web_tries *tries, const char *address, const char *token,
                         bool is_right, int64_t now_ns);

#endif
