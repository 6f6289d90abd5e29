/* Listen to Fovea's messages: print each, and at the end how many came on each channel and whether
 * any is missing.
 *
 *     subscribe [--url URL] [--prefix FOVEA] [--idle SECONDS] [--quiet]
 *
 * Ends on SIGINT, or when nothing has come for --idle seconds. `make build/subscribe` builds it;
 * elsewhere, in a folder of its own: lcm-gen -c PREFIX/share/fovea/lcmtypes/[bf]*.lcm && cc -o
 * subscribe *.c -llcm
 *
 * Nothing may be lost between the network and this program, so two buffers must be large enough:
 *  - the socket's: recv_buf_size in the URL; the kernel allows net.core.rmem_max (sysctl), often
 *    only 208
 * KiB, which holds about ten messages of 1,000 features;
 *  - LCM's queue of each subscription: 30 messages unless set.
 * The decoders that lcm-gen makes hold lengths against the message, but a count above 2^28
 * overflows in them: listen where you trust those who send.
 *
 * This program receives through liblcm, whose check of fragments overflows in 32 bits (Debian's
 * 1.3.1, and 1.4.0 to 1.5.2): two packets of 100 bytes from anybody who reaches the port end it. On
 * a robot's network keep it behind the firewall rule of docs/security.md. */
#include <inttypes.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <lcm/lcm.h>

#include "bot_core_pose_t.h"
#include "fovea_camera_status_t.h"
#include "fovea_detections_t.h"
#include "fovea_features_t.h"
#include "fovea_map_t.h"
#include "fovea_objects_t.h"
#include "fovea_pose_t.h"
#include "fovea_preview_t.h"
#include "fovea_run_t.h"
#include "fovea_statistics_t.h"

enum { QUEUE_MESSAGES = 1000, KINDS = 11 };

static volatile sig_atomic_t stop;

/* What came on one channel. Gaps are counted by the frame number, where the message has one per
 * frame. */
struct channel {
    const char *suffix;
    uint64_t messages, bytes, gaps, malformed;
    int64_t first, last; /* frame numbers */
};
static struct channel channels[KINDS] = {
    {.suffix = "POSE"},          {.suffix = "FEATURES"}, {.suffix = "CAMERA_STATUS"},
    {.suffix = "STATISTICS"},    {.suffix = "PREVIEW"},  {.suffix = "CAMERA_POSE"},
    {.suffix = "BOT_CORE_POSE"}, {.suffix = "MAP"},      {.suffix = "DETECTIONS"},
    {.suffix = "OBJECTS"},       {.suffix = "RUN"}};
static bool quiet;

static void on_signal(int number)
{
    (void)number;
    stop = 1;
}

static void count(struct channel *channel, const lcm_recv_buf_t *received, int64_t sequence)
{
    if (channel->messages == 0)
        channel->first = sequence;
    else if (sequence > channel->last + 1)
        channel->gaps += (uint64_t)(sequence - channel->last - 1);
    channel->last = sequence;
    channel->messages++;
    channel->bytes += received->data_size;
}

static void print_stamp(const char *name, const fovea_stamp_t *stamp)
{
    printf("%s: frame %" PRId64 " at %.6f s: ", name, stamp->sequence,
           (double)stamp->time_ns * 1e-9);
}

/* One handler per type: decode, count, print, give back what decoding allocated. */
#define HANDLER(TYPE, ...)                                                                         \
    static void on_##TYPE(const lcm_recv_buf_t *received, const char *name, void *context)         \
    {                                                                                              \
        fovea_##TYPE message;                                                                      \
        struct channel *channel = context;                                                         \
        memset(&message, 0, sizeof message);                                                       \
        if (fovea_##TYPE##_decode(received->data, 0, (int)received->data_size, &message) < 0) {    \
            channel->malformed++;                                                                  \
            return;                                                                                \
        }                                                                                          \
        count(channel, received, message.stamp.sequence);                                          \
        if (!quiet) {                                                                              \
            print_stamp(name, &message.stamp);                                                     \
            printf(__VA_ARGS__);                                                                   \
        }                                                                                          \
        fovea_##TYPE##_decode_cleanup(&message);                                                   \
    }
static const char *name_of(const char *const *names, int count, int value)
{
    return value >= 0 && value < count ? names[value] : "unknown";
}
static const char *const states[] = {"starting", "tracking", "weak", "lost", "paused", "coasting"};
static const char *const scales[] = {"free", "initialising", "metric"};
HANDLER(
    pose_t,
    "%s, %s in %s: position %.3f %.3f %.3f %s, scale %s to %.1f %%, quality %.2f, %d inliers, map %d, reset %d\n",
    name_of(states, 6, message.state), message.child_frame, message.parent_frame,
    message.position[0], message.position[1], message.position[2],
    message.scale_state == FOVEA_POSE_T_SCALE_METRIC ? "m" : "units",
    name_of(scales, 3, message.scale_state), 100 * message.scale_sigma, (double)message.quality,
    (int)message.inliers, (int)message.map_id, (int)message.reset_counter)
HANDLER(features_t, "%" PRId32 " of %" PRId32 " features\n", message.count, message.asked)
HANDLER(camera_status_t, "state %d, %" PRId32 " x %" PRId32 " %s, %" PRId64 " dropped\n",
        message.state, message.width, message.height, message.pixel_format, message.dropped)
HANDLER(statistics_t, "%" PRId64 " frames in, %" PRId64 " processed, latency %.2f ms, %s kernels\n",
        message.frames_in, message.frames_processed, (double)message.latency_ns * 1e-6,
        message.kernel_set)
HANDLER(preview_t, "%" PRId32 " x %" PRId32 ", %" PRId32 " bytes of JPEG\n", message.width,
        message.height, message.size_bytes)
HANDLER(map_t, "map %" PRId32 ", %" PRId32 " landmarks and %" PRId32 " keyframes listed\n",
        message.map_id, message.landmark_count, message.keyframe_count)
HANDLER(detections_t, "%" PRId32 " objects found by %s, the best %s with %.2f\n", message.count,
        message.model, message.count > 0 ? message.detections[0].class_name : "none",
        message.count > 0 ? (double)message.detections[0].score : 0)
HANDLER(objects_t, "%" PRId32 " objects, the newest %" PRId64 "\n", message.count,
        message.count > 0 ? message.objects[message.count - 1].id : 0)

/* Who sends: printed when it changes, which is a restart or a second sender. */
static void on_run(const lcm_recv_buf_t *received, const char *name, void *context)
{
    static int64_t last_id;
    fovea_run_t message;
    struct channel *channel = context;
    if (fovea_run_t_decode(received->data, 0, (int)received->data_size, &message) < 0) {
        channel->malformed++;
        return;
    }
    count(channel, received, channel->last + 1);
    if (message.run_id != last_id)
        printf("%s: run %016" PRIx64 " of process %" PRId64 " on %s, Fovea %s%s\n", name,
               (uint64_t)message.run_id, message.process, message.host, message.version,
               last_id != 0 ? ": a restart, or another sender" : "");
    last_id = message.run_id;
    fovea_run_t_decode_cleanup(&message);
}

/* This one knows its time, but not the number of its frame. */
static void on_bot_core_pose(const lcm_recv_buf_t *received, const char *name, void *context)
{
    bot_core_pose_t message;
    struct channel *channel = context;
    if (bot_core_pose_t_decode(received->data, 0, (int)received->data_size, &message) < 0) {
        channel->malformed++;
        return;
    }
    count(channel, received, channel->last + 1);
    if (!quiet)
        printf("%s: at %.6f s: position %.3f %.3f %.3f m, velocity %.3f %.3f %.3f m/s\n", name,
               (double)message.utime * 1e-6, message.pos[0], message.pos[1], message.pos[2],
               message.vel[0], message.vel[1], message.vel[2]);
}

/* To LCM the channel to listen to is a regular expression, in which the dot that a prefix may hold
 * is any letter. */
static void write_pattern(const char *prefix, const char *suffix, char *pattern, size_t bytes)
{
    size_t used = 0;
    for (; *prefix != '\0' && used + 2 < bytes; prefix++) {
        if (*prefix == '.') pattern[used++] = '\\';
        pattern[used++] = *prefix;
    }
    snprintf(pattern + used, bytes - used, "_%s", suffix);
}

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Until asked to stop, or nothing has come for `idle_s` (0: for ever). */
static void listen_to(lcm_t *lcm, double idle_s)
{
    double last_s = now_s();
    while (!stop && (idle_s == 0 || now_s() - last_s < idle_s))
        if (lcm_handle_timeout(lcm, 100) > 0) last_s = now_s();
}

static int report(void)
{
    for (int i = 0; i < KINDS; i++) {
        const struct channel *c = &channels[i];
        if (c->messages > 0 || c->malformed > 0)
            printf("%s %" PRIu64 " messages, %" PRIu64 " bytes, frames %" PRId64 " to %" PRId64
                   ", %" PRIu64 " malformed\n",
                   c->suffix, c->messages, c->bytes, c->first, c->last, c->malformed);
    }
    /* Features and camera status come with every frame unless decimated; then gaps are no loss. */
    if (channels[1].messages > 0) printf("missing %" PRIu64 "\n", channels[1].gaps);
    return channels[1].gaps > 0 ? 1 : 0;
}

int main(int argc, char **argv)
{
    const char *url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=8388608", *prefix = "FOVEA";
    static const lcm_msg_handler_t handlers[KINDS] = {
        on_pose_t, on_features_t,    on_camera_status_t, on_statistics_t, on_preview_t,
        on_pose_t, on_bot_core_pose, on_map_t,           on_detections_t, on_objects_t,
        on_run};
    double idle_s = 0;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--quiet") == 0)
            quiet = true;
        else if (i + 1 < argc && strcmp(argv[i], "--url") == 0)
            url = argv[++i];
        else if (i + 1 < argc && strcmp(argv[i], "--prefix") == 0)
            prefix = argv[++i];
        else if (i + 1 < argc && strcmp(argv[i], "--idle") == 0)
            idle_s = atof(argv[++i]);
        else
            return fprintf(
                       stderr,
                       "usage: subscribe [--url URL] [--prefix FOVEA] [--idle SECONDS] [--quiet]\n"),
                   2;
    }
    lcm_t *lcm = lcm_create(url);
    if (lcm == NULL) return fprintf(stderr, "subscribe: %s: LCM cannot use this URL\n", url), 1;
    for (int i = 0; i < KINDS; i++) {
        char pattern[128];
        write_pattern(prefix, channels[i].suffix, pattern, sizeof pattern);
        lcm_subscription_t *subscription = lcm_subscribe(lcm, pattern, handlers[i], &channels[i]);
        if (subscription == NULL)
            return fprintf(stderr,
                           "subscribe: %s: cannot listen; 'fovea check' says what is missing\n",
                           url),
                   1;
        lcm_subscription_set_queue_capacity(subscription, QUEUE_MESSAGES);
    }
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    printf("listening\n");
    fflush(stdout);
    listen_to(lcm, idle_s);
    lcm_destroy(lcm);
    return report();
}
