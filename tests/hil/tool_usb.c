/* hil-tool usb FORMAT[,FORMAT...] WIDTH HEIGHT FILE RATE [NAME=VALUE...]
 * A USB camera in user space, as the kernel's uvcvideo sees it: USB Video Class 1.0 with one bulk
 * endpoint, spoken over USB/IP through a socket into vhci-hcd. It gives the frames of FILE (a '%'
 * in its name stands for the format's) over and over, and has exposure, gain, brightness, and a
 * sharpness that chooses a fault:
 *
 *   0  none                     1  every fourth frame never comes
 *   2  half of every fourth     3  every fourth has the error bit
 *   4  bytes in the middle of every third are overwritten
 *   5  the gain is refused      6  every request for a format is refused, as where the bus has no
 *      room
 *
 *   port=N          of the emulated bus
 *   serial=TEXT     serial number
 *   after=FILE      a frame goes out when FILE has grown by one since the last, or after ten
 *                   seconds, whatever RATE says
 *   leaves=N        the camera is unplugged when N frames have gone out
 *   waits=MS        so long it streams before its first frame
 *
 * After the USB Video Class specification 1.0 (descriptors and requests) and
 * Documentation/usb/usbip_protocol.rst. */
#include "tool.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    SUBMIT = 1,
    UNLINK = 2,
    SUBMITTED = 3,
    UNLINKED = 4,
    PENDING_MAX = 64,
    PAYLOAD_MAX = 16384,
    FORMATS_MAX = 16
};

/* Numbers of the class specification. */
enum {
    SET_CUR = 0x01,
    GET_CUR = 0x81,
    GET_MIN = 0x82,
    GET_MAX = 0x83,
    GET_RES = 0x84,
    GET_LEN = 0x85,
    GET_INFO = 0x86,
    GET_DEF = 0x87,
    CAMERA = 1,
    OUTPUT = 2,
    PROCESSING = 3
};

struct packet { /* all words big-endian */
    uint32_t command, number, device, direction, endpoint;
    uint32_t words[5];
    uint8_t setup[8];
};
_Static_assert(sizeof(struct packet) == 48, "a USB/IP header");

struct control {
    uint8_t unit, selector, bytes;
    int32_t minimum, maximum, step, value, normal;
};

struct pending {
    uint32_t number, bytes;
};

/* What a format is called on the bus is its place in the list, from 1. */
struct offer {
    const struct tool_format *format;
    struct tool_frames frames;
    uint32_t frame_bytes; /* at most */
};

static struct camera {
    struct offer offers[FORMATS_MAX];
    size_t offer_count;
    int width, height;
    uint32_t interval; /* 100 ns */
    long port;
    const char *serial;
    struct tool_pace pace;

    int socket;
    uint8_t descriptor[2048];
    size_t descriptor_bytes;
    uint8_t probe[26], commit[26];
    bool streaming, in_frame;
    struct pending pending[PENDING_MAX];
    size_t pending_count;
    uint32_t last_submitted;
    struct pending early[PENDING_MAX]; /* unlinked before their submission came */
    size_t early_count;
    int64_t due_ns;
    long number, leaves, waits;
    size_t sent, total;
    uint8_t toggle;
} camera;

enum { DROP = 1, TRUNCATE, MARK, CORRUPT, REFUSE_GAIN, NO_ROOM };

static struct control controls[] = {
    {CAMERA, 0x02, 1, 1, 8, 9, 8, 8}, /* exposure mode: manual 1, aperture priority 8; "step" is the
                                         mask of modes */
    {CAMERA, 0x04, 4, 1, 5000, 1, 156, 156},
    {PROCESSING, 0x02, 2, -64, 64, 1, 0, 0},
    {PROCESSING, 0x04, 2, 0, 255, 1, 16, 16},
    {PROCESSING, 0x08, 2, 0, NO_ROOM, 1, 0, 0}, /* the fault */
};

static int32_t fault(void)
{
    return controls[sizeof controls / sizeof controls[0] - 1].value;
}

/* What streaming was asked for. */
static const struct offer *offer(const uint8_t block[26])
{
    return &camera.offers[block[2] - 1];
}

/* ---- the socket ------------------------------------------------------------------------------ */

static void receive(void *to, size_t bytes)
{
    for (uint8_t *at = to; bytes > 0;) {
        const ssize_t got = read(camera.socket, at, bytes);
        if (got <= 0) exit(0); /* the bus has let go */
        at += got;
        bytes -= (size_t)got;
    }
}

static void deliver(const void *from, size_t bytes)
{
    for (const uint8_t *at = from; bytes > 0;) {
        const ssize_t put = write(camera.socket, at, bytes);
        if (put <= 0) exit(0);
        at += put;
        bytes -= (size_t)put;
    }
}

static void reply(uint32_t number, int32_t status, const void *data, size_t bytes, size_t taken)
{
    static uint8_t out[sizeof(struct packet) + 65536];
    struct packet packet = {.command = htonl(SUBMITTED), .number = htonl(number)};
    packet.words[0] = htonl((uint32_t)status);
    packet.words[1] = htonl((uint32_t)(data != NULL ? bytes : taken));
    packet.words[3] = 0xffffffff;
    memcpy(out, &packet, sizeof packet);
    if (data != NULL) memcpy(out + sizeof packet, data, bytes);
    deliver(out, sizeof packet + (data != NULL ? bytes : 0));
}

static void reply_unlink(uint32_t number, int32_t status)
{
    struct packet packet = {.command = htonl(UNLINKED), .number = htonl(number)};
    packet.words[0] = htonl((uint32_t)status);
    deliver(&packet, sizeof packet);
}

/* ---- descriptors ----------------------------------------------------------------------------- */

/* One descriptor, its length filled in. */
static void add(const uint8_t *bytes, size_t count)
{
    memcpy(camera.descriptor + camera.descriptor_bytes, bytes, count);
    camera.descriptor[camera.descriptor_bytes] = (uint8_t)count;
    camera.descriptor_bytes += count;
}
#define ADD(...) add((const uint8_t[]){0, __VA_ARGS__}, sizeof((const uint8_t[]){0, __VA_ARGS__}))
#define WORD(x) (uint8_t)(x), (uint8_t)((uint32_t)(x) >> 8)
#define LONG(x) WORD(x), (uint8_t)((uint32_t)(x) >> 16), (uint8_t)((uint32_t)(x) >> 24)

static void store_word(size_t at, size_t value)
{
    camera.descriptor[at] = (uint8_t)value;
    camera.descriptor[at + 1] = (uint8_t)(value >> 8);
}

static void describe_format(const struct offer *each, uint8_t index)
{
    const char *four = each->format->guid4;
    const uint32_t bits = (uint32_t)(each->frame_bytes * 8.0 * 1e7 / camera.interval);
    const uint8_t subtype = four == NULL ? 7 : 5;
    if (four == NULL)
        ADD(0x24, 6, index, 1, 0, 1, 0, 0, 0, 0);
    else
        ADD(0x24, 4, index, 1, (uint8_t)four[0], (uint8_t)four[1], (uint8_t)four[2],
            (uint8_t)four[3], 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71,
            (uint8_t)(4 * each->format->half_bytes), 1, 0, 0, 0, 0);
    ADD(0x24, subtype, 1, 0, WORD(camera.width), WORD(camera.height), LONG(bits), LONG(bits),
        LONG(each->frame_bytes), LONG(camera.interval), 1, LONG(camera.interval));
}

static void describe(void)
{
    ADD(2, 0, 0, 2, 1, 0, 0x80, 250); /* configuration */
    ADD(0x0b, 0, 2, 0x0e, 3, 0, 0);   /* interfaces 0 and 1 are one function */
    ADD(4, 0, 0, 0, 0x0e, 1, 0, 0);   /* control interface */
    const size_t control = camera.descriptor_bytes;
    ADD(0x24, 1, WORD(0x100), 0, 0, LONG(48000000), 1, 1);
    ADD(0x24, 2, CAMERA, WORD(0x201), 0, 0, WORD(0), WORD(0), WORD(0), 3, 0x0a, 0, 0);
    ADD(0x24, 5, PROCESSING, CAMERA, WORD(0), 2, 0x11, 0x02, 0);
    ADD(0x24, 3, OUTPUT, WORD(0x101), 0, PROCESSING, 0);
    store_word(control + 5, camera.descriptor_bytes - control);
    ADD(4, 1, 0, 1, 0x0e, 2, 0, 0); /* streaming interface, one bulk endpoint */
    const size_t streaming = camera.descriptor_bytes;
    uint8_t head[14 + FORMATS_MAX] = {
        0, 0x24, 1, (uint8_t)camera.offer_count, 0, 0, 0x81, 0, OUTPUT, 0, 0, 0, 1};
    add(head, 13 + camera.offer_count);
    for (size_t i = 0; i < camera.offer_count; i++)
        describe_format(&camera.offers[i], (uint8_t)(i + 1));
    store_word(streaming + 4, camera.descriptor_bytes - streaming);
    ADD(5, 0x81, 2, WORD(512), 0);
    store_word(2, camera.descriptor_bytes);
}

/* ---- requests -------------------------------------------------------------------------------- */

static void fix_probe(uint8_t probe[26])
{
    const uint8_t interval[4] = {LONG(camera.interval)};
    if (probe[2] < 1 || probe[2] > camera.offer_count) probe[2] = 1;
    const uint8_t sizes[8] = {LONG(offer(probe)->frame_bytes), LONG(PAYLOAD_MAX)};
    probe[3] = 1;
    memcpy(probe + 4, interval, 4);
    memcpy(probe + 18, sizes, 8);
}

/* Standard descriptors. */
static bool get_descriptor(uint32_t number, unsigned value, size_t wanted)
{
    static const uint8_t device[18] = {18,   1,    WORD(0x200), 0xef, 2, 1, 64, 0x6b, 0x1d,
                                       0x02, 0x01, 0,           1,    1, 2, 3,  1};
    static const uint8_t languages[4] = {4, 3, 9, 4};
    const char *const strings[] = {"", "Fovea", "Fovea test camera", camera.serial};
    uint8_t text[128] = {0, 3};
    const void *found = text;
    size_t bytes;
    const unsigned index = value & 255;
    switch (value >> 8) {
    case 1:
        found = device, bytes = sizeof device;
        break;
    case 2:
        found = camera.descriptor, bytes = camera.descriptor_bytes;
        break;
    case 3:
        if (index == 0) {
            found = languages, bytes = sizeof languages;
            break;
        }
        if (index > 3) return false;
        bytes = 2 + 2 * strlen(strings[index]);
        text[0] = (uint8_t)bytes;
        for (size_t i = 0; strings[index][i] != '\0'; i++)
            text[2 + 2 * i] = (uint8_t)strings[index][i];
        break;
    default:
        return false;
    }
    reply(number, 0, found, bytes < wanted ? bytes : wanted, 0);
    return true;
}

/* Probe and commit of the streaming interface. */
static bool negotiate(uint32_t number, unsigned request, unsigned selector, const uint8_t *data,
                      size_t bytes)
{
    uint8_t *block = selector == 1 ? camera.probe : selector == 2 ? camera.commit : NULL;
    uint8_t answer[26];
    if (block == NULL || (fault() == NO_ROOM && request == SET_CUR && selector == 2)) return false;
    memcpy(answer, block, sizeof answer);
    size_t length = sizeof answer;
    switch (request) {
    case SET_CUR:
        memcpy(block, data, bytes < 26 ? bytes : 26);
        fix_probe(block);
        if (selector == 2) {
            camera.streaming = true;
            camera.in_frame = false;
            camera.due_ns = tool_now_ns() + camera.waits * 1000000;
        }
        reply(number, 0, NULL, 0, bytes);
        return true;
    case GET_LEN:
        answer[0] = 26, answer[1] = 0, length = 2;
        break;
    case GET_INFO:
        answer[0] = 3, length = 1;
        break;
    default:
        fix_probe(answer);
        break;
    }
    reply(number, 0, answer, length < bytes ? length : bytes, 0);
    return true;
}

static bool use_control(uint32_t number, unsigned request, unsigned unit, unsigned selector,
                        const uint8_t *data, size_t bytes)
{
    struct control *control = NULL;
    for (size_t i = 0; i < sizeof controls / sizeof controls[0]; i++)
        if (controls[i].unit == unit && controls[i].selector == selector) control = &controls[i];
    if (control == NULL) return false;
    if (request == SET_CUR) {
        uint32_t value = 0;
        if (fault() == REFUSE_GAIN && unit == PROCESSING && selector == 0x04) return false;
        memcpy(&value, data, bytes < control->bytes ? bytes : control->bytes);
        control->value = control->bytes == 2 ? (int16_t)value : (int32_t)value;
        printf("usb: control %u.%u = %d\n", unit, selector, control->value);
        reply(number, 0, NULL, 0, bytes);
        return true;
    }
    uint32_t value = 0;
    size_t length = control->bytes;
    switch (request) {
    case GET_CUR:
        value = (uint32_t)control->value;
        break;
    case GET_MIN:
        value = (uint32_t)control->minimum;
        break;
    case GET_MAX:
        value = (uint32_t)control->maximum;
        break;
    case GET_RES:
        value = (uint32_t)control->step;
        break;
    case GET_DEF:
        value = (uint32_t)control->normal;
        break;
    case GET_INFO:
        value = 3, length = 1;
        break;
    case GET_LEN:
        value = control->bytes, length = 2;
        break;
    default:
        return false;
    }
    reply(number, 0, &value, length < bytes ? length : bytes, 0);
    return true;
}

static void answer_request(uint32_t number, const uint8_t setup[8], const uint8_t *data)
{
    const unsigned kind = setup[0], request = setup[1], value = setup[2] | setup[3] << 8,
                   index = setup[4] | setup[5] << 8;
    const size_t bytes = setup[6] | (size_t)setup[7] << 8;
    const bool class_request = (kind & 0x7f) == 0x21;
    bool done = false;
    if (kind == 0x80 && request == 6) done = get_descriptor(number, value, bytes);
    if (class_request && (index & 255) == 1)
        done = negotiate(number, request, value >> 8, data, bytes);
    if (class_request && (index & 255) == 0)
        done = use_control(number, request, index >> 8, value >> 8, data, bytes);
    if (kind == 0x80 && request == 0) { /* status */
        reply(number, 0, "\0", 2, 0);
        done = true;
    }
    if ((kind == 0 && request == 9) ||
        (kind == 1 && request == 11)) { /* set configuration, set interface */
        reply(number, 0, NULL, 0, 0);
        done = true;
    }
    if (kind == 2 && request == 1) { /* clear halt: how streaming is ended on a bulk endpoint */
        camera.streaming = false;
        reply(number, 0, NULL, 0, 0);
        done = true;
    }
    if (!done) reply(number, -EPIPE, NULL, 0, 0);
}

/* ---- transfers ------------------------------------------------------------------------------- */

static void forget(struct pending *list, size_t *count, size_t i)
{
    memmove(list + i, list + i + 1, (--*count - i) * sizeof *list);
}

static void submit(const struct packet *packet)
{
    static uint8_t out[65536];
    const uint32_t number = ntohl(packet->number), bytes = ntohl(packet->words[1]);
    if (packet->direction == 0 && bytes > 0 && bytes <= sizeof out) receive(out, bytes);
    camera.last_submitted = number;
    for (size_t i = 0; i < camera.early_count; i++) {
        if (camera.early[i].bytes != number) continue;
        reply_unlink(camera.early[i].number, -ECONNRESET);
        forget(camera.early, &camera.early_count, i);
        return;
    }
    if (packet->endpoint == 0)
        answer_request(number, packet->setup, out);
    else if (camera.pending_count < PENDING_MAX)
        camera.pending[camera.pending_count++] = (struct pending){number, bytes};
}

/* The kernel may say that it takes back a transfer before it has said that there is one. */
static void take_back(const struct packet *packet)
{
    const uint32_t number = ntohl(packet->number), victim = ntohl(packet->words[0]);
    int32_t status = 0;
    camera.in_frame = false;
    if ((int32_t)(victim - camera.last_submitted) > 0 && camera.early_count < PENDING_MAX) {
        camera.early[camera.early_count++] = (struct pending){number, victim};
        return;
    }
    for (size_t i = 0; i < camera.pending_count; i++) {
        if (camera.pending[i].number != victim) continue;
        forget(camera.pending, &camera.pending_count, i);
        status = -ECONNRESET;
        break;
    }
    reply_unlink(number, status);
}

/* Whether the frame under way is one that has the fault. */
static bool hit(int32_t by)
{
    return fault() == by && camera.number % (by == CORRUPT ? 3 : 4) == 0;
}

/* Begin the next frame when it is due. */
static bool begin_frame(void)
{
    const int64_t now_ns = tool_now_ns();
    if (now_ns < camera.due_ns) return false;
    if (!tool_pace_ready(&camera.pace)) {
        camera.due_ns = now_ns + 10000000;
        return false;
    }
    if (now_ns - camera.due_ns > 500000000) camera.due_ns = now_ns;
    camera.due_ns += camera.pace.file == NULL ? camera.interval * INT64_C(100) : 0;
    camera.number++;
    if (hit(DROP)) return false;
    const struct tool_frames *frames = &offer(camera.commit)->frames;
    const size_t length = frames->length[(size_t)(camera.number - 1) % frames->count];
    camera.total = hit(TRUNCATE) ? length / 2 : length;
    camera.sent = 0;
    camera.toggle ^= 1;
    camera.in_frame = true;
    return true;
}

/* One payload into the first waiting transfer. */
static void send_payload(void)
{
    static uint8_t payload[PAYLOAD_MAX];
    const struct tool_frames *frames = &offer(camera.commit)->frames;
    const size_t index = (size_t)(camera.number - 1) % frames->count;
    const size_t room =
        (camera.pending[0].bytes < PAYLOAD_MAX ? camera.pending[0].bytes : PAYLOAD_MAX) - 2;
    const size_t left = camera.total - camera.sent, bytes = left < room ? left : room;
    const bool last = bytes == left;
    payload[0] = 2;
    payload[1] = (uint8_t)(0x80 | camera.toggle | (last ? 2 : 0) | (hit(MARK) ? 0x40 : 0));
    memcpy(payload + 2, frames->data + frames->at[index] + camera.sent, bytes);
    if (hit(CORRUPT) && bytes > 64) memset(payload + 2 + bytes / 2, 0xff, 24);
    camera.sent += bytes;
    const uint32_t number = camera.pending[0].number;
    forget(camera.pending, &camera.pending_count, 0);
    reply(number, 0, payload, bytes + 2, 0);
    if (last) camera.in_frame = false;
    if (last && camera.number == camera.leaves) exit(0);
}

static void serve(void)
{
    for (;;) {
        const bool can = camera.streaming && camera.pending_count > 0;
        const int64_t wait_ns = camera.due_ns - tool_now_ns();
        const int wait_ms = !can                              ? -1
                            : camera.in_frame || wait_ns <= 0 ? 0
                                                              : (int)((wait_ns + 999999) / 1000000);
        struct pollfd ready = {.fd = camera.socket, .events = POLLIN};
        if (poll(&ready, 1, wait_ms) > 0) {
            struct packet packet;
            receive(&packet, sizeof packet);
            if (ntohl(packet.command) == SUBMIT) submit(&packet);
            if (ntohl(packet.command) == UNLINK) take_back(&packet);
        } else if (can && (camera.in_frame || begin_frame())) {
            send_payload();
        }
    }
}

/* ---- set-up ---------------------------------------------------------------------------------- */

static void read_option(const char *text)
{
    if (strncmp(text, "port=", 5) == 0)
        camera.port = atol(text + 5);
    else if (strncmp(text, "after=", 6) == 0)
        camera.pace.file = text + 6;
    else if (strncmp(text, "leaves=", 7) == 0)
        camera.leaves = atol(text + 7);
    else if (strncmp(text, "waits=", 6) == 0)
        camera.waits = atol(text + 6);
    else if (strncmp(text, "serial=", 7) == 0 && strlen(text) < 60)
        camera.serial = text + 7;
    else
        tool_fail("usb: unknown option '%s'", text);
}

/* The frames of a format; a '%' in the file's name stands for the format's. */
static void add_offer(const char *name, const char *file)
{
    char path[512];
    const char *sign = strchr(file, '%');
    struct offer *each = &camera.offers[camera.offer_count++];
    if (sign == NULL)
        snprintf(path, sizeof path, "%s", file);
    else
        snprintf(path, sizeof path, "%.*s%s%s", (int)(sign - file), file, name, sign + 1);
    each->format = tool_format(name);
    const size_t raw = tool_frame_bytes(each->format, camera.width, camera.height);
    tool_frames_read(&each->frames, path, raw);
    each->frame_bytes =
        (uint32_t)(raw > 0 ? raw : (size_t)camera.width * (size_t)camera.height * 2);
}

static void attach(void)
{
    int pair[2];
    char line[64];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0)
        tool_fail("socketpair: %s", strerror(errno));
    camera.socket = pair[0];
    const int file = open("/sys/devices/platform/vhci_hcd.0/attach", O_WRONLY);
    const int length =
        snprintf(line, sizeof line, "%ld %d %ld 3", camera.port, pair[1], 65537 + camera.port);
    if (file < 0 || write(file, line, (size_t)length) != length)
        tool_fail("attach: %s", strerror(errno));
    close(file);
    close(pair[1]);
}

int tool_usb(int argc, char **argv)
{
    if (argc < 6) tool_fail("usage: usb FORMAT[,FORMAT...] WIDTH HEIGHT FILE RATE [NAME=VALUE...]");
    camera.width = atoi(argv[2]);
    camera.height = atoi(argv[3]);
    camera.interval = (uint32_t)(1e7 / atof(argv[5]));
    camera.serial = "FOVEA0001";
    for (char *name = strtok(argv[1], ","); name != NULL && camera.offer_count < FORMATS_MAX;
         name = strtok(NULL, ","))
        add_offer(name, argv[4]);
    for (int i = 6; i < argc; i++)
        read_option(argv[i]);
    describe();
    fix_probe(camera.probe);
    fix_probe(camera.commit);
    attach();
    serve();
    return 0;
}
