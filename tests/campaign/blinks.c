/* A light that blinks before a camera of 60 Hz, as the feed of a run: frames are stamped when they
 * are seen, and come to the feed 5 ms later, as after a loop. For blinks.py, which looks when the
 * blinks are seen in a browser.
 *
 * Usage: blinks SOCKET. Prints a line for each change of the light: its stamp (CLOCK_MONOTONIC, ns)
 * and the level. Ends with its standard input. */
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "app/network/feed.h"
#include "base/elementary.h"
#include "drivers/clock.h"

enum { WIDTH = 640, HEIGHT = 480, RATE_HZ = 60, LOOP_NS = 5000000, DARK = 40, LIGHT = 200 };

static void sleep_until(int64_t due_ns)
{
    const struct timespec due = fv_clock_timespec(due_ns);
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
}

/* Something for the JPEG to do: noise of 30 levels. */
static void paint(uint8_t *pixels, int level, struct fv_random *random)
{
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)(level + (int)fv_random_below(random, 30));
}

int main(int argc, char **argv)
{
    static uint8_t pictures[2][WIDTH * HEIGHT];
    struct fovea_error error;
    struct fv_random random;
    struct fv_feed *feed = NULL;
    if (argc != 2) return (fprintf(stderr, "usage: blinks SOCKET\n"), 2);
    const struct fv_feed_setup setup = {argv[1], "BLINK", 7, sizeof pictures[0], RATE_HZ};
    if (fv_feed_open(&setup, &feed, &error) != FOVEA_OK)
        return (fprintf(stderr, "blinks: %s\n", error.text), 2);
    fv_random_seed(&random, 1);
    paint(pictures[0], DARK, &random);
    paint(pictures[1], LIGHT, &random);
    struct fovea_frame frame = {.image_count = 1, .clock = FOVEA_CLOCK_MONOTONIC};
    frame.images[0] = (struct fovea_image){.width = WIDTH,
                                           .height = HEIGHT,
                                           .stride_bytes = WIDTH,
                                           .format = FOVEA_PIXEL_GREY8,
                                           .size_bytes = sizeof pictures[0]};
    int64_t due_ns = fv_clock_ns(CLOCK_MONOTONIC);
    uint32_t left = RATE_HZ;
    for (int light = 0;; frame.sequence++, left--) {
        struct pollfd end = {.fd = STDIN_FILENO, .events = POLLIN};
        if (poll(&end, 1, 0) > 0) break;
        due_ns += FV_SECOND_NS / RATE_HZ;
        sleep_until(due_ns);
        frame.stamp_ns = fv_clock_ns(CLOCK_MONOTONIC);
        if (left == 0) {
            light = !light;
            left = 12 + fv_random_below(&random, 9);
            printf("%lld %d\n", (long long)frame.stamp_ns, light ? LIGHT : DARK);
            fflush(stdout);
        }
        frame.images[0].data = pictures[light];
        sleep_until(frame.stamp_ns + LOOP_NS);
        fv_feed_frame(feed, &frame);
    }
    fv_feed_close(feed);
    return 0;
}
