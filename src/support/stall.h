/* Calls that may wait for ever: writes to a disk that does not answer, to a pipe that nobody
 * reads, to a terminal that was stopped. Who makes such a call enters it in a table before and
 * leaves it after, so that a watching thread can name it, and end the program in spite of it.
 * Any number of threads, but not the loop's: it takes a lock. No heap call. */
#ifndef FOVEA_SUPPORT_STALL_H
#define FOVEA_SUPPORT_STALL_H

#include <stdbool.h>
#include <stdint.h>
#include <time.h>

enum { FV_STALL_CALLS_MAX = 16, FV_STALL_NAME_BYTES = 256, FV_STALL_COMPUTES_NS = 20000000 };

/* One call as the table holds it. */
struct fv_stall {
    uint64_t id;                    /* rises from call to call; 0: none */
    char name[FV_STALL_NAME_BYTES]; /* of what is written, cut where it is longer */
    int64_t since_ns; /* CLOCK_MONOTONIC: entered, moved, or last seen to compute, what came last */
    clockid_t cpu;    /* processor time of the thread that makes it */
    int32_t thread;   /* its number in the system */
    int64_t cpu_ns;   /* of that clock at since_ns; -1: not known */
    bool disk;        /* seen since then to wait inside the kernel for a disk */
};

/* A call that writes `name`: an option or the path of a file. Returns its place in the table, or
 * -1, which fv_stall_leave takes too, when FV_STALL_CALLS_MAX calls are under way. */
int fv_stall_enter(const char *name);
void fv_stall_leave(int place);
/* Something was written: the call counts as entered now; with -1 every call of this thread. */
void fv_stall_move(int place);

/* The call that has waited longest. A thread that takes processor time does not wait, it prepares
 * what it writes: a picture may take seconds on a slow board, and longer where other programs have
 * the processor. So a call counts as entered now whenever its thread has computed for
 * FV_STALL_COMPUTES_NS since, or is ready to. A disk that other programs keep busy, or a slow card,
 * takes seconds for what it will take in the end: `disk`. false: none is under way.
 * `moved_ns`: when any thread last called fv_stall_move; 0: never. That a call returned says
 * nothing: it may have looked only.
 */
bool fv_stall_longest(struct fv_stall *call, int64_t *moved_ns);

#endif
