/* A run in a process of its own, so that what goes wrong in it is one counted run: a crash by its
 * signal, a hang by what the process itself does, never by the time that passes, which other
 * programs take.
 *
 * A hang is one of two: the run uses more than FAULTS_CPU_S seconds of processor time; or all its
 * threads are found asleep over FAULTS_ASLEEP_S looks a second apart (a thread that waits for a
 * processor does not sleep), and used less than a hundredth of that time: a thread that only looks
 * now and then whether something has come sleeps too. It is watched until it has ended. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_CHILD_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_CHILD_H

#include <stdbool.h>
#include <stddef.h>

enum { FAULTS_CPU_S = 300, FAULTS_ASLEEP_S = 60, FAULTS_LOOK_MS = 1000 };

enum faults_end { FAULTS_WELL, FAULTS_CRASH, FAULTS_HANG };

/* Call `work` with `argument` in a child; what it writes to `result` is there afterwards. Anything
 * but FAULTS_WELL: `result` is untouched, and a line on stdout says what happened. `look_ms`:
 * FAULTS_LOOK_MS, tests look more often. */
enum faults_end faults_in_child(void (*work)(const void *argument, void *result),
                                const void *argument, void *result, size_t bytes, int look_ms);

/* Looks at a process so far, zero at first. One look more, at which all its threads were `asleep`
 * or not and had used `ticks` of processor time, of which a look's time has `per_look`. True: it
 * hangs. */
struct faults_sleep {
    int asleep_for;
    unsigned long from;
};
bool faults_sleeps(struct faults_sleep *sleep, bool asleep, unsigned long ticks, long per_look);

#endif
