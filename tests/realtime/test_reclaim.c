/* The kernel takes pages back while the program runs: all of it in a group of processes whose
 * memory has an end just above what it holds, its own text a file of that group, and beside it a
 * process that reads a file over and over. The run goes on and does not wait for its own pages,
 * which are locked; it records, saves its map, and what it recorded replays bit for bit.
 *
 * Groups are those of the kernel's control groups, of either version, where making one is
 * permitted. That pages were taken is asked of the group: how often the end was met, and how often
 * a page of a file had to be read again. Files are in /var/tmp, which is on a disk: those of a /tmp
 * in memory have no pages that could be taken. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/datasets.h"
#include "common/patience.h"
#include "common/program.h"

enum {
    PART = 1 << 20,         /* of a recording: some seconds */
    SPARE_BYTES = 16 << 20, /* beyond what can only be held: the program, and files being written */
    OTHER_BYTES = 64 << 20, /* read over and over */
    MET_MIN = 100,          /* times that the end must be met */
    WAITS_MAX = 10 /* of the run for a page of its own: for those used for the first time */
};

/* Files of a group, by version. */
static const struct version {
    const char *root, *limit, *usage, *met, *met_key, *cache_key, *again_key;
} versions[] = {
    {"/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "memory.failcnt",
     "", "cache ", "workingset_refault_file "},
    /* memory.high is no end: who is beyond it sleeps, up to 2 s, and a recording waits for that. */
    {"/sys/fs/cgroup", "memory.max", "memory.current", "memory.events", "max ", "file ",
     "workingset_refault_file "},
};

static char folder[] = "/var/tmp/fovea_reclaim_XXXXXX";
static char recording[64], map[64], errors[64], copy[64], other[64];
static const struct version *version;
static char group[96];

/* ---- the group ------------------------------------------------------------------------------- */

static bool put(const char *path, const char *text)
{
    const int file = open(path, O_WRONLY | O_CLOEXEC);
    const bool done = file >= 0 && write(file, text, strlen(text)) == (ssize_t)strlen(text);
    if (file >= 0) close(file);
    return done;
}

static bool put_in_group(const char *name, const char *text)
{
    char path[160];
    snprintf(path, sizeof path, "%s/%s", group, name);
    return put(path, text);
}

/* The number behind a key at the begin of a line, "": the file's first. */
static long long number_of(const char *name, const char *key)
{
    char path[160], line[160];
    long long number = -1;
    snprintf(path, sizeof path, "%s/%s", group, name);
    FILE *file = fopen(path, "r");
    while (file != NULL && number < 0 && fgets(line, sizeof line, file) != NULL)
        if (strncmp(line, key, strlen(key)) == 0) number = strtoll(line + strlen(key), NULL, 10);
    if (file != NULL) fclose(file);
    return number;
}

/* False: none can be made here. */
static bool make_group(void)
{
    for (size_t i = 0; i < sizeof versions / sizeof *versions; i++) {
        char control[160];
        version = &versions[i];
        snprintf(control, sizeof control, "%s/cgroup.subtree_control", version->root);
        (void)put(control, "+memory"); /* of version 1 there is none */
        snprintf(group, sizeof group, "%s/fovea_reclaim_%d", version->root, (int)getpid());
        if (mkdir(group, 0700) != 0) continue;
        if (number_of(version->usage, "") >= 0 && number_of(version->met, version->met_key) >= 0)
            return true;
        rmdir(group);
    }
    return false;
}

static void enter(void)
{
    if (!put_in_group("cgroup.procs", "0")) _exit(99);
}

/* ---- what is in it --------------------------------------------------------------------------- */

static void copy_file(const char *from, const char *to)
{
    static char bytes[1 << 16];
    FILE *in = fopen(from, "r"), *out = fopen(to, "w");
    for (size_t read; in != NULL && out != NULL && (read = fread(bytes, 1, sizeof bytes, in)) > 0;)
        if (fwrite(bytes, 1, read, out) != read) _exit(98);
    if (in == NULL || out == NULL || fclose(out) != 0 || chmod(to, 0700) != 0) _exit(98);
    fclose(in);
}

/* The test's own program and a file, whose pages are then the group's, and can be taken at once: an
 * end of version 2 that cannot be kept ends a process. */
static void make_files(void)
{
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        enter();
        copy_file("/proc/self/exe", copy);
        FILE *out = fopen(other, "w");
        for (int i = 0; out != NULL && i < OTHER_BYTES; i++)
            fputc(i >> 8, out);
        if (out == NULL || fclose(out) != 0) _exit(98);
        sync();
        _exit(0);
    }
    assert_int_equal(program_end(child), 0);
}

/* main runs what stands behind this word. */
static const char run_word[] = "--run";

/* In the child: the copy takes its place, and goes on with the same words. */
static void in_group(const void *context)
{
    static char *argv[32];
    const char *const *words = context;
    int count = 0;
    enter();
    argv[count++] = copy;
    argv[count++] = (char *)(uintptr_t)run_word;
    for (int i = 0; words[i] != NULL; i++)
        argv[count++] = (char *)(uintptr_t)words[i];
    execv(copy, argv);
    _exit(97);
}

/* Reads for ever, and ends with this process. */
static pid_t begin_other(void)
{
    static char bytes[1 << 16];
    const pid_t child = fork();
    if (child != 0) return child;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    enter();
    for (int file = open(other, O_RDONLY | O_CLOEXEC);; lseek(file, 0, SEEK_SET))
        while (read(file, bytes, sizeof bytes) > 0)
            continue;
}

/* The end is what only can be held, and a little; the kernel may need some time to write out. */
static void set_end(void)
{
    bool set;
    int64_t end_ns = 0;
    do {
        char text[32];
        const long long held =
            number_of(version->usage, "") - number_of("memory.stat", version->cache_key);
        snprintf(text, sizeof text, "%lld", held + SPARE_BYTES);
        set = put_in_group(version->limit, text);
    } while (!set && fv_test_patient(&end_ns, 100));
    assert_true(set);
}

/* Times that a process waited for one of its own pages to be read. */
static long long faults_of(pid_t process)
{
    enum { FIELD = 12, AFTER_NAME = 3 }; /* of the line, counted from 1 */
    char path[64], line[512] = "";
    snprintf(path, sizeof path, "/proc/%d/stat", (int)process);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    assert_non_null(fgets(line, sizeof line, file));
    fclose(file);
    char *at = strrchr(line, ')');
    for (int field = AFTER_NAME; at != NULL && field <= FIELD; field++)
        at = strchr(at + 1, ' ');
    return at != NULL ? strtoll(at, NULL, 10) : -1;
}

/* ---- the test -------------------------------------------------------------------------------- */

static void pages_that_are_taken_back_are_not_missed(void **state)
{
    (void)state;
    /* What is read again holds up writes: the recording may wait for longer. */
    static const char *const words[] = {"run",      "--quiet",  "--picture",
                                        "none",     "--source", "sim:wander?width=160&height=120",
                                        "--rate",   "real",     "--set",
                                        "lcm_url=", "--set",    "record_buffer=300",
                                        "--record", recording,  "--save-map",
                                        map,        NULL};
#ifdef FOVEA_SANITIZED
    print_message("SKIPPED pages taken back: sanitizers hold more than there is\n");
    skip();
#endif
    if (!make_group()) {
        print_message("SKIPPED pages taken back: no control group of memory can be made here\n");
        skip();
    }
    make_files();
    const pid_t child = program_begin(words, -1, in_group, words);
    program_wait_until_grown(recording, PART);
    set_end();
    const long long met = number_of(version->met, version->met_key),
                    again = number_of("memory.stat", version->again_key), faults = faults_of(child);
    const pid_t reader = begin_other();
    assert_true(reader > 0);
    int64_t end_ns = 0;
    while (number_of(version->met, version->met_key) < met + MET_MIN &&
           fv_test_patient(&end_ns, 100)) {
    }
    program_wait_until_grown(recording, program_file_bytes(recording) + 2 * PART);
    assert_true(number_of(version->met, version->met_key) >= met + MET_MIN);
    assert_true(number_of("memory.stat", version->again_key) > again);
    const long long waits = faults_of(child) - faults;
    print_message("the end was met %lld times, %lld pages of files were read again, for %lld of "
                  "which the run waited\n",
                  number_of(version->met, version->met_key) - met,
                  number_of("memory.stat", version->again_key) - again, waits);
    assert_in_range(waits, 0, WAITS_MAX);
    kill(child, SIGTERM); /* the map is saved while there is no more than before */
    program_expect_end(child, FV_EXIT_OK);
    assert_string_equal(program_said(), "");
    assert_true(program_file_bytes(map) > 0);
    kill(reader, SIGKILL);
    waitpid(reader, NULL, 0);
    const char *const verify[] = {"replay", "--verify", recording, NULL};
    program_expect_end(program_begin(verify, -1, NULL, NULL), FV_EXIT_OK);
}

/* Whatever is left in the group ends with the test, and the group with it. */
static int remove_group(void **state)
{
    char path[160], line[32];
    (void)state;
    snprintf(path, sizeof path, "%s/cgroup.procs", group);
    for (int tenths = 0; tenths < 100 && rmdir(group) != 0 && errno != ENOENT; tenths++) {
        FILE *file = fopen(path, "r");
        while (file != NULL && fgets(line, sizeof line, file) != NULL)
            kill((pid_t)strtol(line, NULL, 10), SIGKILL);
        if (file != NULL) fclose(file);
        while (waitpid(-1, NULL, WNOHANG) > 0)
            continue;
        usleep(100000);
    }
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(pages_that_are_taken_back_are_not_missed, remove_group),
    };
    if (argc > 1 && strcmp(argv[1], run_word) == 0) {
        argv[1] = argv[0];
        return fv_dispatch(argc - 1, argv + 1);
    }
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(recording, sizeof recording, "%s/run.lcm", folder);
    snprintf(map, sizeof map, "%s/run.map", folder);
    snprintf(errors, sizeof errors, "%s/errors", folder);
    snprintf(copy, sizeof copy, "%s/program", folder);
    snprintf(other, sizeof other, "%s/other", folder);
    program_says_to(errors);
    const int failed = cmocka_run_group_tests_name("realtime/test_reclaim", tests, NULL, NULL);
    fv_test_folder_remove(folder);
    return failed;
}
