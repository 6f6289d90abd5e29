/* A process that is started real-time, as by a service manager: its first thread runs the loop,
 * everything else is ordinary, and no call asks for another scheduling. Each case is a process of
 * its own, which a filter kills when it asks. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <errno.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "app/run/realtime.h"
#include "drivers/thread.h"

enum { PRIORITY = 7, ENDED = 23, NO_RIGHT = 77, WRONG = 99 };

struct seen {
    int policy, priority;
    bool first;    /* the thread that the process came with */
    bool ordinary; /* what it starts is */
};

static void *look(void *context)
{
    struct seen *seen = context;
    struct sched_param parameter = {0};
    sched_getparam(0, &parameter);
    const int policy = sched_getscheduler(0);
    *seen = (struct seen){policy & ~SCHED_RESET_ON_FORK, parameter.sched_priority,
                          syscall(SYS_gettid) == getpid(),
                          policy == SCHED_OTHER || (policy & SCHED_RESET_ON_FORK) != 0};
    return NULL;
}

/* From here on a call that asks for a scheduling ends the process. */
static bool forbid_asking(void)
{
    const struct sock_filter filter[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_sched_setscheduler, 2, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_sched_setattr, 1, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_sched_setparam, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
    };
    const struct sock_fprog program = {sizeof filter / sizeof filter[0],
                                       (struct sock_filter *)(uintptr_t)filter};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

/* `program` in a process that has `policy` from the start. Returns its exit status, or the negated
 * number of the signal that ended it. */
static int started(int policy, bool filtered, int (*program)(int, char **), int argc, char **argv)
{
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        const struct sched_param parameter = {policy == SCHED_OTHER ? 0 : PRIORITY};
        if (sched_setscheduler(0, policy, &parameter) != 0) _exit(NO_RIGHT);
        if (filtered && !forbid_asking()) _exit(NO_RIGHT);
        _exit(fv_realtime_main(program, argc, argv));
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

static int threads(int argc, char **argv)
{
    struct seen program, helper, loop, again;
    struct fv_realtime_rights rights;
    struct fv_realtime_thread thread;
    struct fovea_error error;
    pthread_t ordinary;
    const bool real_time = argc > 0;
    (void)argv;
    look(&program);
    if (program.policy != SCHED_OTHER || program.first == real_time) return 1;
    if (fv_thread_start(&ordinary, look, &helper) != 0) return 2;
    pthread_join(ordinary, NULL);
    if (helper.policy != SCHED_OTHER || helper.first) return 3;
    if (fv_realtime_start(&thread, 40, -1, look, &loop, &rights, &error) != FOVEA_OK) return 4;
    fv_realtime_join(&thread);
    if (rights.lent != real_time || loop.first != real_time) return 5;
    if (real_time && (loop.policy != SCHED_FIFO || loop.priority != PRIORITY)) return 6;
    if (real_time && !loop.ordinary) return 11; /* as the thread of a camera asks */
    if (real_time && (!rights.fifo || rights.why.text[0] != '\0')) return 7;
    /* And once more, as a check does. */
    if (fv_realtime_start(&thread, 0, 0, look, &again, &rights, &error) != FOVEA_OK) return 8;
    fv_realtime_join(&thread);
    if (real_time && (again.policy != SCHED_FIFO || !rights.bound)) return 9;
    if (!real_time && again.policy != SCHED_OTHER) return 10;
    return ENDED;
}

/* False, and a line: this process may not become real-time here. */
static bool possible(void)
{
    static const char *const emulated = "FOVEA_EMULATED";
    if (getenv(emulated) == NULL && started(SCHED_FIFO, true, threads, 1, NULL) != NO_RIGHT)
        return true;
    puts("test_realtime: SKIPPED: no right to be real-time, or no filter of system calls");
    return false;
}

static void test_a_service_that_is_real_time_asks_for_nothing(void **state)
{
    (void)state;
    if (!possible()) return;
    assert_int_equal(started(SCHED_FIFO | SCHED_RESET_ON_FORK, true, threads, 1, NULL), ENDED);
}

static void test_started_by_chrt_the_loop_alone_is_real_time(void **state)
{
    (void)state;
    if (!possible()) return;
    assert_int_equal(started(SCHED_FIFO, false, threads, 1, NULL), ENDED);
}

static void test_an_ordinary_process_is_as_before(void **state)
{
    (void)state;
    assert_int_equal(started(SCHED_OTHER, false, threads, 0, NULL), ENDED);
}

/* In a process of its own: 0 when all pages of files that it has are locked, where it may lock so
 * much; NO_RIGHT where it may not lock that, and the line says so. */
static int lock_program(bool may)
{
    const struct rlimit small = {64 << 10, 64 << 10};
    char line[512];
    struct fovea_error why;
    bool file = false;
    int parts = 0, unlocked = 0;
    if (!may && (setrlimit(RLIMIT_MEMLOCK, &small) != 0 || setuid(65534) != 0)) return WRONG;
    if (!fv_realtime_lock_program(&why)) {
        const char *needed = strstr(why.text, " KiB (ulimit -l), ");
        const bool said = strstr(why.text, "the program is not locked: ") == why.text &&
                          needed != NULL && strstr(needed, " are needed beside the block") != NULL;
        return said && strtoull(needed + 18, NULL, 10) > 1024 ? NO_RIGHT : WRONG;
    }
    FILE *maps = fopen("/proc/self/smaps", "re");
    while (maps != NULL && fgets(line, sizeof line, maps) != NULL) {
        if (line[0] < 'A' || line[0] > 'Z') file = strstr(line, " /") != NULL; /* an address */
        if (!file || strncmp(line, "VmFlags:", 8) != 0) continue;
        parts++;
        unlocked += strstr(line, " lo") == NULL;
    }
    if (maps != NULL) fclose(maps);
    return parts > 8 && unlocked == 0 ? ENDED : WRONG;
}

static int locked_in_child(bool may)
{
    int status;
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) _exit(lock_program(may));
    assert_int_equal(waitpid(child, &status, 0), child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

/* Code and data of the program and its libraries stay, where that is permitted. */
static void test_the_program_is_locked(void **state)
{
    (void)state;
#ifdef FOVEA_SANITIZED
    const bool locks = false; /* sanitizers have nothing locked */
#else
    const bool locks = getenv("FOVEA_EMULATED") == NULL; /* the maps are the emulator's */
#endif
    const int end = locks ? locked_in_child(true) : NO_RIGHT;
    if (end == NO_RIGHT)
        puts("test_realtime: SKIPPED: no right to lock the program, or instrumented, or emulated");
    else
        assert_int_equal(end, ENDED);
    if (locks && getuid() == 0) assert_int_equal(locked_in_child(false), NO_RIGHT);
}

/* At blanks, in place; ended by NULL. */
static int split(char *line, char **words)
{
    int count = 0;
    for (char *word = strtok(line, " "); word != NULL; word = strtok(NULL, " "))
        words[count++] = word;
    words[count] = NULL;
    return count;
}

static void test_the_whole_run_asks_for_nothing(void **state)
{
    static char run[] =
        "fovea run --source sim:still?width=160&height=120 --frames 3 --picture none --quiet "
        "--set lcm_url=";
    static char wrong[] = "fovea run --frames none";
    char *words[16];
    const int count = split(run, words);
    (void)state;
    if (!possible()) return;
    assert_int_equal(started(SCHED_FIFO | SCHED_RESET_ON_FORK, true, fv_dispatch, count, words), 0);
    assert_int_equal(
        started(SCHED_FIFO | SCHED_RESET_ON_FORK, true, fv_dispatch, split(wrong, words), words),
        2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_service_that_is_real_time_asks_for_nothing),
        cmocka_unit_test(test_started_by_chrt_the_loop_alone_is_real_time),
        cmocka_unit_test(test_an_ordinary_process_is_as_before),
        cmocka_unit_test(test_the_whole_run_asks_for_nothing),
        cmocka_unit_test(test_the_program_is_locked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
