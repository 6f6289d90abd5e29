/* hil-tool read URI [NAME=VALUE...]
 * Frames of a source, with a line for each change of its state and for each
 * complaint, and a last line of counts.
 *
 *   frames=N     end after N frames (default 20)
 *   seconds=S    fail when that takes longer (default 120)
 *   expect=FILE  every frame must be one of those in FILE, bit for bit
 *   held=MS      hold each frame for so long before it is compared
 *   run=COMMAND  run it after five frames, and go on
 *   says=WORDS   go on until some complaint holds these words
 *   damaged=N dropped=N recovered=N   go on until these counts are reached
 *   until=STATE  end when the source is in this state instead
 *   times=N unplug=COMMAND plug=COMMAND
 *                N times: unplug, wait for `gone`, plug, wait for a frame; 99 %
 *                within a second of COMMAND's end, without the time in which
 *                an emulated machine stood still; then descriptors, mappings,
 *                processes and heap must be as at the beginning
 *   pace=FILE    make FILE grow with each frame, for a writer that waits for it
 *   heap_count=FILE  heap calls per frame of another process too (count_heap.c)
 *   open=fails   opening must fail; the line is printed
 */
#include "tool.h"

#include <dirent.h>
#include <malloc.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/heap_calls.h"
#include "drivers/table.h"
#include "fovea/source.h"

/* ---- heap calls, of this thread and of all --------------------------------------------------- */

static atomic_ulong heap_calls;
static _Thread_local unsigned long heap_calls_here;

static void on_heap_call(void)
{
    heap_calls_here++;
    atomic_fetch_add_explicit(&heap_calls, 1, memory_order_relaxed);
}

static void on_heap_free(void)
{
}

/* ---- what is read ---------------------------------------------------------------------------- */

static const char *const state_names[] = {"ok", "late", "stalled", "gone", "returning", "ended"};

static struct reading {
    const char *uri, *expect, *until, *unplug, *plug, *open, *run, *says, *pace, *heap_count;
    long frames, seconds, times, held, damaged, dropped, recovered;

    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct tool_frames expected;
    size_t frame_bytes;
    uint8_t *compact;
    int64_t begin_ns;
    enum fovea_source_state state;
    long taken, exact;
    uint64_t last_sequence;
    int64_t last_stamp_ns, longest_wait_ns;
    bool backward, said;
} reading = {.frames = 20, .seconds = 120};

static double since(void)
{
    return (double)(tool_now_ns() - reading.begin_ns) * 1e-9;
}

static void look(void)
{
    struct fovea_error line;
    const enum fovea_source_state state =
        reading.ops->state != NULL ? reading.ops->state(reading.source) : FOVEA_SOURCE_OK;
    if (state != reading.state) printf("%.3f state %s\n", since(), state_names[state]);
    reading.state = state;
    while (reading.ops->complaint(reading.source, &line) == FOVEA_OK) {
        printf("%.3f says %s\n", since(), line.text);
        if (reading.says != NULL && strstr(line.text, reading.says) != NULL) reading.said = true;
    }
}

/* ---- comparing ------------------------------------------------------------------------------- */

static void copy_rows(uint8_t **to, const uint8_t *from, size_t row_bytes, ptrdiff_t stride,
                      int32_t rows)
{
    for (int32_t y = 0; y < rows; y++, *to += row_bytes)
        memcpy(*to, from + y * stride, row_bytes);
}

/* The picture without padding. */
static void compact(const struct fovea_image *image)
{
    uint8_t *to = reading.compact;
    const size_t row = (size_t)fovea_image_stride_min(image->format, image->width);
    const uint8_t *chroma = image->data + (ptrdiff_t)image->height * image->stride_bytes;
    copy_rows(&to, image->data, row, image->stride_bytes, image->height);
    if (image->format == FOVEA_PIXEL_NV12)
        copy_rows(&to, chroma, row, image->stride_bytes, image->height / 2);
    if (image->format == FOVEA_PIXEL_YU12)
        copy_rows(&to, chroma, row / 2, image->stride_bytes / 2, image->height);
}

static void compare(const struct fovea_image *image)
{
    compact(image);
    for (size_t i = 0; i < reading.expected.count; i++)
        if (memcmp(reading.expected.data + reading.expected.at[i], reading.compact,
                   reading.frame_bytes) == 0) {
            reading.exact++;
            return;
        }
    printf("%.3f frame %ld is none of those expected\n", since(), reading.taken);
}

static bool take(int64_t deadline_ns)
{
    struct fovea_frame frame;
    const int64_t before_ns = tool_now_ns();
    const enum fovea_status status = reading.ops->dequeue(reading.source, deadline_ns, &frame);
    const int64_t waited_ns = tool_now_ns() - (deadline_ns > before_ns ? deadline_ns : before_ns);
    if (waited_ns > reading.longest_wait_ns) reading.longest_wait_ns = waited_ns;
    look();
    if (status < 0) tool_fail("dequeue: %s", fovea_status_name(status));
    if (status != FOVEA_OK) return false;
    if (reading.taken == 0)
        printf(
            "%.3f first frame: %d x %d %s, clock %d, meaning %d, exposure %.4f ms, age %.1f ms\n",
            since(), frame.images[0].width, frame.images[0].height,
            fovea_pixel_format_name(frame.images[0].format), frame.clock, frame.stamp_meaning,
            (double)frame.exposure_ns[0] * 1e-6, (double)(tool_now_ns() - frame.stamp_ns) * 1e-6);
    if (reading.taken > 0 &&
        (frame.stamp_ns <= reading.last_stamp_ns || frame.sequence <= reading.last_sequence))
        reading.backward = true;
    reading.last_stamp_ns = frame.stamp_ns;
    reading.last_sequence = frame.sequence;
    reading.taken++;
    if (reading.held != 0) tool_sleep_until(tool_now_ns() + reading.held * 1000000);
    if (reading.expect != NULL) compare(&frame.images[0]);
    reading.ops->requeue(reading.source, &frame);
    if (reading.pace != NULL) tool_pace_on(reading.pace);
    return true;
}

static bool in_time(void)
{
    return since() < (double)reading.seconds;
}

static void take_some(long count)
{
    for (const long end = reading.taken + count; reading.taken < end && in_time();)
        take(tool_now_ns() + 50000000);
}

static void run(const char *command)
{
    if (system(command) != 0) tool_fail("'%s' failed", command);
}

/* The counts asked for have been reached, and the words have been said. */
static bool reported_enough(void)
{
    struct fovea_source_counts counts;
    reading.ops->counts(reading.source, &counts);
    return (reading.says == NULL || reading.said) && (long)counts.damaged >= reading.damaged &&
           (long)counts.dropped >= reading.dropped && (long)counts.recovered >= reading.recovered;
}

/* Of the other process, since it began. */
static unsigned long heap_calls_there(void)
{
    unsigned long calls = 0;
    FILE *file = reading.heap_count == NULL ? NULL : fopen(reading.heap_count, "rb");
    if (file == NULL) return 0;
    if (fread(&calls, sizeof calls, 1, file) != 1)
        tool_fail("%s: cannot be read", reading.heap_count);
    fclose(file);
    return calls;
}

static void take_all(void)
{
    const long first = reading.frames < 5 ? reading.frames : 5;
    take_some(first);
    if (reading.run != NULL) run(reading.run);
    const unsigned long there_before = heap_calls_there();
    const unsigned long all_before = atomic_load(&heap_calls), here_before = heap_calls_here;
    const long taken = reading.taken;
    take_some(reading.frames - first);
    if (reading.taken > taken) {
        const double frames = (double)(reading.taken - taken);
        printf("heap calls per frame: loop thread %.1f, all threads %.1f\n",
               (double)(heap_calls_here - here_before) / frames,
               (double)(atomic_load(&heap_calls) - all_before) / frames);
        if (reading.heap_count != NULL)
            printf("heap calls per frame: other process %.1f\n",
                   (double)(heap_calls_there() - there_before) / frames);
    }
    while (!reported_enough() && in_time())
        take(tool_now_ns() + 50000000);
}

static bool reach(enum fovea_source_state state)
{
    while (reading.state != state && in_time()) {
        if (!take(tool_now_ns() + 5000000) && reading.state == FOVEA_SOURCE_GONE)
            tool_sleep_until(tool_now_ns() + 1000000);
    }
    return reading.state == state;
}

/* ---- what the process holds ------------------------------------------------------------------ */

struct holdings {
    long descriptors, mappings, processes;
    size_t heap_bytes;
};

/* Children of this process, running or waiting to be reaped. */
static long count_processes(void)
{
    long count = 0;
    char path[300];
    DIR *folder = opendir("/proc/self/task");
    for (const struct dirent *entry; folder != NULL && (entry = readdir(folder)) != NULL;) {
        snprintf(path, sizeof path, "/proc/self/task/%s/children", entry->d_name);
        FILE *file = fopen(path, "r");
        for (int pid; file != NULL && fscanf(file, "%d", &pid) == 1;)
            count++;
        if (file != NULL) fclose(file);
    }
    if (folder != NULL) closedir(folder);
    return count;
}

static struct holdings count_holdings(void)
{
    struct holdings holdings = {0, 0, count_processes(), mallinfo2().uordblks + mallinfo2().hblkhd};
    DIR *folder = opendir("/proc/self/fd");
    while (folder != NULL && readdir(folder) != NULL)
        holdings.descriptors++;
    closedir(folder);
    FILE *maps = fopen("/proc/self/maps", "r");
    for (char line[512]; maps != NULL && fgets(line, sizeof line, maps) != NULL;)
        if (strstr(line, "/dev/video") != NULL || strstr(line, "dmabuf") != NULL)
            holdings.mappings++;
    if (maps != NULL) fclose(maps);
    return holdings;
}

/* A thread that only sleeps sees when the machine stood still: it wakes late by as much. */
static _Atomic int64_t stood_still_ns;

static void *watch_machine(void *unused)
{
    enum { NAP_NS = 5000000, USUAL_NS = 1000000 };
    (void)unused;
    for (;;) {
        const int64_t wake_ns = tool_now_ns() + NAP_NS;
        tool_sleep_until(wake_ns);
        const int64_t late_ns = tool_now_ns() - wake_ns;
        if (late_ns > USUAL_NS) atomic_fetch_add(&stood_still_ns, late_ns);
    }
    return NULL;
}

static int ascending(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

/* Once through, the first rounds only to let libraries set themselves up. */
static bool unplug_times(void)
{
    int64_t *took_ns = calloc((size_t)reading.times, sizeof *took_ns);
    long late = 0, round = 0;
    pthread_t watcher;
    if (pthread_create(&watcher, NULL, watch_machine, NULL) != 0) tool_fail("no thread");
    struct holdings before = count_holdings(); /* what counting itself keeps is there from now on */
    take_some(3);
    for (; round < reading.times && in_time(); round++) {
        if (round == 2) before = count_holdings();
        run(reading.unplug);
        if (!reach(FOVEA_SOURCE_GONE)) tool_fail("not gone after unplugging");
        run(reading.plug);
        const int64_t begin_ns = tool_now_ns(), still_ns = atomic_load(&stood_still_ns);
        const long taken = reading.taken;
        while (reading.taken == taken && in_time())
            take(tool_now_ns() + 1000000);
        const int64_t elapsed_ns = tool_now_ns() - begin_ns;
        took_ns[round] = elapsed_ns - (atomic_load(&stood_still_ns) - still_ns);
        printf("%.3f back after %.3f s, %.3f s of it the machine stood still\n", since(),
               (double)elapsed_ns * 1e-9, (double)(elapsed_ns - took_ns[round]) * 1e-9);
        late += took_ns[round] > 1000000000;
        take_some(2);
    }
    const struct holdings after = count_holdings();
    qsort(took_ns, (size_t)round, sizeof *took_ns, ascending);
    printf(
        "unplugged %ld times: frames again after %.3f s (median), %.3f s (worst), %ld later than 1 s\n",
        round, (double)took_ns[round / 2] * 1e-9, (double)took_ns[round - 1] * 1e-9, late);
    printf(
        "descriptors %ld then %ld, mappings %ld then %ld, processes %ld then %ld, heap %zu then %zu bytes\n",
        before.descriptors, after.descriptors, before.mappings, after.mappings, before.processes,
        after.processes, before.heap_bytes, after.heap_bytes);
    free(took_ns);
    return round == reading.times && late * 100 <= reading.times &&
           before.descriptors == after.descriptors && before.mappings == after.mappings &&
           before.processes == after.processes && before.heap_bytes == after.heap_bytes;
}

/* ---- the command ----------------------------------------------------------------------------- */

static void read_option(const char *text)
{
    const struct {
        const char *name, **word;
        long *number;
    } options[] = {
        {"frames=", NULL, &reading.frames},   {"seconds=", NULL, &reading.seconds},
        {"times=", NULL, &reading.times},     {"held=", NULL, &reading.held},
        {"expect=", &reading.expect, NULL},   {"until=", &reading.until, NULL},
        {"unplug=", &reading.unplug, NULL},   {"plug=", &reading.plug, NULL},
        {"open=", &reading.open, NULL},       {"run=", &reading.run, NULL},
        {"says=", &reading.says, NULL},       {"damaged=", NULL, &reading.damaged},
        {"dropped=", NULL, &reading.dropped}, {"recovered=", NULL, &reading.recovered},
        {"pace=", &reading.pace, NULL},       {"heap_count=", &reading.heap_count, NULL}};
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
        const size_t length = strlen(options[i].name);
        if (strncmp(text, options[i].name, length) != 0) continue;
        if (options[i].word != NULL) *options[i].word = text + length;
        if (options[i].number != NULL) *options[i].number = atol(text + length);
        return;
    }
    tool_fail("read: unknown option '%s'", text);
}

static enum fovea_status open_source(void)
{
    static const struct fovea_source_selection selection = {.step = 1};
    const char *address;
    struct fovea_error error = {.text = ""};
    enum fovea_status status = fv_source_find(reading.uri, &reading.ops, &address, &error);
    if (status == FOVEA_OK)
        status = reading.ops->open(address, &selection, &reading.source, &error);
    if (status == FOVEA_OK) status = reading.ops->start(reading.source, &error);
    if (status != FOVEA_OK) printf("refused: %s\n", error.text);
    return status;
}

static enum fovea_source_state state_by_name(const char *name)
{
    for (int i = 0; i < 6; i++)
        if (strcmp(state_names[i], name) == 0) return (enum fovea_source_state)i;
    tool_fail("unknown state '%s'", name);
}

int tool_read(int argc, char **argv)
{
    if (argc < 2) tool_fail("usage: read URI [NAME=VALUE...]");
    reading.uri = argv[1];
    reading.begin_ns = tool_now_ns();
    for (int i = 2; i < argc; i++)
        read_option(argv[i]);
    const enum fovea_status status = open_source();
    if (reading.open != NULL) return status == FOVEA_OK;
    if (status != FOVEA_OK) return 1;
    const struct fovea_source_info *info = reading.ops->info(reading.source);
    reading.frame_bytes =
        fovea_image_bytes(info->format, info->cameras[0].height,
                          fovea_image_stride_min(info->format, info->cameras[0].width));
    reading.compact = malloc(reading.frame_bytes);
    if (reading.expect != NULL)
        tool_frames_read(&reading.expected, reading.expect, reading.frame_bytes);
    printf("open: %d x %d %s at %.2f Hz\n", info->cameras[0].width, info->cameras[0].height,
           fovea_pixel_format_name(info->format), info->rate_hz);
    look();
    bool good = true;
    if (reading.times > 0)
        good = unplug_times();
    else if (reading.until != NULL)
        good = reach(state_by_name(reading.until));
    else
        take_all();
    if (reading.times == 0 && !reported_enough()) good = false;
    struct fovea_source_counts counts;
    reading.ops->counts(reading.source, &counts);
    printf(
        "%.3f end: state %s, delivered %llu, damaged %llu, dropped %llu, recovered %llu, exact %ld, longest wait past a deadline %.1f ms\n",
        since(), state_names[reading.state], (unsigned long long)counts.delivered,
        (unsigned long long)counts.damaged, (unsigned long long)counts.dropped,
        (unsigned long long)counts.recovered, reading.exact,
        (double)reading.longest_wait_ns * 1e-6);
    reading.ops->stop(reading.source);
    reading.ops->close(reading.source);
    if (reading.times == 0 && reading.until == NULL && reading.taken < reading.frames) good = false;
    if (reading.expect != NULL && reading.exact < reading.taken) good = false;
    if (reading.backward) printf("stamps or numbers went back\n");
    return good && !reading.backward ? 0 : 1;
}
