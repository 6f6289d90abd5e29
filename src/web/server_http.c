#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "drivers/clock.h"
#include "web/keys.h"
#include "web/recordings.h"
#include "web/server_internal.h"

enum {
    HEADER_BYTES = 2048,
    CHUNK_BYTES = 16384,
    PACKED_BYTES_MAX = 32768 /* of what is unpacked for a client: each holds memory for it */
};

/* ---- answers --------------------------------------------------------------------------------- */

struct answer {
    int status;
    const char *type;
    const char *cookie; /* of a login, which leads to the page; NULL: none */
    bool gzip;
    const char *disposition; /* of a file to be saved; NULL: none */
    const char *tag;         /* it may be kept, and is asked about by this; NULL: it may not */
};

static bool add(struct lws *wsi, const char *name, const char *value, uint8_t **at, uint8_t *end)
{
    return lws_add_http_header_by_name(wsi, (const uint8_t *)name, (const uint8_t *)value,
                                       (int)strlen(value), at, end) == 0;
}

/* What a request holds: on a connection that stays, the one before the next. */
static void forget(struct fv_web_request *request)
{
    free(request->made);
    free(request->settings);
    if (request->of_file) close(request->file);
    request->made = NULL;
    request->settings = NULL;
    request->of_file = false;
}

/* Browsers take some rules of such pages alone, and of others complain on the console. */
static bool is_trusted(struct lws *wsi)
{
    char host[FV_WEB_NAME_BYTES];
    const struct fv_web_server *server = lws_context_user(lws_get_context(wsi));
    return server->setup.certificate.file != NULL ||
           (fv_web_server_header(wsi, WSI_TOKEN_HOST, host, sizeof host) &&
            fv_web_host_is_loopback(host));
}

/* Send the head of an answer with `bytes` to follow. Returns what the callback returns. */
static int answer_begin(struct lws *wsi, struct fv_web_request *request,
                        const struct answer *answer, const uint8_t *data, uint64_t bytes)
{
    static const char *const always[][2] = {
        {"content-security-policy:", "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; "
                                     "form-action 'self'; object-src 'none'"},
        {"x-content-type-options:", "nosniff"},
        {"x-frame-options:", "DENY"},
        {"referrer-policy:", "same-origin"}, /* "no-referrer" would make the login's Origin null */
        {"cross-origin-resource-policy:", "same-origin"},
    };
    uint8_t memory[LWS_PRE + HEADER_BYTES], *at = memory + LWS_PRE, *end = memory + sizeof memory;
    bool fits = lws_add_http_header_status(wsi, (unsigned)answer->status, &at, end) == 0 &&
                add(wsi, "content-type:", answer->type, &at, end);
    if (answer->status != HTTP_STATUS_NOT_MODIFIED)
        fits = fits && lws_add_http_header_content_length(wsi, bytes, &at, end) == 0;
    for (size_t i = 0; i < sizeof always / sizeof always[0]; i++)
        fits = fits && add(wsi, always[i][0], always[i][1], &at, end);
    if (is_trusted(wsi))
        fits = fits && add(wsi, "cross-origin-opener-policy:", "same-origin", &at, end);
    fits =
        fits && add(wsi, "cache-control:", answer->tag != NULL ? "private, no-cache" : "no-store",
                    &at, end);
    if (answer->tag != NULL)
        fits = fits && add(wsi, "etag:", answer->tag, &at, end) &&
               add(wsi, "vary:", "accept-encoding", &at, end);
    if (answer->gzip) fits = fits && add(wsi, "content-encoding:", "gzip", &at, end);
    if (answer->disposition != NULL)
        fits = fits && add(wsi, "content-disposition:", answer->disposition, &at, end);
    if (answer->cookie != NULL)
        fits = fits && add(wsi, "set-cookie:", answer->cookie, &at, end) &&
               add(wsi, "location:", "/", &at, end);
    if (!fits || lws_finalize_write_http_header(wsi, memory + LWS_PRE, &at, end) != 0) return -1;
    if (request->head) {
        forget(request);
        return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
    }
    request->data = data;
    request->left = bytes;
    lws_callback_on_writable(wsi);
    return 0;
}

static int answer_text(struct lws *wsi, struct fv_web_request *request, int status,
                       const char *text)
{
    const struct answer answer = {.status = status, .type = "text/plain; charset=utf-8"};
    return answer_begin(wsi, request, &answer, (const uint8_t *)text, strlen(text));
}

/* The same to a request that may have a body: libwebsockets holds back what is answered before all
 * of that has come. A long one is not waited for. */
static int refuse(struct lws *wsi, struct fv_web_request *request, int status, const char *text)
{
    char length[16];
    const bool has_body =
        fv_web_server_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH, length, sizeof length);
    const unsigned long bytes = has_body ? strtoul(length, NULL, 10) : 0;
    if (bytes == 0) return answer_text(wsi, request, status, text);
    if (bytes > FV_KEPT_BYTES_MAX) return -1;
    request->refusal = text;
    request->refusal_status = status;
    return 0;
}

static bool accepts_gzip(struct lws *wsi)
{
    char accepted[128];
    return fv_web_server_header(wsi, WSI_TOKEN_HTTP_ACCEPT_ENCODING, accepted, sizeof accepted) &&
           strstr(accepted, "gzip") != NULL;
}

/* The browser has this content already. It is called after the client's right to see the file is
 * checked, so that nobody else learns what the file holds. */
static bool is_kept(struct lws *wsi, const char *tag)
{
    char kept[256];
    return fv_web_server_header(wsi, WSI_TOKEN_HTTP_IF_NONE_MATCH, kept, sizeof kept) &&
           strstr(kept, tag) != NULL;
}

static int answer_asset(struct lws *wsi, struct fv_web_request *request,
                        const struct fv_web_asset *asset)
{
    char tag[FV_WEB_TAG_BYTES];
    fv_web_asset_tag(asset, tag);
    struct answer answer = {
        .status = HTTP_STATUS_OK, .type = asset->type, .gzip = accepts_gzip(wsi), .tag = tag};
    if (is_kept(wsi, tag)) {
        answer.status = HTTP_STATUS_NOT_MODIFIED;
        answer.gzip = false;
        request->head = true; /* nothing follows */
        return answer_begin(wsi, request, &answer, NULL, 0);
    }
    if (answer.gzip)
        return answer_begin(wsi, request, &answer, asset->gzip,
                            (size_t)(asset->gzip_end - asset->gzip));
    if (asset->gzip_end - asset->gzip > PACKED_BYTES_MAX)
        return answer_text(wsi, request, HTTP_STATUS_NOT_ACCEPTABLE, "It is sent as gzip alone\n");
    size_t bytes;
    request->made = fv_web_asset_inflate(asset, &bytes);
    if (request->made == NULL) return -1;
    return answer_begin(wsi, request, &answer, request->made, bytes);
}

/* The keys of the configuration. */
static int answer_keys(struct lws *wsi, struct fv_web_request *request)
{
    size_t bytes;
    const struct answer answer = {.status = HTTP_STATUS_OK,
                                  .type = "application/json; charset=utf-8",
                                  .gzip = accepts_gzip(wsi)};
    request->made = answer.gzip ? fv_web_keys_gzip(&bytes) : fv_web_keys_json(&bytes);
    if (request->made == NULL) return -1;
    return answer_begin(wsi, request, &answer, request->made, bytes);
}

/* The list of recordings, or one of them. They hold the configuration, and what else only operators
 * see: for others it is as if there were no folder. */
static int answer_recordings(const struct fv_web_server *server, struct lws *wsi,
                             struct fv_web_request *request, const char *path,
                             enum fv_web_role role)
{
    char disposition[FV_WEB_RECORDING_NAME_BYTES + 32];
    uint64_t bytes;
    const char *folder = role == FV_WEB_OPERATE ? server->setup.recordings : NULL;
    struct answer answer = {.status = HTTP_STATUS_OK, .type = "application/json; charset=utf-8"};
    if (*path == '\0') {
        request->made = (uint8_t *)fv_web_recordings_json(folder);
        if (request->made == NULL) return -1;
        return answer_begin(wsi, request, &answer, request->made, strlen((char *)request->made));
    }
    request->file = fv_web_recording_open(folder, path + 1, &bytes);
    request->of_file = request->file >= 0;
    if (!request->of_file) return answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "Not found\n");
    snprintf(disposition, sizeof disposition, "attachment; filename=\"%s\"", path + 1);
    answer.type = "application/octet-stream";
    answer.disposition = disposition;
    return answer_begin(wsi, request, &answer, NULL, bytes);
}

/* How the calibration stands, and the camera file that it made. */
static int answer_calibration(const struct fv_web_server *server, struct lws *wsi,
                              struct fv_web_request *request)
{
    const struct answer answer = {.status = HTTP_STATUS_OK,
                                  .type = "application/json; charset=utf-8"};
    request->made = (uint8_t *)fv_web_calibration_json(server->setup.calibration);
    if (request->made == NULL) return -1;
    return answer_begin(wsi, request, &answer, request->made, strlen((char *)request->made));
}

static int answer_calibrated(const struct fv_web_server *server, struct lws *wsi,
                             struct fv_web_request *request)
{
    char disposition[FV_WEB_CALIBRATION_NAME_BYTES + 32];
    size_t bytes;
    const struct fv_web_calibration *calibration = server->setup.calibration;
    const struct answer answer = {.status = HTTP_STATUS_OK,
                                  .type = "application/yaml; charset=utf-8",
                                  .disposition = disposition};
    request->made = (uint8_t *)fv_web_calibration_result(calibration, &bytes);
    if (request->made == NULL)
        return answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "Not found\n");
    snprintf(disposition, sizeof disposition, "attachment; filename=\"%s\"", calibration->file);
    return answer_begin(wsi, request, &answer, request->made, bytes);
}

/* What another program makes for a path. */
static int answer_made(struct lws *wsi, struct fv_web_request *request,
                       const struct fv_web_pages_setup *pages, const char *path)
{
    struct fv_web_made made = {0};
    if (!pages->answer(pages->context, path, &made))
        return answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "Not found\n");
    const struct answer answer = {.status = HTTP_STATUS_OK, .type = made.type};
    request->made = made.data;
    return answer_begin(wsi, request, &answer, made.data, made.bytes);
}

/* The asset of a path: the pages of a run and those of other programs do not mix. */
static const struct fv_web_asset *asset_of(const struct fv_web_server *server, const char *path)
{
    const struct fv_web_pages_setup *pages = server->setup.pages;
    const struct fv_web_asset *asset =
        fv_web_asset_find(pages != NULL && strcmp(path, "/") == 0 ? pages->index : path);
    const bool of_another = asset != NULL && strncmp(asset->path, "/calibrate", 10) == 0;
    if (asset == NULL || asset->open) return asset;
    return of_another == (pages != NULL) ? asset : NULL;
}

/* False: the file has become shorter, or cannot be read. */
static bool take_piece(struct fv_web_request *request, uint8_t *to, size_t bytes)
{
    if (request->of_file) return read(request->file, to, bytes) == (ssize_t)bytes;
    memcpy(to, request->data, bytes);
    request->data += bytes;
    return true;
}

static int answer_more(struct lws *wsi, struct fv_web_request *request)
{
    uint8_t memory[LWS_PRE + CHUNK_BYTES];
    if (request == NULL || (request->data == NULL && !request->of_file)) return 0;
    const size_t bytes = request->left < CHUNK_BYTES ? (size_t)request->left : CHUNK_BYTES;
    const bool last = bytes == request->left;
    if (!take_piece(request, memory + LWS_PRE, bytes)) return -1;
    request->left -= bytes;
    if (lws_write(wsi, memory + LWS_PRE, bytes, last ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) < 0)
        return -1;
    if (!last) {
        lws_callback_on_writable(wsi);
        return 0;
    }
    request->data = NULL;
    forget(request);
    return lws_http_transaction_completed(wsi) != 0 ? -1 : 0;
}

/* ---- requests -------------------------------------------------------------------------------- */

static int begin_login(struct fv_web_server *server, struct lws *wsi,
                       struct fv_web_request *request)
{
    char local[INET_ADDRSTRLEN], remote[INET_ADDRSTRLEN];
    char length[16];
    fv_web_server_addresses(wsi, local, remote);
    snprintf(request->address, sizeof request->address, "%s", remote);
    if (server->setup.tokens == NULL) return answer_text(wsi, request, 404, "Not found\n");
    if (!fv_web_server_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH, length, sizeof length) ||
        strtoul(length, NULL, 10) >= FV_WEB_BODY_BYTES)
        return -1; /* a body that is none of ours is not read */
    request->login = true;
    return 0;
}

/* A body that is taken whole, of at most so many bytes. */
static int begin_body(struct lws *wsi, struct fv_web_request *request, size_t bytes_max)
{
    char length[16];
    if (!fv_web_server_header(wsi, WSI_TOKEN_HTTP_CONTENT_LENGTH, length, sizeof length) ||
        strtoul(length, NULL, 10) > bytes_max)
        return -1; /* as a login's */
    request->settings = malloc(FV_KEPT_BYTES_MAX + 1);
    return request->settings == NULL ? -1 : 0;
}

/* The page of the calibration answers to one name alone: that by which the browser came here. */
static void name_calibration(struct fv_web_server *server, struct lws *wsi)
{
    char host[FV_WEB_NAME_BYTES];
    if (!fv_web_server_header(wsi, WSI_TOKEN_HOST, host, sizeof host)) return;
    for (int i = 0; i < server->setup.name_count; i++) {
        const char *name = server->setup.names[i];
        const size_t length = strlen(name);
        if (strncasecmp(host, name, length) == 0 && (host[length] == '\0' || host[length] == ':'))
            server->setup.calibration->name = name;
    }
}

/* A board, by which the camera of the run is calibrated, or "end". */
static int begin_calibration(struct fv_web_server *server, struct lws *wsi,
                             struct fv_web_request *request, enum fv_web_role role)
{
    const struct fv_web_robots *robots = server->setup.robots;
    const uint32_t robot = fv_web_server_robot(wsi);
    if (robot >= robots->count || server->setup.calibration->folder == NULL)
        return refuse(wsi, request, HTTP_STATUS_NOT_FOUND, "Not found\n");
    request->relay = robots->robots[robot].relay;
    if (role != FV_WEB_OPERATE)
        return refuse(wsi, request, HTTP_STATUS_FORBIDDEN, "this token may only look");
    if (request->relay->reader == NULL)
        return refuse(wsi, request, HTTP_STATUS_FORBIDDEN, "there is no run of this host");
    request->calibrates = true;
    name_calibration(server, wsi);
    return begin_body(wsi, request, FV_WEB_TARGET_BYTES);
}

static int end_calibration(struct fv_web_server *server, struct lws *wsi,
                           struct fv_web_request *request)
{
    struct fv_web_calibration *calibration = server->setup.calibration;
    struct fovea_error error;
    enum fovea_status status = FOVEA_OK;
    request->settings[request->settings_bytes] = '\0';
    if (strcmp(request->settings, "end") == 0)
        fv_web_calibration_stop(calibration);
    else
        status =
            fv_web_calibration_start(calibration, request->relay->path, request->settings, &error);
    free(request->settings);
    request->settings = NULL;
    if (status == FOVEA_OK) return answer_calibration(server, wsi, request);
    request->made = (uint8_t *)strdup(error.text);
    if (request->made == NULL) return -1;
    return answer_text(wsi, request,
                       status == FOVEA_ERROR_INPUT ? HTTP_STATUS_CONFLICT
                                                   : HTTP_STATUS_INTERNAL_SERVER_ERROR,
                       (const char *)request->made);
}

/* All settings of the run are asked for, by an empty line, or come in the body to be restored. */
static int begin_settings(struct fv_web_server *server, struct lws *wsi,
                          struct fv_web_request *request, enum fv_web_role role)
{
    const struct fv_web_robots *robots = server->setup.robots;
    const uint32_t robot = fv_web_server_robot(wsi);
    if (robot >= robots->count) return refuse(wsi, request, HTTP_STATUS_NOT_FOUND, "Not found\n");
    request->relay = robots->robots[robot].relay;
    const char *refusal = fv_web_server_refusal(server, request->relay, role);
    if (refusal != NULL) return refuse(wsi, request, HTTP_STATUS_FORBIDDEN, refusal);
    return begin_body(wsi, request, FV_KEPT_BYTES_MAX);
}

/* Pass them on, and say by which number the run answers. */
static int end_settings(struct fv_web_server *server, struct lws *wsi,
                        struct fv_web_request *request)
{
    const struct fv_web_relay *relay = request->relay;
    char id[32];
    if (relay->reader == NULL) return -1;
    request->settings[request->settings_bytes] = '\0';
    const bool asks = strcmp(request->settings, "\n") == 0;
    if (strlen(request->settings) != request->settings_bytes) {
        forget(request);
        return answer_text(wsi, request, HTTP_STATUS_BAD_REQUEST, "Found a byte 0 in settings\n");
    }
    snprintf(id, sizeof id, "%lld",
             (long long)fv_web_commander_settings(server->setup.commander, relay->prefix,
                                                  (int64_t)fv_feed_reader_run(relay->reader),
                                                  asks ? "" : request->settings));
    free(request->settings);
    request->settings = NULL;
    request->made = (uint8_t *)strdup(id);
    if (request->made == NULL) return -1;
    return answer_text(wsi, request, HTTP_STATUS_OK, (const char *)request->made);
}

/* Of a run's page, and of fovea-calibrate's. */
static const char *const forbidden[] = {
    "Forbidden: Host or Origin is none of this page's (--name adds one)\n",
    "Forbidden: Host or Origin is none of this page's (--host adds one)\n",
};

static int begin(struct fv_web_server *server, struct lws *wsi, struct fv_web_request *request,
                 const char *path)
{
    enum fv_web_role role = FV_WEB_NOBODY;
    forget(request);
    memset(request, 0, sizeof *request);
    const bool post = lws_hdr_total_length(wsi, WSI_TOKEN_POST_URI) > 0;
    request->head = lws_hdr_total_length(wsi, WSI_TOKEN_HEAD_URI) > 0;
    const bool get = request->head || lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI) > 0;
    const int status = fv_web_server_judge(server, wsi, post, &role);
    if (status == HTTP_STATUS_FORBIDDEN)
        return refuse(wsi, request, status, forbidden[server->setup.pages != NULL]);
    if (post && strcmp(path, "/login") == 0) return begin_login(server, wsi, request);
    if (post && status == HTTP_STATUS_OK && strcmp(path, "/settings") == 0 &&
        server->setup.robots != NULL)
        return begin_settings(server, wsi, request, role);
    if (post && status == HTTP_STATUS_OK && strcmp(path, "/calibration") == 0 &&
        server->setup.robots != NULL)
        return begin_calibration(server, wsi, request, role);
    if (!get && status == HTTP_STATUS_UNAUTHORIZED)
        return refuse(wsi, request, status, "Unauthorized: log in at /login\n");
    if (!get) return refuse(wsi, request, HTTP_STATUS_METHOD_NOT_ALLOWED, "Not allowed\n");
    const struct fv_web_asset *asset = asset_of(server, path);
    if (status == HTTP_STATUS_UNAUTHORIZED && (asset == NULL || !asset->open)) {
        const bool page = asset != NULL && strcmp(path, "/") == 0;
        if (!page) return answer_text(wsi, request, status, "Unauthorized: log in at /login\n");
        struct answer answer = {.status = status, .type = asset->type, .gzip = false};
        size_t bytes;
        request->made = fv_web_asset_inflate(fv_web_asset_find("/login"), &bytes);
        if (request->made == NULL) return -1;
        return answer_begin(wsi, request, &answer, request->made, bytes);
    }
    if (asset == NULL && server->setup.pages != NULL)
        return answer_made(wsi, request, server->setup.pages, path);
    if (strcmp(path, "/keys") == 0) return answer_keys(wsi, request);
    if (server->setup.robots != NULL && strcmp(path, "/calibration") == 0)
        return answer_calibration(server, wsi, request);
    if (server->setup.robots != NULL && strcmp(path, "/calibration/result") == 0)
        return answer_calibrated(server, wsi, request);
    const size_t recordings = strlen("/recordings");
    if (server->setup.robots != NULL && strncmp(path, "/recordings", recordings) == 0 &&
        (path[recordings] == '\0' || path[recordings] == '/'))
        return answer_recordings(server, wsi, request, path + recordings, role);
    if (asset == NULL) return answer_text(wsi, request, HTTP_STATUS_NOT_FOUND, "Not found\n");
    return answer_asset(wsi, request, asset);
}

/* The body of a login: token=... */
static int end_login(struct fv_web_server *server, struct lws *wsi, struct fv_web_request *request)
{
    const char *word = "token=";
    char name[24], cookie[128];
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    request->body[request->body_bytes] = '\0';
    request->login = false;
    if (!fv_web_tries_left(&server->tries, request->address, now_ns))
        return answer_text(wsi, request, 429, "Too many wrong tokens: wait 30 seconds\n");
    const char *token = request->body + strlen(word);
    if (strncmp(request->body, word, strlen(word)) != 0 ||
        fv_web_tokens_role(server->setup.tokens, token) == FV_WEB_NOBODY) {
        fv_web_tries_failed(&server->tries, request->address, now_ns);
        return answer_text(wsi, request, HTTP_STATUS_UNAUTHORIZED, "Wrong token\n");
    }
    fv_web_server_cookie_name(server, name);
    snprintf(cookie, sizeof cookie, "%s=%s; Path=/; Max-Age=31536000; HttpOnly; SameSite=Strict%s",
             name, token, server->setup.certificate.file != NULL ? "; Secure" : "");
    struct answer answer = {
        .status = HTTP_STATUS_SEE_OTHER, .type = "text/plain; charset=utf-8", .cookie = cookie};
    uint8_t *text = (uint8_t *)strdup("Welcome\n");
    request->made = text;
    return text == NULL ? -1 : answer_begin(wsi, request, &answer, text, 8);
}

static int take_body(struct fv_web_request *request, const void *in, size_t length)
{
    if (length == 0) return 0;
    if (request != NULL && request->refusal != NULL) return 0;
    if (request != NULL && request->settings != NULL) {
        if (length > FV_KEPT_BYTES_MAX - request->settings_bytes) return -1;
        memcpy(request->settings + request->settings_bytes, in, length);
        request->settings_bytes += length;
        return 0;
    }
    if (request == NULL || !request->login || length >= sizeof request->body - request->body_bytes)
        return -1;
    memcpy(request->body + request->body_bytes, in, length);
    request->body_bytes += length;
    return 0;
}

int fv_web_http(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                size_t length)
{
    struct fv_web_server *server = lws_context_user(lws_get_context(wsi));
    struct fv_web_request *request = user;
    switch (reason) {
    case LWS_CALLBACK_HTTP:
        if (lws_get_network_wsi(wsi) != wsi) return -1; /* a stream of HTTP/2 */
        return begin(server, wsi, request, in);
    case LWS_CALLBACK_FILTER_NETWORK_CONNECTION:
        return fv_web_server_is_crowd(user) ? -1 : 0;
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE: /* to HTTP/2: not here */
        return in != NULL && strcasecmp(in, "websocket") == 0 ? 0 : -1;
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION: /* a websocket that names no protocol */
        return -1;
    case LWS_CALLBACK_HTTP_BODY:
        return take_body(request, in, length);
    case LWS_CALLBACK_HTTP_BODY_COMPLETION:
        if (request != NULL && request->refusal != NULL)
            return answer_text(wsi, request, request->refusal_status, request->refusal);
        if (request != NULL && request->settings != NULL && request->calibrates)
            return end_calibration(server, wsi, request);
        if (request != NULL && request->settings != NULL) return end_settings(server, wsi, request);
        return request != NULL && request->login ? end_login(server, wsi, request) : -1;
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return answer_more(wsi, request);
    case LWS_CALLBACK_CLOSED_HTTP:
        if (request != NULL) forget(request);
        return 0;
    default:
        return 0;
    }
}
