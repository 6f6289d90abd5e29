#include "web/access.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#define VIEW "view "
#define OPERATE "operate "

enum { FILE_BYTES_MAX = 256 };

/* ---- tokens ---------------------------------------------------------------------------------- */

/* The token behind `word` at the start of a line. */
static bool token_find(const char *text, const char *word, char token[FV_WEB_TOKEN_DIGITS + 1])
{
    const char *at = strstr(text, word);
    if (at == NULL || (at != text && at[-1] != '\n')) return false;
    at += strlen(word);
    const size_t length = strspn(at, "0123456789abcdef");
    if (length != FV_WEB_TOKEN_DIGITS || (at[length] != '\n' && at[length] != '\0')) return false;
    memcpy(token, at, length);
    token[length] = '\0';
    return true;
}

static bool token_make(char token[FV_WEB_TOKEN_DIGITS + 1])
{
    uint8_t bits[FV_WEB_TOKEN_DIGITS / 2];
    if (getrandom(bits, sizeof bits, 0) != (ssize_t)sizeof bits) return false;
    for (size_t i = 0; i < sizeof bits; i++)
        snprintf(token + 2 * i, 3, "%02x", bits[i]);
    return true;
}

static enum fovea_status make(const char *path, struct fv_web_tokens *tokens,
                              struct fovea_error *error)
{
    char text[FILE_BYTES_MAX];
    errno = 0;
    const int file = token_make(tokens->view) && token_make(tokens->operate)
                         ? open(path, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600)
                         : -1;
    const int length =
        snprintf(text, sizeof text, VIEW "%s\n" OPERATE "%s\n", tokens->view, tokens->operate);
    const bool written =
        file >= 0 && write(file, text, (size_t)length) == length && fsync(file) == 0;
    const int reason = errno;
    if (file >= 0) close(file);
    if (written) return FOVEA_OK;
    if (file >= 0) unlink(path);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "--token: %.300s: cannot be made: %s", path,
                           strerror(reason));
}

enum fovea_status fv_web_tokens_read(const char *path, struct fv_web_tokens *tokens, bool *made,
                                     struct fovea_error *error)
{
    char text[FILE_BYTES_MAX] = "";
    struct stat status;
    const char *found = NULL;
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY | O_NOFOLLOW);
    *made = file < 0 && errno == ENOENT;
    if (*made) return make(path, tokens, error);
    const bool looked = file >= 0 && fstat(file, &status) == 0;
    if (looked && !S_ISREG(status.st_mode))
        found = "no ordinary file";
    else if (looked && status.st_mode & 077)
        found = "a file that others than its owner may use (chmod 600 remedies that)";
    else if (looked && status.st_uid != 0 && status.st_uid != geteuid())
        found = "a file of another user";
    else if (!looked || read(file, text, sizeof text - 1) < 0)
        found = strerror(errno);
    else if (!token_find(text, VIEW, tokens->view) || !token_find(text, OPERATE, tokens->operate) ||
             strcmp(tokens->view, tokens->operate) == 0)
        found = "something else";
    if (file >= 0) close(file);
    if (found == NULL) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "--token: %.300s: found %s, expected two lines, 'view' and 'operate', "
                           "each with 32 hexadecimal digits of its own; without a file one is made",
                           path, found);
}

/* Every digit is compared, whatever the first differences are. */
static bool is_same(const char *one, const char *other)
{
    unsigned differ = 0;
    for (int i = 0; i < FV_WEB_TOKEN_DIGITS; i++)
        differ |= (unsigned)(one[i] ^ other[i]);
    return differ == 0;
}

enum fv_web_role fv_web_tokens_role(const struct fv_web_tokens *tokens, const char *token)
{
    if (strlen(token) != FV_WEB_TOKEN_DIGITS) return FV_WEB_NOBODY;
    const bool view = is_same(tokens->view, token), operate = is_same(tokens->operate, token);
    return operate ? FV_WEB_OPERATE : view ? FV_WEB_VIEW : FV_WEB_NOBODY;
}

/* ---- headers --------------------------------------------------------------------------------- */

static bool is_loopback(const char *name)
{
    struct in_addr address;
    if (strcasecmp(name, "localhost") == 0 || strcmp(name, "[::1]") == 0) return true;
    return inet_pton(AF_INET, name, &address) == 1 && ntohl(address.s_addr) >> 24 == 127;
}

bool fv_web_host_is_ours(const char *host, uint16_t port, bool encrypted, const char *local,
                         const char *const *names, int count)
{
    char name[FV_WEB_NAME_BYTES], wanted[8];
    const size_t length = strlen(host);
    if (length == 0 || length >= sizeof name) return false;
    memcpy(name, host, length + 1);
    char *colon = strrchr(name, ':');
    if (colon != NULL && strchr(colon, ']') != NULL) colon = NULL; /* of an IPv6 address */
    snprintf(wanted, sizeof wanted, ":%u", (unsigned)port);
    if (colon != NULL ? strcmp(colon, wanted) != 0 : port != (encrypted ? 443 : 80)) return false;
    if (colon != NULL) *colon = '\0';
    if (is_loopback(name) || (local[0] != '\0' && strcmp(name, local) == 0)) return true;
    for (int i = 0; i < count; i++)
        if (strcasecmp(name, names[i]) == 0) return true;
    return false;
}

bool fv_web_host_is_loopback(const char *host)
{
    char name[FV_WEB_NAME_BYTES];
    const char *colon = strrchr(host, ':');
    if (colon != NULL && strchr(colon, ']') != NULL) colon = NULL; /* of an IPv6 address */
    const size_t length = colon != NULL ? (size_t)(colon - host) : strlen(host);
    if (length >= sizeof name) return false;
    memcpy(name, host, length);
    name[length] = '\0';
    return is_loopback(name);
}

bool fv_web_origin_is_ours(const char *origin, const char *host, bool encrypted)
{
    const char *scheme = encrypted ? "https://" : "http://";
    return strncmp(origin, scheme, strlen(scheme)) == 0 &&
           strcasecmp(origin + strlen(scheme), host) == 0;
}

bool fv_web_origin_is_listed(const char *origin, const char *list)
{
    const size_t length = strlen(origin);
    for (const char *at = list != NULL ? list : ""; *at != '\0';) {
        at += strspn(at, " ");
        const size_t word = strcspn(at, " ");
        if (word > 0 && word == length && strncasecmp(at, origin, length) == 0) return true;
        at += word;
    }
    return false;
}

/* A scheme, "://" and something without a slash: those of programs' own pages have other schemes
 * than http (app://, file://, whose rest is empty). */
static bool is_origin(const char *word, size_t bytes)
{
    const char *colon = memchr(word, ':', bytes);
    if (bytes == 4 && strncmp(word, "null", 4) == 0) return true;
    if (colon == NULL || colon == word || (size_t)(word + bytes - colon) < 3 ||
        strncmp(colon, "://", 3) != 0)
        return false;
    const char *rest = colon + 3;
    return memchr(rest, '/', (size_t)(word + bytes - rest)) == NULL;
}

enum fovea_status fv_web_origins_check(const char *list, struct fovea_error *error)
{
    for (const char *at = list; *at != '\0';) {
        at += strspn(at, " ");
        const size_t word = strcspn(at, " ");
        if (word > 0 && !is_origin(at, word))
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "--origins (web.origins): found '%.*s', expected origins such as "
                "https://app.foxglove.dev, without a path",
                (int)(word < 80 ? word : 80), at);
        at += word;
    }
    return FOVEA_OK;
}

bool fv_web_cookie_token(const char *cookies, const char *name, char token[FV_WEB_TOKEN_DIGITS + 1])
{
    const size_t length = strlen(name);
    for (const char *at = cookies; *at != '\0';) {
        at += strspn(at, "; \t");
        if (strncmp(at, name, length) == 0 && at[length] == '=') {
            const char *value = at + length + 1;
            const size_t digits = strcspn(value, "; \t");
            if (digits != FV_WEB_TOKEN_DIGITS) return false;
            memcpy(token, value, digits);
            token[digits] = '\0';
            return true;
        }
        at += strcspn(at, ";");
    }
    return false;
}

/* ---- tries ----------------------------------------------------------------------------------- */

static struct fv_web_trier *trier_find(struct fv_web_tries *tries, const char *address)
{
    for (int i = 0; i < FV_WEB_TRIERS_MAX; i++)
        if (strcmp(tries->list[i].address, address) == 0) return &tries->list[i];
    return NULL;
}

bool fv_web_tries_left(struct fv_web_tries *tries, const char *address, int64_t now_ns)
{
    struct fv_web_trier *trier = trier_find(tries, address);
    if (trier == NULL) return true;
    if (now_ns - trier->last_ns >= FV_WEB_TRY_WAIT_NS) trier->count = 0;
    return trier->count < FV_WEB_TRIES;
}

/* The place of an address, which may be new. */
static struct fv_web_trier *trier_of(struct fv_web_tries *tries, const char *address,
                                     int64_t now_ns)
{
    struct fv_web_trier *trier = trier_find(tries, address);
    if (trier == NULL) {
        trier = &tries->list[0];
        for (int i = 1; i < FV_WEB_TRIERS_MAX; i++)
            if (tries->list[i].heard_ns < trier->heard_ns) trier = &tries->list[i];
        memset(trier, 0, sizeof *trier);
        snprintf(trier->address, sizeof trier->address, "%s", address);
    }
    trier->heard_ns = now_ns;
    return trier;
}

void fv_web_tries_failed(struct fv_web_tries *tries, const char *address, int64_t now_ns)
{
    struct fv_web_trier *trier = trier_of(tries, address, now_ns);
    trier->count++;
    trier->last_ns = now_ns;
}

bool fv_web_tries_cookie(struct fv_web_tries *tries, const char *address, const char *token,
                         bool is_right, int64_t now_ns)
{
    const bool left = fv_web_tries_left(tries, address, now_ns);
    struct fv_web_trier *trier = trier_of(tries, address, now_ns);
    if (is_right) {
        trier->is_in |= left;
        return trier->is_in;
    }
    if (left && strcmp(trier->wrong, token) != 0) {
        fv_web_tries_failed(tries, address, now_ns);
        snprintf(trier->wrong, sizeof trier->wrong, "%s", token);
    }
    return false;
}

enum fovea_status fv_web_address_check(const char *address, bool has_token,
                                       struct fovea_error *error)
{
    struct in_addr found;
    if (inet_pton(AF_INET, address, &found) != 1)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--address: found '%.60s', expected an IPv4 address", address);
    if (ntohl(found.s_addr) >> 24 != 127 && !has_token)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--address %s: found no --token, expected one where other hosts can "
                               "reach the page",
                               address);
    return FOVEA_OK;
}
