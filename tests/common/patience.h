/* Waiting for what comes soon, unless other programs use the processor:
 *
 *     int64_t end_ns = 0;
 *     while (!it_is_there() && fv_test_patient(&end_ns, 10)) {
 *     }
 *     assert_true(it_is_there());
 *
 * What may pass again is asked once, and kept: bool there = false;
 * while (!(there = it_is_there()) && ...). */
#ifndef FOVEA_TESTS_COMMON_PATIENCE_H
#define FOVEA_TESTS_COMMON_PATIENCE_H

#include <stdbool.h>
#include <stdint.h>
#include <time.h>

enum { FV_TEST_PATIENCE_S = 120 };

/* Pause for `pause_ms`, and whether the patience lasts: it begins where *end_ns is 0. */
static inline bool fv_test_patient(int64_t *end_ns, int pause_ms)
{
    struct timespec pause, now;
    pause.tv_sec = pause_ms / 1000;
    pause.tv_nsec = pause_ms % 1000 * 1000000L;
    clock_gettime(CLOCK_MONOTONIC, &now);
    const int64_t now_ns = (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
    if (*end_ns == 0) *end_ns = now_ns + FV_TEST_PATIENCE_S * INT64_C(1000000000);
    if (pause_ms > 0) nanosleep(&pause, NULL);
    return now_ns < *end_ns;
}

#endif
