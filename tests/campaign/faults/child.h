/* A run in a process of its own, so that what goes wrong in it is one counted run: a crash by its
 * signal, a hang by what the process itself does, never by the time that passes, which other
 * programs take.
 *
 * A hang is one of two: the run uses more than FAULTS_CPU_S seconds of processor time; or all its
 * threads sleep, and use none, over FAULTS_ASLEEP_S looks a second apart (a thread that waits for
 * a processor does not sleep). */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_CHILD_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_CHILD_H

#include <stddef.h>

enum { FAULTS_CPU_S = 300, FAULTS_ASLEEP_S = 60 };

enum faults_end { FAULTS_WELL, FAULTS_CRASH, FAULTS_HANG };

/* Call `work` with `argument` in a child; what it writes to `result` is there afterwards. Anything
 * but FAULTS_WELL: `result` is untouched, and a line on stdout says what happened. */
enum faults_end faults_in_child(void (*work)(const void *argument, void *result),
                                const void *argument, void *result, size_t bytes);

#endif
