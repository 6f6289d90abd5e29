/* Unplugged over and over, on the fake device: frames come back in time, and nothing is left
 * behind. `test_v4l2_unplug N` does it N times (default 25). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <dirent.h>
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/fake_camera.h"
#include "common/live_source.h"

static long times = 25;

struct holdings {
    long descriptors;
    size_t heap_bytes;
};

static struct holdings count_holdings(void)
{
    const struct mallinfo2 heap = mallinfo2();
    struct holdings holdings = {0, heap.uordblks + heap.hblkhd};
    DIR *descriptors = opendir("/proc/self/fd");
    while (readdir(descriptors) != NULL)
        holdings.descriptors++;
    closedir(descriptors);
    return holdings;
}

static int ascending(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void test_unplugged_over_and_over(void **state)
{
    (void)state;
    int64_t *took_ns = calloc((size_t)times, sizeof *took_ns);
    struct holdings before = {0, 0};
    long late = 0;
    fake_begin();
    struct fake_camera *camera = fake_new();
    camera->serial = "A1";
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0?gain=3");
    for (long i = 0; i < times; i++) {
        char node[32];
        fv_test_next_frame(source);
        if (i == 2) before = count_holdings();
        fake_unplug(camera);
        if (i % 3 != 0)
            fv_test_wait_for_state(source, FOVEA_SOURCE_GONE); /* else back before it was missed */
        snprintf(node, sizeof node, "/dev/video%ld", i % 5);
        const int64_t begin_ns = fv_test_now_ns();
        const uint64_t made = camera->set_ups;
        fake_plug(camera, node);
        for (bool again = false; !again;) { /* frames from before are not what is waited for */
            fv_test_next_frame(source);
            fake_lock();
            again = camera->set_ups > made;
            fake_unlock();
        }
        took_ns[i] = fv_test_now_ns() - begin_ns;
        late += took_ns[i] > 1000000000;
    }
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
    const struct holdings after = count_holdings();
    qsort(took_ns, (size_t)times, sizeof *took_ns, ascending);
    print_message(
        "unplugged %ld times: frames again after %.3f s (median), %.3f s (worst), %ld later than 1 s\n",
        times, (double)took_ns[times / 2] * 1e-9, (double)took_ns[times - 1] * 1e-9, late);
    assert_true(late <= 1 + times / 100); /* a machine may stand still for a second */
    assert_int_equal(before.descriptors, after.descriptors);
#ifndef FOVEA_SANITIZED
    assert_int_equal(before.heap_bytes, after.heap_bytes);
#endif
    assert_true(fv_test_counts(source).recovered == (uint64_t)times);
    fv_test_finish(source);
    fake_end();
    free(took_ns);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_unplugged_over_and_over)};
    if (argc > 1) times = atol(argv[1]) > 3 ? atol(argv[1]) : 3;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
