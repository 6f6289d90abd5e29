/* The armed proof: ten thousand steps and works without a heap call, a lock or a system call. The
 * steps run in a child process under a seccomp filter that kills it at the first system call, with
 * malloc and the lock functions interposed. The steps come to everything that a loop does: a way
 * through the simulated corridor that closes a loop, darkness that loses the camera and its being
 * found again, a map saved, then pictures that fit nothing, pauses, resets, frames that are missing
 * or refused. And the trap works: a planted call of each kind is caught. */
#ifdef FOVEA_SANITIZED
#include <stdio.h>

int main(void)
{
    puts("SKIPPED armed proof: sanitizers bring their own heap");
    return 0;
}
#else
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/heap_calls.h"
#include "common/job_switch.h"
#include "base/elementary.h"
#include "fovea/fovea.h"
#include "drivers/table.h"
#include "fovea/source.h"

/* The campaign takes STEPS_LONG (FOVEA_LONG). */
enum { WIDTH = 320, HEIGHT = 240, STEPS = 1600, STEPS_LONG = 10000, PICTURES = 4 };

/* The corridor once round, every fourth frame, then dark ones, then a part of it again from another
 * place. */
enum {
    CORRIDOR = 323,
    DARK = 30,
    AGAIN = 150,
    AGAIN_FROM = 60,
    WAY = CORRIDOR + DARK + AGAIN,
    SAVE_AT = 300
};

/* ---- traps ----------------------------------------------------------------------------------- */

static volatile int armed;
void *volatile planted_piece; /* seen from outside, so that a planted call is not optimised away */

static void trip(void)
{
    if (armed) __builtin_trap();
}

static void on_heap_call(void)
{
    trip();
}

static void on_heap_free(void)
{
    trip();
}

/* A lock taken in the loop would have to be one of these. Outside of the armed time the test has
 * one thread, so doing nothing is right. */
int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    (void)mutex;
    trip();
    return 0;
}

int pthread_mutex_unlock(pthread_mutex_t *mutex)
{
    (void)mutex;
    return 0;
}

int pthread_rwlock_wrlock(pthread_rwlock_t *lock)
{
    (void)lock;
    trip();
    return 0;
}

int pthread_rwlock_rdlock(pthread_rwlock_t *lock)
{
    (void)lock;
    trip();
    return 0;
}

int pthread_rwlock_unlock(pthread_rwlock_t *lock)
{
    (void)lock;
    return 0;
}

/* From here on only exit_group is allowed. False where the kernel (or an emulator) has no filters.
 */
static int forbid_system_calls(void)
{
    struct sock_filter filter[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_exit_group, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
    };
    struct sock_fprog program = {.len = sizeof filter / sizeof filter[0], .filter = filter};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/* ---- the steps ------------------------------------------------------------------------------- */

static uint8_t pictures[PICTURES][WIDTH * HEIGHT], dark[WIDTH * HEIGHT];
static uint8_t (*corridor)[WIDTH * HEIGHT];
static struct fovea_config config;
static struct fovea *rt;

/* What the steps came to, seen by the parent too. */
static struct tally {
    uint64_t messages, posed, lost, found_again, loops, saved_bytes, jobs_done[FOVEA_JOB_COUNT];
} * tally;

static void paint(void)
{
    struct fv_random random;
    fv_random_seed(&random, 3);
    for (int p = 0; p < PICTURES; p++) {
        for (int block = 0; block < 900; block++) {
            const uint32_t x = fv_random_below(&random, WIDTH - 20),
                           y = fv_random_below(&random, HEIGHT - 20);
            const uint32_t size = 4 + fv_random_below(&random, 16),
                           grey = fv_random_below(&random, 256);
            for (uint32_t row = y; row < y + size; row++)
                memset(&pictures[p][row * WIDTH + x], (int)grey, size);
        }
    }
}

static void *map_pages(size_t bytes, int flags)
{
    void *memory = mmap(NULL, bytes, PROT_READ | PROT_WRITE, flags | MAP_ANONYMOUS, -1, 0);
    return memory == MAP_FAILED ? NULL : memory;
}

/* All frames before the loop is armed: the simulated camera needs a heap when it is opened. */
static bool film(struct fovea_camera *camera)
{
    const struct fovea_source_ops *ops;
    const char *address;
    const struct fovea_source_selection selection = {.step = 4, .frames = CORRIDOR};
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    corridor = map_pages((size_t)CORRIDOR * sizeof *corridor, MAP_PRIVATE);
    if (corridor == NULL ||
        fv_source_find("sim:corridor?width=320&height=240", &ops, &address, &error) != FOVEA_OK ||
        ops->open(address, &selection, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK)
        return false;
    *camera = ops->info(source)->rig.cameras[0].camera;
    for (int i = 0; i < CORRIDOR; i++) {
        if (ops->dequeue(source, INT64_MAX, &frame) != FOVEA_OK ||
            frame.images[0].stride_bytes != WIDTH)
            return false;
        memcpy(corridor[i], frame.images[0].data, sizeof corridor[i]);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    return true;
}

static int build(void **state)
{
    (void)state;
    struct fovea_error error;
    size_t bytes;
    paint();
    fovea_config_default(&config);
    if (!film(&config.rig.cameras[0].camera)) return -1;
    if (!job_switch_all(&config, 3)) return -1;
    /* A chain whose result networks and the preview see, so that the way stays as it is. */
    config.edge_job.segments = true;
    config.lockstep_every = 7;
    config.image.seen_by = FOVEA_VIEWER_NETWORKS | FOVEA_VIEWER_PREVIEW;
    config.image.preprocess.operations.count = FOVEA_OPERATION_COUNT;
    for (int i = 0; i < FOVEA_OPERATION_COUNT; i++)
        config.image.preprocess.operations.items[i] = (enum fovea_operation)i;
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) return -1;
    void *memory = map_pages(bytes, MAP_PRIVATE),
         *saved = map_pages(fovea_map_bytes_max(&config), MAP_PRIVATE);
    tally = map_pages(sizeof *tally, MAP_SHARED);
    if (memory == NULL || saved == NULL || tally == NULL) return -1;
    if (fovea_init(memory, bytes, &config, &rt, &error) != FOVEA_OK) return -1;
    fovea_map_save_to(rt, saved, fovea_map_bytes_max(&config));
    return 0;
}

static void take_step(const struct fovea_inputs *inputs)
{
    static enum fovea_tracking_state last;
    struct fovea_outputs outputs;
    struct fovea_pose pose;
    struct fovea_stats stats;
    fovea_step(rt, inputs, &outputs);
    tally->messages += outputs.message_count;
    fovea_work(rt, &inputs->grants, &outputs);
    tally->messages += outputs.message_count;
    tally->saved_bytes += outputs.map_bytes;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        tally->jobs_done[job] += outputs.units_done[job];
    fovea_pose_get(rt, &pose);
    fovea_stats_get(rt, &stats);
    tally->posed += pose.posed;
    tally->lost += pose.state == FOVEA_TRACKING_LOST;
    tally->found_again += last == FOVEA_TRACKING_LOST && pose.posed && pose.map_id == 0;
    if (stats.closures > tally->loops) tally->loops = stats.closures;
    last = pose.state;
}

static struct fovea_frame frame_of(const uint8_t *pixels, int i)
{
    return (struct fovea_frame){
        .image_count = 1,
        .images[0] = {.data = pixels,
                      .width = WIDTH,
                      .height = HEIGHT,
                      .stride_bytes = WIDTH,
                      .format = FOVEA_PIXEL_GREY8,
                      .size_bytes = sizeof pictures[0]},
        .stamp_ns = (int64_t)i * 133333333,
        .sequence = (uint64_t)i,
    };
}

/* The way through the corridor, with grants of the fixed schedule. */
static void walk(int i)
{
    const uint8_t *pixels = dark;
    if (i < CORRIDOR) pixels = corridor[i];
    if (i >= CORRIDOR + DARK) pixels = corridor[i - CORRIDOR - DARK + AGAIN_FROM];
    const struct fovea_frame frame = frame_of(pixels, i);
    struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
    fovea_grants_fixed(&config, &inputs.grants);
    if (i == SAVE_AT) inputs.commands = FOVEA_COMMAND_SAVE;
    take_step(&inputs);
}

/* Pictures that fit nothing, missing frames, refused frames, commands, resets. */
static void stumble(int i)
{
    static const int cycles[4] = {11, 3, 5, 7}; /* of the units that are granted to a job */
    struct fovea_frame frame = frame_of(pictures[i % PICTURES], i);
    if (i % 50 == 49) frame.stamp_ns -= 1000000000;
    struct fovea_inputs inputs = {.frame = i % 20 == 19 ? NULL : &frame, .now_ns = frame.stamp_ns};
    inputs.grants.features = 500;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        inputs.grants.units[job] = (uint32_t)(i % cycles[job % 4]);
    if (i % 100 == 50) inputs.commands = FOVEA_COMMAND_PAUSE;
    if (i % 100 == 55) inputs.commands = FOVEA_COMMAND_RESUME;
    if (i % 1000 == 755) inputs.commands = FOVEA_COMMAND_RESUME | FOVEA_COMMAND_SAVE;
    if (i % 1000 == 600) inputs.commands = FOVEA_COMMAND_RESET;
    take_step(&inputs);
}

static void run_steps(int steps)
{
    for (int i = 0; i < steps; i++) {
        if (i < WAY)
            walk(i);
        else
            stumble(i);
    }
}

enum planted { NOTHING, A_HEAP_CALL, A_SYSTEM_CALL, A_LOCK };

/* Run the steps armed in a child, with a call planted; its wait status. */
static int run_child(enum planted planted, int steps, int *filtered)
{
    static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    int pipe_ends[2], status = 0;
    memset(tally, 0, sizeof *tally);
    assert_int_equal(pipe(pipe_ends), 0);
    const pid_t child = fork();
    if (child == 0) {
        const uint8_t filter = (uint8_t)forbid_system_calls();
        if (!filter && write(pipe_ends[1], &filter, 1) != 1) _exit(3);
        armed = 1;
        run_steps(steps);
        if (planted == A_HEAP_CALL) planted_piece = malloc(16);
        if (planted == A_SYSTEM_CALL) syscall(SYS_getppid);
        if (planted == A_LOCK) pthread_mutex_lock(&mutex);
        armed = 0;
        syscall(SYS_exit_group, tally->messages > (uint64_t)steps ? 0 : 4);
    }
    close(pipe_ends[1]);
    uint8_t ignored;
    *filtered = read(pipe_ends[0], &ignored, 1) == 0;
    close(pipe_ends[0]);
    assert_int_equal(waitpid(child, &status, 0), child);
    return status;
}

static void thousands_of_steps_call_nothing(void **state)
{
    (void)state;
    int filtered;
    const int steps = getenv("FOVEA_LONG") != NULL ? STEPS_LONG : STEPS;
    const int status = run_child(NOTHING, steps, &filtered);
    if (!filtered) printf("SKIPPED the proof of no system call: no seccomp filters here\n");
    if (!WIFEXITED(status)) print_error("the loop was caught: signal %d\n", WTERMSIG(status));
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    print_message("posed %d, lost %d, found again %d, loops %d, saved %d bytes\n",
                  (int)tally->posed, (int)tally->lost, (int)tally->found_again, (int)tally->loops,
                  (int)tally->saved_bytes);
    assert_true(tally->posed > WAY / 2 && tally->lost > 0 && tally->found_again > 0 &&
                tally->loops > 0);
    assert_true(tally->saved_bytes > 0);
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        assert_true(tally->jobs_done[job] > (uint64_t)steps / 100);
}

/* The other methods of features, over the first of the way and pictures that fit nothing. */
static void further_methods_call_nothing(void **state)
{
    struct fovea *const of_fast = rt;
    (void)state;
    for (int m = FOVEA_FEATURES_ORB; m <= FOVEA_FEATURES_SHI_TOMASI; m++) {
        struct fovea_config other = config;
        struct fovea_error error;
        size_t bytes;
        int filtered;
        other.features.method = (enum fovea_feature_method)m;
        assert_int_equal(fovea_size(&other, &bytes, &error), FOVEA_OK);
        void *memory = map_pages(bytes, MAP_PRIVATE);
        assert_non_null(memory);
        assert_int_equal(fovea_init(memory, bytes, &other, &rt, &error), FOVEA_OK);
        const int status = run_child(NOTHING, 60, &filtered);
        assert_true(WIFEXITED(status));
        assert_int_equal(WEXITSTATUS(status), 0);
        assert_true(tally->posed > 30);
        munmap(memory, bytes);
    }
    rt = of_fast;
}

static void planted_calls_are_seen(void **state)
{
    (void)state;
    int filtered;
    assert_true(WIFSIGNALED(run_child(A_HEAP_CALL, 10, &filtered)));
    assert_true(WIFSIGNALED(run_child(A_LOCK, 10, &filtered)));
    const int status = run_child(A_SYSTEM_CALL, 10, &filtered);
    if (filtered) assert_true(WIFSIGNALED(status));
    assert_true(WIFEXITED(run_child(NOTHING, 10, &filtered)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(thousands_of_steps_call_nothing),
        cmocka_unit_test(further_methods_call_nothing),
        cmocka_unit_test(planted_calls_are_seen),
    };
    return cmocka_run_group_tests(tests, build, NULL);
}
#endif
