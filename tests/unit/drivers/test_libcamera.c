/* The runtime's side of libcamera (drivers/libcamera/client.c) on a process of the tests' own,
 * which is this program under another name: frames through descriptors, and whatever a process can
 * do wrong. libcamera itself is tested in the virtual machine (tests/hil). `test_libcamera N` lets
 * the process end N times in a row (default 20). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../../../drivers/libcamera/client.h"
#include "common/fake_libcamera.h"
#include "common/live_source.h"

#define WAIT_NS INT64_C(60000000000) /* for what comes sooner unless others take the processor */

static long times = 20;
static const int64_t usual_ns = 30000000000,
                     patience_ns = 1500000000; /* for an answer; where none comes */
static struct fake_stage *stage;
static const struct fovea_source_ops *const ops = &fv_source_libcamera;

/* A test begins with what is usual. One that failed may have left processes: they would do what the
 * next test asks of its own. */
static int begin(void **state)
{
    (void)state;
    static int64_t idle_ns, away_ns, end_ns;
    if (idle_ns == 0) {
        idle_ns = fv_libcamera_idle_ns;
        away_ns = fv_libcamera_away_ns;
        end_ns = fv_libcamera_patience_ns;
    }
    fake_libcamera_end_all();
    fv_libcamera_answer_ns = usual_ns;
    fv_libcamera_idle_ns = idle_ns;
    fv_libcamera_away_ns = away_ns;
    fv_libcamera_patience_ns = end_ns;
    return 0;
}

static struct fovea_source *start_source_of(double rate_hz)
{
    static const struct fovea_source_selection everything = {.step = 1};
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    fake_stage_reset(stage);
    atomic_store(&stage->rate_hz, rate_hz);
    if (ops->open("0?rate=100", &everything, &source, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    return source;
}

/* Of a camera said to be so slow that no pause is too long for it, however busy the machine is. */
static struct fovea_source *start_source(void)
{
    return start_source_of(0.5);
}

/* How long a process has for what it does with this fault: one that ends by itself is waited for,
 * however busy the machine is; one that hangs is killed then. */
static void wait_for_end(enum fake_fault fault)
{
    const bool ends = fault == FAKE_ABORT || fault == FAKE_EXIT;
    fv_libcamera_patience_ns = ends ? usual_ns : patience_ns;
}

static void set_patience(enum fake_fault fault)
{
    fv_libcamera_answer_ns = fault == FAKE_HANG ? patience_ns : usual_ns;
    wait_for_end(fault);
}

/* What the loop does while something is waited for: a source whose frames nobody takes does not
 * look at its camera. */
static void take_any(struct fovea_source *source)
{
    struct fovea_frame frame;
    if (ops->dequeue(source, fv_test_now_ns() + 1000000, &frame) == FOVEA_OK)
        ops->requeue(source, &frame);
}

/* Lines go by until one holds these words. */
static void assert_reported(struct fovea_source *source, const char *words)
{
    struct fovea_error error;
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    while (fv_test_now_ns() < end_ns) {
        while (ops->complaint(source, &error) == FOVEA_OK)
            if (strstr(error.text, words) != NULL) return;
        take_any(source);
    }
    fail_msg("nothing was said of '%s'", words);
}

static void wait_for_life(struct fovea_source *source, uint32_t life)
{
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    while (atomic_load(&stage->lives) < life && fv_test_now_ns() < end_ns)
        take_any(source);
    assert_true(atomic_load(&stage->lives) >= life);
}

/* Frames from before are not what is waited for. */
static void wait_for_frame_of_set_up(struct fovea_source *source, uint32_t set_up)
{
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    do {
        fv_test_next_frame(source);
    } while (atomic_load(&stage->set_ups) < set_up && fv_test_now_ns() < end_ns);
    assert_true(atomic_load(&stage->set_ups) >= set_up);
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
}

static void wait_for_frame_of_life(struct fovea_source *source, uint32_t life)
{
    wait_for_life(source, life);
    wait_for_frame_of_set_up(source, life);
}

/* ---- frames ---------------------------------------------------------------------------------- */

static struct fovea_frame take(struct fovea_source *source)
{
    struct fovea_frame frame;
    assert_int_equal(ops->dequeue(source, fv_test_now_ns() + WAIT_NS, &frame), FOVEA_OK);
    return frame;
}

/* Frames that come before the answer are not lost, and a process that follows is set, too. */
static void test_set_while_streaming(void **state)
{
    (void)state;
    struct fovea_error said = {.text = ""};
    struct fovea_source *source = start_source();
    uint64_t last = take(source).sequence;
    fv_test_finish(source);
    source = start_source();
    atomic_store(&stage->before_answer, 2);
    for (int i = 0; i < 50; i++) {
        const struct fovea_frame frame = take(source);
        if (i > 0) assert_int_equal(frame.sequence, last + 1);
        last = frame.sequence;
        ops->requeue(source, &frame);
        if (i % 10 != 5) continue;
        assert_int_equal(ops->control(source, FOVEA_SOURCE_EXPOSURE, 5 + i, &said), FOVEA_OK);
        assert_int_equal(atomic_load(&stage->exposure_us), 5000 + 1000 * i);
    }
    assert_int_equal(ops->control(source, FOVEA_SOURCE_GAIN, 2.5, &said), FOVEA_OK);
    assert_int_equal(atomic_load(&stage->gain), 2500);
    atomic_store(&stage->refuses, true);
    assert_int_equal(ops->control(source, FOVEA_SOURCE_GAIN, 9, &said), FOVEA_ERROR_INPUT);
    assert_string_equal(said.text, "gain: found 9, expected [1, 8]");
    assert_int_equal(fv_test_counts(source).dropped, 0);
    atomic_store(&stage->gain, 0);
    atomic_store(&stage->fault, FAKE_ABORT);
    wait_for_frame_of_life(source, atomic_load(&stage->lives) + 1);
    assert_int_equal(atomic_load(&stage->gain), 2500);
    assert_int_equal(atomic_load(&stage->exposure_us), 50000);
    fv_test_finish(source);
}

/* Streaming that ends, and a process that ends, while the answer is waited for. */
static void test_fault_while_set(void **state)
{
    (void)state;
    struct fovea_error said = {.text = ""};
    for (int i = 0; i < 2; i++) {
        struct fovea_source *source = start_source();
        const struct fovea_frame frame = take(source);
        ops->requeue(source, &frame);
        atomic_store(&stage->fault_when_set, i == 0 ? FAKE_BROKEN : FAKE_EXIT);
        assert_true(ops->control(source, FOVEA_SOURCE_GAIN, 2, &said) < 0);
        wait_for_frame_of_life(source, 2);
        assert_int_equal(ops->control(source, FOVEA_SOURCE_GAIN, 3, &said), FOVEA_OK);
        fv_test_finish(source);
    }
}

static int ascending(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void test_frames_bit_for_bit(void **state)
{
    (void)state;
    enum { FRAMES = 200 };
    static int64_t took_ns[FRAMES];
    struct fovea_source *source = start_source();
    const struct fovea_source_info *info = ops->info(source);
    assert_int_equal(info->cameras[0].width, FAKE_WIDTH);
    assert_int_equal(info->cameras[0].height, FAKE_HEIGHT);
    assert_int_equal(info->format, FOVEA_PIXEL_GREY8);
    for (int i = 0; i < FRAMES; i++) {
        const struct fovea_frame frame = take(source);
        took_ns[i] = fv_test_now_ns() - frame.stamp_ns;
        assert_int_equal(frame.images[0].stride_bytes, FAKE_STRIDE);
        assert_int_equal(frame.stamp_meaning, FOVEA_STAMP_EXPOSURE_START);
        assert_int_equal(frame.clock, FOVEA_CLOCK_MONOTONIC);
        for (int32_t y = 0; y < FAKE_HEIGHT; y++)
            for (int32_t x = 0; x < FAKE_WIDTH; x++)
                if (frame.images[0].data[y * FAKE_STRIDE + x] != fake_pixel(frame.sequence, x, y))
                    fail_msg("frame %llu differs at %d, %d", (unsigned long long)frame.sequence, x,
                             y);
        ops->requeue(source, &frame);
    }
    qsort(took_ns, FRAMES, sizeof *took_ns, ascending);
    print_message("from the process to the loop: %.0f us (median), %.0f us (worst of %d)\n",
                  (double)took_ns[FRAMES / 2] * 1e-3, (double)took_ns[FRAMES - 1] * 1e-3, FRAMES);
    assert_int_equal(fv_test_counts(source).damaged, 0);
    fv_test_finish(source);
}

/* What the camera writes into a buffer that the loop holds is seen: it is the same memory. */
static void test_frames_are_not_copied(void **state)
{
    (void)state;
    struct fovea_source *source = start_source();
    const struct fovea_frame frame = take(source);
    const uint8_t before = frame.images[0].data[0];
    atomic_store(&stage->scribble, 1 + (before ^ 0xff));
    while (atomic_load(&stage->scribble) != 0)
        usleep(1000);
    assert_int_equal(frame.images[0].data[0], before ^ 0xff);
    ops->requeue(source, &frame);
    fv_test_finish(source);
}

static void test_frames_held_outlive_the_process(void **state)
{
    (void)state;
    struct fovea_source *source = start_source();
    const struct fovea_frame frame = take(source);
    kill(atomic_load(&stage->pid), SIGKILL);
    assert_reported(source, "signal 9");
    for (int32_t y = 0; y < FAKE_HEIGHT; y++)
        assert_int_equal(frame.images[0].data[y * FAKE_STRIDE + 7],
                         fake_pixel(frame.sequence, 7, y));
    ops->requeue(source, &frame);
    wait_for_frame_of_life(source, 2);
    fv_test_finish(source);
}

/* ---- faults ---------------------------------------------------------------------------------- */

static void test_faults_while_streaming(void **state)
{
    (void)state;
    static const struct {
        enum fake_fault fault;
        const char *says;
    } faults[] = {{FAKE_ABORT, "signal 6"},       {FAKE_EXIT, "ended with status 3"},
                  {FAKE_SHORT, "makes no sense"}, {FAKE_VERSION, "makes no sense"},
                  {FAKE_INDEX, "makes no sense"}, {FAKE_BROKEN, "it is on fire"},
                  {FAKE_HANG, "no frame for"},    {FAKE_DESCRIPTORS, "makes no sense"}};
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        const bool hangs = faults[i].fault == FAKE_HANG; /* of which pauses tell */
        struct fovea_source *source = hangs ? start_source_of(100) : start_source();
        fv_test_next_frame(source);
        wait_for_end(faults[i].fault);
        atomic_store(&stage->fault, faults[i].fault);
        assert_reported(source, faults[i].says);
        wait_for_frame_of_life(source, 2);
        if (!hangs) assert_int_equal(fv_test_counts(source).recovered, 1);
        fv_test_finish(source);
    }
}

static void test_faults_while_setting_up(void **state)
{
    (void)state;
    static const struct {
        enum fake_fault fault;
        const char *says;
    } faults[] = {{FAKE_ABORT, "signal 6"},
                  {FAKE_HANG, "does not answer"},
                  {FAKE_SHORT, "makes no sense"},
                  {FAKE_FEWER, "makes no sense"},
                  {FAKE_BROKEN, "it is on fire"}};
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        set_patience(faults[i].fault);
        struct fovea_source *source = start_source();
        fv_test_next_frame(source);
        atomic_store(&stage->fault_at_set_up, faults[i].fault);
        kill(atomic_load(&stage->pid), SIGKILL);
        assert_reported(source, faults[i].says);
        wait_for_frame_of_life(source, 3);
        assert_int_equal(fv_test_counts(source).recovered, 1);
        fv_test_finish(source);
    }
}

/* Aborting is how libcamera 0.0.3 may take an unplugged camera. */
static void test_unplugged(void **state)
{
    (void)state;
    for (int aborts = 0; aborts < 2; aborts++) {
        struct fovea_source *source = start_source();
        fv_test_next_frame(source);
        wait_for_end(aborts ? FAKE_ABORT : FAKE_NONE);
        atomic_store(&stage->away, true);
        if (aborts) atomic_store(&stage->fault, FAKE_ABORT);
        fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
        assert_reported(source, aborts ? "signal 6" : "is away");
        usleep(200000); /* looked for all the while, by one process */
        assert_int_equal(atomic_load(&stage->lives), 2);
        assert_int_equal(ops->state(source), FOVEA_SOURCE_GONE);
        atomic_store(&stage->away, false);
        wait_for_frame_of_life(source, 2);
        assert_int_equal(fv_test_counts(source).recovered, 1);
        fv_test_finish(source);
    }
}

/* The process that says that the camera is away missed how it came back: it is not believed for
 * ever. */
static void test_comes_back_unheard(void **state)
{
    (void)state;
    struct fovea_source *source = start_source();
    fv_libcamera_away_ns = 500000000;
    fv_test_next_frame(source);
    atomic_store(&stage->deaf, true);
    atomic_store(&stage->away, true);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    for (const int64_t end_ns = fv_test_now_ns() + WAIT_NS; atomic_load(&stage->missed) == 0;) {
        assert_true(fv_test_now_ns() < end_ns);
        take_any(source);
    }
    atomic_store(&stage->away, false);
    wait_for_life(source, 3);
    wait_for_frame_of_set_up(source, 2);
    assert_int_equal(fv_test_counts(source).recovered, 1);
    fv_test_finish(source);
}

/* One that has not ended when patience is over is no child for ever. */
static void test_reaped_later(void **state)
{
    (void)state;
    const int64_t kept_ns = fv_libcamera_patience_ns;
    struct fovea_source *source = start_source();
    fv_libcamera_patience_ns = 0;
    for (uint32_t life = 2; life < 6; life++) {
        fv_test_next_frame(source);
        atomic_store(&stage->fault, FAKE_BROKEN);
        wait_for_frame_of_life(source, life);
    }
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    while (fake_holdings().processes != 1 && fv_test_now_ns() < end_ns)
        take_any(source);
    assert_int_equal(fake_holdings().processes, 1);
    fv_libcamera_patience_ns = kept_ns;
    fv_test_finish(source);
    assert_int_equal(fake_holdings().processes, 0);
}

/* A process that does nothing at all is not waited for as long as one that works. */
static void test_hangs_or_works(void **state)
{
    (void)state;
    static const enum fake_fault faults[] = {FAKE_HANG, FAKE_BUSY};
    fv_libcamera_idle_ns = 1000000000;
    for (uint32_t i = 0; i < 2; i++) {
        struct fovea_source *source = start_source();
        fv_test_next_frame(source);
        atomic_store(&stage->fault_at_set_up, faults[i]);
        kill(atomic_load(&stage->pid), SIGKILL);
        if (faults[i] == FAKE_HANG) assert_reported(source, "does not answer"); /* within 60 s */
        wait_for_life(source, faults[i] == FAKE_HANG ? 3 : 2);
        wait_for_frame_of_life(source, 2);
        assert_int_equal(atomic_load(&stage->lives), faults[i] == FAKE_HANG ? 3 : 2);
        fv_test_finish(source);
    }
}

/* Whoever stops a source does not wait for a process that does not answer. */
static void test_stopped_while_it_hangs(void **state)
{
    (void)state;
    struct fovea_source *source = start_source();
    fv_test_next_frame(source);
    atomic_store(&stage->fault_at_set_up, FAKE_HANG);
    kill(atomic_load(&stage->pid), SIGKILL);
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    while (atomic_load(&stage->set_ups) < 2 && fv_test_now_ns() < end_ns)
        take_any(source);
    assert_int_equal(atomic_load(&stage->set_ups), 2);
    const int64_t begin_ns = fv_test_now_ns();
    fv_test_finish(source);
    assert_true(fv_test_now_ns() - begin_ns < usual_ns / 3);
    assert_int_equal(fake_holdings().processes, 0);
}

/* A source that was stopped while its process hung streams when it is started again. */
static void test_started_again_after_a_hang(void **state)
{
    (void)state;
    struct fovea_error error = {.text = ""};
    struct fovea_source *source = start_source();
    fv_test_next_frame(source);
    ops->stop(source);
    atomic_store(&stage->fault_at_set_up, FAKE_HANG);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    while (atomic_load(&stage->set_ups) < 2 && fv_test_now_ns() < end_ns)
        take_any(source);
    ops->stop(source);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    fv_test_next_frame(source);
    assert_int_equal(atomic_load(&stage->set_ups), 3);
    fv_test_finish(source);
}

/* It cannot be started for a while: reported, tried again with bounded back-off, and recovered. */
static void test_cannot_be_started(void **state)
{
    (void)state;
    struct fovea_source *source = start_source();
    fv_test_next_frame(source);
    fake_stage_hide(stage, true);
    kill(atomic_load(&stage->pid), SIGKILL);
    assert_reported(source, "found no plug-in fovea-libcamera");
    fv_test_wait_for_state(source, FOVEA_SOURCE_STALLED);
    fake_stage_hide(stage, false);
    wait_for_frame_of_life(source, 2);
    fv_test_finish(source);
}

static void test_refused_at_open(void **state)
{
    (void)state;
    static const struct fovea_source_selection everything = {.step = 1};
    static const struct {
        enum fake_fault fault;
        const char *says;
        unsigned lives; /* what is refused is refused; a process that is lost is replaced once */
    } faults[] = {{FAKE_BROKEN, "it is on fire", 1},
                  {FAKE_ABORT, "signal 6", 2},
                  {FAKE_HANG, "does not answer", 2}};
    struct fovea_source *source = NULL;
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        set_patience(faults[i].fault);
        struct fovea_error error = {.text = ""};
        fake_stage_reset(stage);
        atomic_store(&stage->stubborn, true);
        atomic_store(&stage->fault_at_learn, faults[i].fault);
        assert_true(ops->open("0", &everything, &source, &error) < 0);
        if (strstr(error.text, faults[i].says) == NULL) fail_msg("%s", error.text);
        assert_null(source);
        assert_int_equal(atomic_load(&stage->lives), faults[i].lives);
    }
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1); /* no process is left */
    assert_int_equal(errno, ECHILD);
}

/* A process that ends or hangs over the opening is named, and another opens the camera. */
static void test_fault_while_opening(void **state)
{
    (void)state;
    static const struct fovea_source_selection everything = {.step = 1};
    static const struct {
        enum fake_fault fault;
        const char *says;
    } faults[] = {
        {FAKE_ABORT, "signal 6"}, {FAKE_HANG, "does not answer"}, {FAKE_SHORT, "makes no sense"}};
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        set_patience(faults[i].fault);
        struct fovea_source *source = NULL;
        struct fovea_error error = {.text = ""};
        fake_stage_reset(stage);
        atomic_store(&stage->fault_at_learn, faults[i].fault);
        if (ops->open("0", &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
        assert_int_equal(ops->start(source, &error), FOVEA_OK);
        assert_reported(source, faults[i].says);
        fv_test_next_frame(source);
        assert_int_equal(atomic_load(&stage->lives), 2);
        fv_test_finish(source);
    }
}

/* ---- over and over --------------------------------------------------------------------------- */

static void test_ends_over_and_over(void **state)
{
    (void)state;
    static const enum fake_fault ways[] = {FAKE_ABORT, FAKE_EXIT, FAKE_BROKEN};
    int64_t *took_ns = calloc((size_t)times, sizeof *took_ns);
    struct fake_holdings before = {0};
    long late = 0;
    struct fovea_source *source = start_source();
    for (long i = 0; i < times; i++) {
        fv_test_next_frame(source);
        if (i == 2) before = fake_holdings();
        const int64_t begin_ns = fv_test_now_ns();
        atomic_store(&stage->fault, ways[i % 3]);
        wait_for_frame_of_life(source, (uint32_t)i + 2);
        took_ns[i] = fv_test_now_ns() - begin_ns;
        late += took_ns[i] > 1000000000;
    }
    const struct fake_holdings after = fake_holdings();
    qsort(took_ns, (size_t)times, sizeof *took_ns, ascending);
    print_message(
        "ended %ld times: frames again after %.3f s (median), %.3f s (worst), %ld later than 1 s\n",
        times, (double)took_ns[times / 2] * 1e-9, (double)took_ns[times - 1] * 1e-9, late);
    if (times >= 100) assert_true(late * 100 <= times); /* few say nothing of one in a hundred */
    assert_int_equal(before.descriptors, after.descriptors);
    assert_int_equal(before.buffers, after.buffers);
    assert_int_equal(before.processes, after.processes);
    assert_int_equal(after.processes, 1);
#ifndef FOVEA_SANITIZED
    assert_int_equal(before.heap_bytes, after.heap_bytes);
#endif
    assert_int_equal(fv_test_counts(source).recovered, times);
    fv_test_finish(source);
    assert_int_equal(fake_holdings().processes, 0);
    free(took_ns);
}

/* ---- scheduling ------------------------------------------------------------------------------ */

/* From here on this thread and what it starts may not change a scheduling policy, as under the
 * service. False: this kernel has no filters. */
static bool forbid_scheduling(void)
{
    static struct sock_filter rules[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_sched_setscheduler, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
    const struct sock_fprog filter = {sizeof rules / sizeof rules[0], rules};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

static void check_process_is_not_real_time(void)
{
    struct fovea_source *source = start_source();
    fv_test_next_frame(source);
    assert_int_equal(sched_getscheduler(atomic_load(&stage->pid)), SCHED_OTHER);
    fv_test_finish(source);
}

/* The process is not real-time where this one is: it is started so, or, where it would not be
 * real-time anyway, without a call for it. The last test: the filter stays. */
static void test_process_is_not_real_time(void **state)
{
    const struct sched_param lowest = {.sched_priority = 1};
    (void)state;
    if (sched_setscheduler(0, SCHED_FIFO, &lowest) != 0) {
        printf("SKIPPED scheduling: this process may not be real-time\n");
        skip();
    }
    check_process_is_not_real_time();
    assert_int_equal(sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &lowest), 0);
    if (!forbid_scheduling()) {
        printf("SKIPPED scheduling: this kernel has no filters of system calls\n");
        skip();
    }
    check_process_is_not_real_time();
}

int main(int argc, char **argv)
{
#define TEST(name) cmocka_unit_test_setup(name, begin)
    const struct CMUnitTest tests[] = {TEST(test_frames_bit_for_bit),
                                       TEST(test_set_while_streaming),
                                       TEST(test_fault_while_set),
                                       TEST(test_frames_are_not_copied),
                                       TEST(test_frames_held_outlive_the_process),
                                       TEST(test_faults_while_streaming),
                                       TEST(test_faults_while_setting_up),
                                       TEST(test_unplugged),
                                       TEST(test_comes_back_unheard),
                                       TEST(test_reaped_later),
                                       TEST(test_hangs_or_works),
                                       TEST(test_stopped_while_it_hangs),
                                       TEST(test_started_again_after_a_hang),
                                       TEST(test_cannot_be_started),
                                       TEST(test_refused_at_open),
                                       TEST(test_fault_while_opening),
                                       TEST(test_ends_over_and_over),
                                       TEST(test_process_is_not_real_time)};
    if (fake_libcamera_is_me(argv[0])) return fake_libcamera_run();
    if (getenv("FOVEA_EMULATED") != NULL) {
        printf("SKIPPED libcamera: an emulated program cannot start another\n");
        return 0;
    }
    if (argc > 1) times = atol(argv[1]) > 3 ? atol(argv[1]) : 3;
    stage = fake_stage_open();
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    fake_stage_close(stage);
    return failed;
}
