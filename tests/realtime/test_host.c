/* What a host does to a run, and what the run makes of it: it is stopped and goes on, its clock is
 * set, its disk fills up, its network goes and comes back, its memory and its processors are taken
 * by others. Each run is a process of its own; what it recorded replays bit for bit. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <sched.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "app/run/health.h"
#include "common/datasets.h"
#include "common/own_network.h"
#include "common/patience.h"
#include "common/program.h"
#include "drivers/clock.h"
#include "support/lcmlog.h"

static char folder[FV_TEST_IN_MEMORY_BYTES];
static char recording[64], map[64], errors[64], disk[64];

/* By how much the wall clock of this test and of its children is set. Monotonic clocks cannot be.
 */
static atomic_int_fast64_t *set_by_ns;

int clock_gettime(clockid_t clock, struct timespec *time)
{
    const int failed = (int)syscall(SYS_clock_gettime, clock, time);
    if (failed == 0 && clock == CLOCK_REALTIME && set_by_ns != NULL)
        *time = fv_clock_timespec((int64_t)time->tv_sec * 1000000000 + time->tv_nsec +
                                  atomic_load(set_by_ns));
    return failed;
}

#define RUN "run", "--quiet", "--picture", "none", "--source", "sim:wander?width=160&height=120"
/* By the clock, with a buffer of half a minute: a disk that others keep busy ends no recording. */
#define BY_THE_CLOCK RUN, "--rate", "real", "--set", "record_buffer=1000"
#define RECORDED BY_THE_CLOCK, "--set", "lcm_url=", "--record", recording, "--save-map", map

enum {
    PART = 1 << 20,    /* of a recording: some seconds */
    MESSAGES = 4 << 10 /* of a log of messages: some */
};

static void expect_replays(const char *path)
{
    const char *const verify[] = {"replay", "--verify", path, NULL};
    program_expect_end(program_begin(verify, -1, NULL, NULL), FV_EXIT_OK);
    unlink(path);
}

static pid_t begin_recorded(void)
{
    const char *const words[] = {RECORDED, NULL};
    const pid_t child = program_begin(words, -1, NULL, NULL);
    program_wait_until_grown(recording, PART);
    return child;
}

/* It still works: the recording grows. In the end all is there, and nothing was complained of. */
static void expect_goes_on(pid_t child)
{
    program_wait_until_grown(recording, program_file_bytes(recording) + PART);
    kill(child, SIGTERM);
    program_expect_end(child, FV_EXIT_OK);
    assert_string_equal(program_said(), "");
    assert_true(program_file_bytes(map) > 0);
    unlink(map);
    expect_replays(recording);
}

/* ---- time ------------------------------------------------------------------------------------ */

static void stopped_for_seconds_it_goes_on(void **state)
{
    (void)state;
    const pid_t child = begin_recorded();
    kill(child, SIGSTOP);
    usleep(2500000);
    kill(child, SIGCONT);
    expect_goes_on(child);
}

/* By how many hours the stamps of a log of messages leap, at most. */
static int64_t hours_leapt(const char *path)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    int64_t before_us = 0, most_us = 0;
    assert_int_equal(fv_lcmlog_open(path, &log, &error), FOVEA_OK);
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        const int64_t leap_us =
            event.time_us > before_us ? event.time_us - before_us : before_us - event.time_us;
        if (before_us != 0 && leap_us > most_us) most_us = leap_us;
        before_us = event.time_us;
    }
    fv_lcmlog_close(log);
    return most_us / 3600000000;
}

/* Messages are stamped by it; poses and what is recorded do not depend on it. */
static void a_clock_that_is_set_changes_nothing(void **state)
{
    static const int64_t hour_ns = 3600 * INT64_C(1000000000);
    char messages[64], url[96];
    (void)state;
    snprintf(messages, sizeof messages, "%s/messages.lcm", folder);
    snprintf(url, sizeof url, "lcm_url=file://%s?mode=w", messages);
    /* Without features, so that the log takes all though it may wait for a processor. */
    const char *const words[] = {BY_THE_CLOCK, "--set",   url,          "--set", "features_every=0",
                                 "--record",   recording, "--save-map", map,     NULL};
    const pid_t child = program_begin(words, -1, NULL, NULL);
    program_wait_until_grown(recording, PART);
    /* Both are written by then: each by a thread of its own. */
    atomic_store(set_by_ns, -hour_ns);
    program_wait_until_grown(messages, program_file_bytes(messages) + MESSAGES);
    program_wait_until_grown(recording, program_file_bytes(recording) + PART / 4);
    atomic_store(set_by_ns, 24 * 365 * hour_ns);
    program_wait_until_grown(messages, program_file_bytes(messages) + MESSAGES);
    program_wait_until_grown(recording, program_file_bytes(recording) + PART / 4);
    atomic_store(set_by_ns, 0);
    expect_goes_on(child);
    assert_in_range(hours_leapt(messages), 24 * 365 - 1, 24 * 365 + 1);
    unlink(messages);
}

/* ---- what others take ------------------------------------------------------------------------ */

/* No memory beyond what it has: as where others have taken all. */
static void memory_that_others_take_is_not_missed(void **state)
{
    char path[64];
    unsigned long pages = 0;
    (void)state;
#ifdef FOVEA_SANITIZED
    print_message("SKIPPED memory that others take: sanitizers take more while they run\n");
    skip();
#endif
    if (getenv("FOVEA_EMULATED") != NULL) skip(); /* the emulator takes more, too */
    const pid_t child = begin_recorded();
    snprintf(path, sizeof path, "/proc/%d/statm", (int)child);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "%lu", &pages), 1);
    fclose(file);
    const rlim_t bytes = (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE);
    const struct rlimit all = {bytes, bytes};
    assert_int_equal(prlimit(child, RLIMIT_AS, &all, NULL), 0);
    expect_goes_on(child);
}

static void processors_that_others_take_cost_frames_alone(void **state)
{
    enum { OTHERS_MAX = 64 };
    pid_t others[OTHERS_MAX];
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    const int count = 4 * processors < OTHERS_MAX ? (int)(4 * processors) : OTHERS_MAX;
    (void)state;
    const pid_t child = begin_recorded();
    for (int i = 0; i < count; i++) {
        others[i] = fork();
        assert_true(others[i] >= 0);
        if (others[i] == 0) prctl(PR_SET_PDEATHSIG, SIGKILL);
        for (volatile unsigned n = 0; others[i] == 0; n++)
            continue;
    }
    program_wait_until_grown(recording, program_file_bytes(recording) + PART / 4);
    for (int i = 0; i < count; i++) {
        kill(others[i], SIGKILL);
        waitpid(others[i], NULL, 0);
    }
    expect_goes_on(child);
}

/* ---- a disk that is full --------------------------------------------------------------------- */

/* The folder is a disk of 3 MB, for this process and its children; false: not permitted here. */
static bool small_disk(void)
{
    if (unshare(CLONE_NEWNS) != 0 || mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0)
        return false;
    return mkdir(disk, 0700) == 0 && mount("none", disk, "tmpfs", 0, "size=3m") == 0;
}

static void a_full_disk_ends_the_recording_alone(void **state)
{
    char record[80], kept[80], filler[80];
    (void)state;
    if (!small_disk()) {
        print_message("SKIPPED a full disk: no mounting here\n");
        skip();
    }
    snprintf(record, sizeof record, "%s/run.lcm", disk);
    snprintf(kept, sizeof kept, "%s/run.map", disk);
    snprintf(filler, sizeof filler, "%s/filler", disk);
    const char *const words[] = {BY_THE_CLOCK, "--set",      "lcm_url=", "--record",
                                 record,       "--save-map", kept,       NULL};
    FILE *file = fopen(kept, "w");
    fputs("the map of before", file);
    fclose(file);
    const pid_t child = program_begin(words, -1, NULL, NULL);
    program_wait_until_said("recording ended after");
    program_expect_said("No space left on device; the run goes on");
    /* What little the end of the recording gave back is taken, too. */
    file = fopen(filler, "w");
    while (fputc('x', file) != EOF && fflush(file) == 0)
        continue;
    fclose(file);
    usleep(500000);
    kill(child, SIGTERM);
    program_expect_end(child, FV_EXIT_FAILED);
    program_expect_said(kept);
    /* The map of before is as it was. */
    char text[32] = "";
    file = fopen(kept, "r");
    assert_non_null(fgets(text, sizeof text, file));
    fclose(file);
    assert_string_equal(text, "the map of before");
    expect_replays(record); /* up to where it ended */
    umount2(disk, MNT_DETACH);
    rmdir(disk);
}

/* ---- a network that comes and goes ----------------------------------------------------------- */

static void in_own_network(const void *context)
{
    const int *entered = context;
    const uint8_t done = own_network_enter() ? 1 : 0;
    if (write(*entered, &done, 1) != 1 || !done) _exit(99);
}

/* Into the network of the child, for the rest of this process. */
static bool enter_network_of(pid_t child)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/ns/net", (int)child);
    const int network = open(path, O_RDONLY | O_CLOEXEC);
    const bool entered = network >= 0 && setns(network, CLONE_NEWNET) == 0;
    if (network >= 0) close(network);
    return entered;
}

static int listen_to_group(void)
{
    const int heard = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), yes = 1;
    const struct sockaddr_in any = {.sin_family = AF_INET, .sin_port = htons(7667)};
    const struct timeval patience = {.tv_usec = 100000};
    struct ip_mreqn group = {.imr_ifindex = 1}; /* the loopback */
    inet_pton(AF_INET, "239.255.76.67", &group.imr_multiaddr);
    setsockopt(heard, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    setsockopt(heard, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    assert_int_equal(bind(heard, (const struct sockaddr *)&any, sizeof any), 0);
    assert_int_equal(setsockopt(heard, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group), 0);
    return heard;
}

/* Whether packets come: ten, within the patience, or none for two seconds. */
static bool comes(int heard)
{
    static char packet[1 << 16];
    int packets = 0;
    int64_t end_ns = 0;
    while (packets < 10 && fv_test_patient(&end_ns, 0))
        packets += recv(heard, packet, sizeof packet, 0) > 0;
    return packets == 10;
}

static bool stays_silent(int heard)
{
    static char packet[1 << 16];
    int silent = 0;
    int64_t end_ns = 0;
    while (silent < 20 && fv_test_patient(&end_ns, 0))
        silent = recv(heard, packet, sizeof packet, 0) > 0 ? 0 : silent + 1;
    return silent == 20;
}

/* Until a message of the run's health, which its feed gives without a network, says this of the
 * part that sends. The run says that no route is there before it offers its feed, so that an echo
 * may find no feed yet. */
static void expect_publisher(const char *socket_path, enum fv_health_state state)
{
    const char *const words[] = {"echo",      "--feed", socket_path,    "--count", "1",
                                 "--timeout", "10",     "FOVEA_HEALTH", NULL};
    char wanted[64], said[4096] = "", path[512];
    int code = FV_EXIT_OK;
    snprintf(wanted, sizeof wanted, "\"publisher\", \"state\": %d", (int)state);
    snprintf(path, sizeof path, "%s/health", folder);
    int64_t end_ns = 0;
    do {
        const int out = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        assert_true(out >= 0);
        code = program_end(program_begin(words, out, NULL, NULL));
        const ssize_t bytes = pread(out, said, sizeof said - 1, 0);
        close(out);
        said[bytes > 0 ? bytes : 0] = '\0';
        if (code == FV_EXIT_OK && strstr(said, wanted) != NULL) return;
    } while (fv_test_patient(&end_ns, 100));
    fail_msg("expected %s, found \"%s\" and code %d, \"%s\"", wanted, said, code, program_said());
}

static void a_network_that_comes_and_goes_is_used_while_it_is_there(void **state)
{
    char feed[512], key[600];
    snprintf(feed, sizeof feed, "%s/feed", folder);
    snprintf(key, sizeof key, "web.socket=%s", feed);
    const char *const words[] = {BY_THE_CLOCK, "--set", key, NULL};
    int ends[2];
    uint8_t done = 0;
    (void)state;
    assert_int_equal(pipe(ends), 0);
    const pid_t child = program_begin(words, -1, in_own_network, &ends[1]);
    if (read(ends[0], &done, 1) != 1 || done == 0 || !enter_network_of(child)) {
        kill(child, SIGKILL);
        program_end(child);
        print_message("SKIPPED a network that comes and goes: no namespace here\n");
        skip();
    }
    program_wait_until_said("no LCM messages until there is a route");
    expect_publisher(feed, FV_HEALTH_FAILED);
    assert_true(own_network_mend());
    const int heard = listen_to_group();
    assert_true(comes(heard));
    expect_publisher(feed, FV_HEALTH_OK);
    assert_int_equal(system("ip link set lo down"), 0);
    assert_true(stays_silent(heard));
    expect_publisher(feed, FV_HEALTH_FAILED);
    assert_true(own_network_mend());
    assert_true(comes(heard));
    close(heard);
    kill(child, SIGTERM);
    program_expect_end(child, FV_EXIT_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stopped_for_seconds_it_goes_on),
        cmocka_unit_test(a_clock_that_is_set_changes_nothing),
        cmocka_unit_test(memory_that_others_take_is_not_missed),
        cmocka_unit_test(processors_that_others_take_cost_frames_alone),
        cmocka_unit_test(a_full_disk_ends_the_recording_alone),
        cmocka_unit_test(a_network_that_comes_and_goes_is_used_while_it_is_there),
    };
    set_by_ns =
        mmap(NULL, sizeof *set_by_ns, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (set_by_ns == MAP_FAILED) return 1;
    fv_test_folder_in_memory(folder);
    snprintf(recording, sizeof recording, "%s/run.lcm", folder);
    snprintf(map, sizeof map, "%s/run.map", folder);
    snprintf(errors, sizeof errors, "%s/errors", folder);
    snprintf(disk, sizeof disk, "%s/disk", folder);
    program_says_to(errors);
    const int failed = cmocka_run_group_tests_name("realtime/test_host", tests, NULL, NULL);
    fv_test_folder_remove(folder);
    return failed;
}
