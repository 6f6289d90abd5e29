/* The feed of a run: what a reader copies is whole or missed and counted, whatever the writer does
 * meanwhile; nobody but the writer can change it; and a reader of memory that lies is not harmed.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/feed.h"
#include "app/network/feed_reader.h"
#include "common/patience.h"

enum { WIDTH = 160, PADDED = WIDTH + 300, HEIGHT = 120, MESSAGES = 6000, BYTES_MAX = 60000 };

static char folder[] = "/tmp/fovea_feed_XXXXXX", path[64];
static struct fovea_error error;

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(path, sizeof path, "%s/s", folder);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    return rmdir(folder);
}

static struct fv_feed *offer(void)
{
    struct fv_feed *feed = NULL;
    const struct fv_feed_setup setup = {path, "T", 7, (size_t)WIDTH * HEIGHT, 1000};
    if (fv_feed_open(&setup, &feed, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return feed;
}

static struct fv_feed_reader *read_feed(void)
{
    struct fv_feed_reader *reader = NULL;
    if (fv_feed_reader_open(path, 1000000, &reader, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return reader;
}

/* ---- while the writer writes ----------------------------------------------------------------- */

/* The bytes of message `n`: as many as a random length, all from `n`. */
static uint32_t fill(uint64_t n, uint8_t *data)
{
    const uint64_t mixed = n * UINT64_C(0x9E3779B97F4A7C15);
    const uint32_t bytes = 8 + (uint32_t)(mixed >> 40) % (n % 50 == 0 ? BYTES_MAX - 8 : 3000);
    memcpy(data, &n, sizeof n);
    for (uint32_t i = 8; i < bytes; i++)
        data[i] = (uint8_t)((mixed >> 20) + i * (n | 1));
    return bytes;
}

/* Write six times the ring, and a frame of one value beside each tenth message; before the second
 * and the last say so, and wait until all before was read or missed. The rows of the frame are far
 * apart; what is read is without the gaps, for which there is no room. */
static void write_all(struct fv_feed *feed, int say, int wait)
{
    static uint8_t data[BYTES_MAX], pixels[PADDED * HEIGHT];
    struct fovea_frame frame = {.image_count = 1};
    frame.images[0] = (struct fovea_image){.data = pixels,
                                           .width = WIDTH,
                                           .height = HEIGHT,
                                           .stride_bytes = PADDED,
                                           .format = FOVEA_PIXEL_GREY8,
                                           .size_bytes = sizeof pixels};
    for (uint64_t n = 1; n <= MESSAGES; n++) {
        char byte = 'x';
        if ((n == 2 || n == MESSAGES) && (write(say, &byte, 1) != 1 || read(wait, &byte, 1) != 1))
            return;
        const struct fovea_message message = {n % 2 == 0 ? "T_EVEN" : "T_ODD", data, fill(n, data),
                                              false};
        fv_feed_put(feed, &message);
        if (n % 10 != 0) continue;
        memset(pixels, 255, sizeof pixels);
        for (int y = 0; y < HEIGHT; y++)
            memset(pixels + y * PADDED, (int)(n / 10 % 251), WIDTH);
        frame.stamp_ns = (int64_t)n;
        fv_feed_frame(feed, &frame);
        if (n % 100 == 0) usleep(1000); /* so that readers are served on one processor too */
    }
}

static void check_message(const struct fv_feed_message *message, uint64_t *last)
{
    static uint8_t expected[BYTES_MAX];
    uint64_t n;
    assert_true(message->bytes >= sizeof n);
    memcpy(&n, message->data, sizeof n);
    assert_true(n > *last && n <= MESSAGES);
    assert_string_equal(message->channel, n % 2 == 0 ? "T_EVEN" : "T_ODD");
    assert_int_equal(message->bytes, fill(n, expected));
    assert_memory_equal(message->data, expected, message->bytes);
    *last = n;
}

static bool check_frame(struct fv_feed_reader *reader)
{
    struct fv_feed_frame frame;
    const uint8_t *images;
    if (fv_feed_reader_frame(reader, &frame, &images) != FOVEA_OK) return false;
    assert_int_equal(frame.image_count, 1);
    assert_int_equal(frame.images[0].bytes, WIDTH * HEIGHT);
    const uint8_t value = (uint8_t)(frame.stamp_ns / 10 % 251);
    int wrong = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        wrong += images[frame.images[0].offset + (uint64_t)i] != value;
    assert_int_equal(wrong, 0);
    return true;
}

struct reading {
    uint64_t got, first, last, frames;
};

/* Read until the last message; a sleepy reader looks away until the writer waits for its last. */
static void read_all(struct fv_feed_reader *reader, struct reading *reading, bool sleepy, int said,
                     int go)
{
    struct fv_feed_message message;
    char byte;
    for (int pauses = 0; reading->last < MESSAGES;) {
        struct pollfd polled = {said, POLLIN, 0};
        const bool asleep = sleepy && pauses == 1;
        const bool paused = poll(&polled, 1, asleep ? -1 : 0) == 1 && read(said, &byte, 1) == 1;
        while (fv_feed_reader_next(reader, &message) == FOVEA_OK) {
            check_message(&message, &reading->last);
            if (reading->got++ == 0) reading->first = reading->last;
            if (reading->got % 5 == 0) reading->frames += check_frame(reader);
        }
        pauses += paused;
        if (paused) assert_int_equal(write(go, &byte, 1), 1);
    }
    reading->frames += check_frame(reader);
}

/* Until the feed knows of the reader and its wish: as the child of the writer inherits it. */
static void await_reader(struct fv_feed *feed, struct fv_feed_reader *reader)
{
    static uint8_t pixels[WIDTH * HEIGHT];
    const struct fovea_message probe = {"T_PROBE", pixels, 8, false};
    struct fovea_frame frame = {.image_count = 1};
    struct fv_feed_message message;
    struct fv_feed_frame read;
    const uint8_t *images;
    frame.images[0] = (struct fovea_image){.data = pixels,
                                           .width = WIDTH,
                                           .height = HEIGHT,
                                           .stride_bytes = WIDTH,
                                           .size_bytes = sizeof pixels};
    while (fv_feed_reader_frame(reader, &read, &images) != FOVEA_OK) {
        fv_feed_frame(feed, &frame);
        fv_feed_put(feed, &probe);
        usleep(1000);
    }
    while (fv_feed_reader_next(reader, &message) == FOVEA_OK) {
    }
}

static void what_is_read_is_whole_and_the_rest_is_counted(void **state)
{
    (void)state;
    for (int sleepy = 0; sleepy < 2; sleepy++) {
        struct reading reading = {0};
        int said[2] = {-1, -1}, go[2] = {-1, -1};
        struct fv_feed *feed = offer();
        struct fv_feed_reader *reader = read_feed();
        assert_true(pipe(said) == 0 && pipe(go) == 0);
        await_reader(feed, reader);
        const pid_t writer = fork();
        if (writer == 0) {
            write_all(feed, said[1], go[0]);
            _exit(0);
        }
        read_all(reader, &reading, sleepy != 0, said[0], go[1]);
        const uint64_t missed = fv_feed_reader_missed(reader);
        print_message("%llu messages, %llu missed, %llu frames\n", (unsigned long long)reading.got,
                      (unsigned long long)missed, (unsigned long long)reading.frames);
        assert_int_equal(reading.first, 1);
        assert_int_equal(reading.got + missed, MESSAGES);
        assert_true(reading.frames > 0 && (sleepy == 0 || missed > 0));
        waitpid(writer, NULL, 0);
        fv_feed_reader_close(reader);
        fv_feed_close(feed);
        for (int i = 0; i < 2; i++)
            assert_true(close(said[i]) == 0 && close(go[i]) == 0);
    }
}

static void without_readers_nothing_is_written_and_the_end_is_seen(void **state)
{
    (void)state;
    const uint8_t data[8] = {1};
    const struct fovea_message message = {"T_X", data, sizeof data, false};
    struct fv_feed_message read;
    struct fv_feed *feed = offer();
    fv_feed_put(feed, &message);
    struct fv_feed_reader *reader = read_feed();
    assert_int_equal(fv_feed_reader_next(reader, &read), FOVEA_AGAIN);
    int64_t end_ns = 0;
    while (fv_feed_reader_next(reader, &read) == FOVEA_AGAIN && fv_test_patient(&end_ns, 1))
        fv_feed_put(feed, &message); /* until the feed knows of the reader */
    assert_int_equal(read.bytes, sizeof data);
    fv_feed_close(feed);
    while (fv_feed_reader_next(reader, &read) == FOVEA_OK) {
    }
    assert_int_equal(fv_feed_reader_next(reader, &read), FOVEA_END);
    fv_feed_reader_close(reader);
    assert_int_not_equal(access(path, F_OK), 0);
}

/* ---- who may do what ------------------------------------------------------------------------- */

static int plain_connect(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int to = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(connect(to, (const struct sockaddr *)&address, sizeof address), 0);
    return to;
}

/* The descriptor of the memory, as a program without our reader gets it; -1: none. */
static int memory_of(int from)
{
    uint8_t byte, room[CMSG_SPACE(sizeof(int))];
    struct iovec data = {&byte, 1};
    struct msghdr message = {
        .msg_iov = &data, .msg_iovlen = 1, .msg_control = room, .msg_controllen = sizeof room};
    int memory = -1;
    if (recvmsg(from, &message, 0) != 1) return -1;
    const struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    if (head != NULL) memcpy(&memory, CMSG_DATA(head), sizeof memory);
    return memory;
}

static void nobody_else_can_write(void **state)
{
    (void)state;
    struct stat there;
    struct fv_feed *feed = offer();
    assert_int_equal(lstat(path, &there), 0);
    assert_int_equal(there.st_mode & 07777, 0660);
    const int from = plain_connect(), memory = memory_of(from);
    assert_true(memory >= 0);
    assert_int_equal(ftruncate(memory, 0), -1);
    assert_int_equal(ftruncate(memory, 1 << 28), -1);
    assert_int_equal(pwrite(memory, "x", 1, 0), -1);
    assert_ptr_equal(mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0), MAP_FAILED);
    void *mapped = mmap(NULL, 4096, PROT_READ, MAP_SHARED, memory, 0);
    assert_ptr_not_equal(mapped, MAP_FAILED);
    assert_int_equal(mprotect(mapped, 4096, PROT_READ | PROT_WRITE), -1);
    munmap(mapped, 4096);
    close(memory);
    close(from);
    fv_feed_close(feed);
}

static int descriptors(void)
{
    int count = 0;
    DIR *listed = opendir("/proc/self/fd");
    assert_non_null(listed);
    while (readdir(listed) != NULL)
        count++;
    closedir(listed);
    return count;
}

/* As many readers as there are places, the next is turned away; connections that come and go, with
 * half a wish or nonsense, leave nothing behind. */
static void readers_are_bounded_and_leave_nothing_behind(void **state)
{
    (void)state;
    const int before = descriptors();
    struct fv_feed *feed = offer();
    struct fv_feed_reader *readers[FV_FEED_READERS_MAX], *more = NULL;
    for (int i = 0; i < 1000; i++) {
        const int from = plain_connect();
        if (i % 3 == 0) assert_int_equal(send(from, "abc", 3, MSG_NOSIGNAL), 3);
        if (i % 3 == 1) (void)!send(from, path, sizeof path, MSG_NOSIGNAL);
        close(from);
    }
    for (int i = 0; i < FV_FEED_READERS_MAX; i++) {
        int64_t end_ns = 0;
        while (fv_feed_reader_open(path, 0, &readers[i], &error) != FOVEA_OK &&
               fv_test_patient(&end_ns, 1)) { /* until the old ones are gone */
        }
        assert_non_null(readers[i]);
    }
    assert_int_equal(fv_feed_reader_open(path, 0, &more, &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "fewer than 16 readers"));
    for (int i = 0; i < FV_FEED_READERS_MAX; i++)
        fv_feed_reader_close(readers[i]);
    fv_feed_close(feed);
    assert_int_equal(descriptors(), before);
}

static void a_socket_left_behind_is_replaced_and_nothing_else(void **state)
{
    (void)state;
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    struct fv_feed *second = NULL;
    const struct fv_feed_setup setup = {path, "T", 7, 100, 0};
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int left = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(left, (const struct sockaddr *)&address, sizeof address), 0);
    close(left);
    struct fv_feed *feed = offer();
    assert_int_equal(fv_feed_open(&setup, &second, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "the socket of another run"));
    fv_feed_reader_close(read_feed()); /* it is still there */
    fv_feed_close(feed);
    FILE *file = fopen(path, "w");
    assert_true(file != NULL && fputs("kept", file) >= 0 && fclose(file) == 0);
    assert_int_equal(fv_feed_open(&setup, &second, &error), FOVEA_ERROR_INPUT);
    assert_null(second);
    assert_int_equal(access(path, F_OK), 0);
    assert_int_equal(unlink(path), 0);
}

/* ---- a writer that lies ---------------------------------------------------------------------- */

static uint64_t random_state = 1;

static uint64_t random_next(void)
{
    random_state = random_state * UINT64_C(6364136223846793005) + 1442695040888963407u;
    return random_state >> 20;
}

/* The memory of a feed in which something is wrong, sealed or not. */
static int forged_memory(const uint8_t *good, size_t bytes)
{
    const int memory = memfd_create("forged", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    assert_true(memory >= 0 && ftruncate(memory, (off_t)bytes) == 0);
    uint8_t *mapped = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
    assert_ptr_not_equal(mapped, MAP_FAILED);
    memcpy(mapped, good, bytes);
    for (uint64_t i = random_next() % 8; i > 0; i--) {
        const bool head = random_next() % 2 == 0;
        const size_t slots = FV_FEED_HEADER_BYTES + FV_FEED_RING_BYTES;
        const size_t at = head                     ? random_next() % 256
                          : random_next() % 2 == 0 ? FV_FEED_HEADER_BYTES + random_next() % 2048
                                                   : slots + random_next() % 256;
        const uint64_t value = random_next() % 3 == 0 ? random_next() << 24 : random_next() % 4096;
        memcpy(mapped + at / 8 * 8, &value, sizeof value);
    }
    munmap(mapped, bytes);
    if (random_next() % 8 != 0) assert_int_equal(fcntl(memory, F_ADD_SEALS, F_SEAL_SHRINK), 0);
    return memory;
}

static void serve_once(int listening, int memory)
{
    const int to = accept(listening, NULL, NULL);
    uint8_t byte = 0, room[CMSG_SPACE(sizeof(int))] = {0};
    struct iovec data = {&byte, 1};
    struct msghdr message = {
        .msg_iov = &data, .msg_iovlen = 1, .msg_control = room, .msg_controllen = sizeof room};
    struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    if (head == NULL) return;
    *head = (struct cmsghdr){CMSG_LEN(sizeof(int)), SOL_SOCKET, SCM_RIGHTS};
    memcpy(CMSG_DATA(head), &memory, sizeof memory);
    (void)!sendmsg(to, &message, MSG_NOSIGNAL);
    (void)!read(to, &byte, 1); /* until the reader is done */
    (void)!read(to, room, sizeof room);
    close(to);
}

/* A good feed with messages and a frame, as bytes. */
static uint8_t *good_memory(size_t *bytes)
{
    static uint8_t data[BYTES_MAX], pixels[WIDTH * HEIGHT];
    struct stat size;
    int64_t end_ns = 0;
    struct fv_feed *feed = offer();
    const int from = plain_connect(), memory = memory_of(from);
    const uint32_t wish = 1000000;
    assert_int_equal(send(from, &wish, sizeof wish, 0), sizeof wish);
    struct fovea_frame frame = {.image_count = 1};
    frame.images[0] = (struct fovea_image){.data = pixels,
                                           .width = WIDTH,
                                           .height = HEIGHT,
                                           .stride_bytes = WIDTH,
                                           .size_bytes = sizeof pixels};
    assert_int_equal(fstat(memory, &size), 0);
    *bytes = (size_t)size.st_size;
    void *mapped = mmap(NULL, *bytes, PROT_READ, MAP_SHARED, memory, 0);
    struct fv_feed_header *header = mapped;
    while (atomic_load(&header->frames) == 0 && fv_test_patient(&end_ns, 1))
        fv_feed_frame(feed, &frame); /* until the feed knows what is asked for */
    assert_true(atomic_load(&header->frames) > 0);
    for (uint64_t n = 1; n < 500; n++) {
        const struct fovea_message message = {"T_X", data, fill(n, data), false};
        fv_feed_put(feed, &message);
        fv_feed_frame(feed, &frame);
        usleep(n % 50 == 0 ? 1000 : 0);
    }
    uint8_t *copy = malloc(*bytes);
    assert_non_null(copy);
    memcpy(copy, mapped, *bytes);
    munmap(mapped, *bytes);
    close(memory);
    close(from);
    fv_feed_close(feed);
    return copy;
}

/* The reader sees what is written after it came, so the writer's position goes back here: it
 * believes all that stands before the end to be new. */
static void rewind_reader(uint8_t *memory)
{
    struct fv_feed_header *header = (struct fv_feed_header *)(void *)memory;
    atomic_store(&header->written, random_next() % 4 * 128);
}

static void memory_that_lies_does_no_harm(void **state)
{
    (void)state;
    size_t bytes;
    uint64_t opened = 0;
    uint8_t *good = good_memory(&bytes);
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    const int listening = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(listening, (const struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(listening, 4), 0);
    rewind_reader(good);
    for (int i = 0; i < 300; i++) {
        const int memory = forged_memory(good, bytes);
        const pid_t server = fork();
        if (server == 0) {
            serve_once(listening, memory);
            _exit(0);
        }
        struct fv_feed_reader *reader = NULL;
        if (fv_feed_reader_open(path, 0, &reader, &error) == FOVEA_OK) {
            uint8_t *mapped = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
            struct fv_feed_header *header = (struct fv_feed_header *)(void *)mapped;
            struct fv_feed_message message;
            struct fv_feed_frame frame;
            const uint8_t *images;
            uint64_t sum = 0;
            opened++;
            if (random_next() % 2 == 0)
                atomic_store(&header->written, atomic_load(&header->begun));
            else
                atomic_fetch_add(&header->written, random_next() % 100 * 64);
            for (int k = 0; k < 2000 && fv_feed_reader_next(reader, &message) == FOVEA_OK; k++)
                for (uint32_t b = 0; b < message.bytes; b++)
                    sum += message.data[b];
            if (fv_feed_reader_frame(reader, &frame, &images) == FOVEA_OK)
                for (uint32_t c = 0; c < frame.image_count; c++)
                    for (uint64_t b = 0; b < frame.images[c].bytes; b++)
                        sum += images[frame.images[c].offset + b];
            assert_true(sum != 1);
            munmap(mapped, bytes);
        }
        fv_feed_reader_close(reader);
        close(memory);
        waitpid(server, NULL, 0);
    }
    assert_true(opened > 30 && opened < 300);
    close(listening);
    unlink(path);
    free(good);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_read_is_whole_and_the_rest_is_counted),
        cmocka_unit_test(without_readers_nothing_is_written_and_the_end_is_seen),
        cmocka_unit_test(nobody_else_can_write),
        cmocka_unit_test(readers_are_bounded_and_leave_nothing_behind),
        cmocka_unit_test(a_socket_left_behind_is_replaced_and_nothing_else),
        cmocka_unit_test(memory_that_lies_does_no_harm),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
