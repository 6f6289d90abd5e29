/* What strangers say to fovea-web, behind libwebsockets' parser: words of a page, headers of a
 * request, words of Foxglove's clients, and messages of a run that they are shown. Whatever the
 * bytes are, nothing is read or written out of bounds, and no more is kept than there is room for.
 * The first byte says which input the rest is (the names below), the second which of its kind. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "message/message.h"
#include "web/access.h"
#include "web/client.h"
#include "web/foxglove.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { PAGE, HOST, ORIGIN, COOKIE, TOKEN, FOXGLOVE_TEXT, FOXGLOVE_BYTES, MESSAGE, KINDS };
enum { PACKET_BYTES = 700000, SENT_MAX = 200 };

static struct fv_web_store store;
static struct fv_foxglove_views views;
static struct fv_foxglove_parameters parameters;
static struct fv_foxglove_said said;
static uint8_t *packet;

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc;
    (void)argv;
    fv_message_prepare();
    fv_web_store_begin(&store, "R");
    fv_foxglove_views_init(&views);
    fv_foxglove_views_begin(&views, "R");
    packet = malloc(PACKET_BYTES);
    return packet == NULL;
}

static void expect(bool holds)
{
    if (!holds) abort();
}

static void hear_page(const uint8_t *data, size_t bytes)
{
    struct fv_web_client client;
    struct fv_web_command command;
    bool text;
    fv_web_client_init(&client, FV_WEB_VIEW, true);
    const enum fv_web_said what =
        fv_web_client_hear(&client, (const char *)data, bytes, 1000, &command);
    expect(what >= FV_WEB_SAID_NOTHING && what <= FV_WEB_SAID_WRONG);
    if (what == FV_WEB_SAID_COMMAND)
        expect(strlen(command.key) <= FV_WEB_WORDS_BYTES || command.bits != 0);
    for (int i = 0; i < SENT_MAX; i++)
        if (fv_web_client_next(&client, &store, packet, PACKET_BYTES, 1000, &text) == 0) break;
}

static void hear_foxglove(const uint8_t *data, size_t bytes, bool binary)
{
    const struct fv_foxglove_shown shown = {&store, &views, &parameters};
    static struct fv_foxglove_client client;
    bool text;
    int sent = 0;
    fv_foxglove_init(&client, FV_WEB_OPERATE, true, 1, 0);
    while (fv_foxglove_next(&client, &shown, packet, PACKET_BYTES, 0, &text) > 0)
        expect(++sent < SENT_MAX); /* so that there are channels to subscribe to */
    fv_foxglove_hear(data, bytes, binary, &said);
    expect(said.count <= FV_FOXGLOVE_NAMES && said.id[FV_FOXGLOVE_ID_BYTES - 1] == '\0');
    /* Values go to a run by a transport, which there is none of here. */
    fv_foxglove_do(&client, &shown, &said, said.op == FV_FOXGLOVE_SET ? "no" : NULL, 0);
    for (int i = 0; i < SENT_MAX; i++)
        if (fv_foxglove_next(&client, &shown, packet, PACKET_BYTES, 1L << 40, &text) == 0) return;
    abort(); /* there is no end */
}

static void take_message(uint8_t which, const uint8_t *data, size_t bytes)
{
    static const char *const channels[] = {
        "POSE",       "CAMERA_POSE",     "FEATURES",      "DETECTIONS",
        "OBJECTS",    "KEYPOINTS",       "PREVIEW",       "MAP",
        "GRID",       "STATISTICS",      "CAMERA_STATUS", "DETECTIONS2",
        "KEYPOINTS2", "PARAMETER_RESULT"};
    const char *channel = channels[which % (sizeof channels / sizeof channels[0])];
    size_t made;
    fv_foxglove_views_take(&views, channel, data, bytes);
    fv_foxglove_parameters_take(&parameters, channel, data, bytes);
    for (uint32_t i = 0; i < views.view_count; i++)
        if (fv_foxglove_views_made(&views, i, &made) != NULL)
            expect(made <= FV_FOXGLOVE_VIEW_BYTES);
}

static void read_header(int kind, const char *text)
{
    static const char *const names[] = {"robot.local"};
    struct fv_web_tokens tokens = {"0123456789abcdef0123456789abcdef",
                                   "fedcba9876543210fedcba9876543210"};
    char token[FV_WEB_TOKEN_DIGITS + 1];
    struct fovea_error error;
    if (kind == HOST) (void)fv_web_host_is_ours(text, 7680, false, "10.0.0.1", names, 1);
    if (kind == ORIGIN) {
        (void)fv_web_origin_is_ours(text, "127.0.0.1:7680", false);
        if (fv_web_origin_is_listed(text, "https://app.foxglove.dev")) expect(strlen(text) == 24);
        (void)fv_web_origins_check(text, &error);
    }
    if (kind == COOKIE && fv_web_cookie_token(text, "fovea_7680", token))
        expect(strlen(token) <= FV_WEB_TOKEN_DIGITS);
    if (kind == TOKEN && fv_web_tokens_role(&tokens, text) != FV_WEB_NOBODY)
        expect(strcmp(text, tokens.view) == 0 || strcmp(text, tokens.operate) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    if (bytes < 2) return 0;
    const int kind = data[0] % KINDS;
    const uint8_t which = data[1];
    char *text = malloc(bytes - 1); /* exactly so many, with a zero */
    if (text == NULL) abort();
    memcpy(text, data + 2, bytes - 2);
    text[bytes - 2] = '\0';
    if (kind == PAGE)
        hear_page(data + 2, bytes - 2);
    else if (kind == FOXGLOVE_TEXT || kind == FOXGLOVE_BYTES)
        hear_foxglove(data + 2, bytes - 2, kind == FOXGLOVE_BYTES);
    else if (kind == MESSAGE)
        take_message(which, data + 2, bytes - 2);
    else
        read_header(kind, text);
    free(text);
    return 0;
}
