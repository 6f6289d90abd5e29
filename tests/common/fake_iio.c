#include "fake_iio.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/patience.h"

enum { SCAN_BYTES = 40 };

static char root[64], device[160], away[160], node[160];
static int fd = -1;

static void make_folders(const char *path)
{
    char part[512];
    snprintf(part, sizeof part, "%s", path);
    for (char *at = part + 1; (at = strchr(at, '/')) != NULL; at++) {
        *at = '\0';
        if (mkdir(part, 0700) != 0 && errno != EEXIST) abort();
        *at = '/';
    }
}

void fake_iio_file(const char *name, const char *value)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", device, name);
    make_folders(path);
    if (value == NULL) {
        (void)unlink(path);
        return;
    }
    FILE *file = fopen(path, "w");
    if (file == NULL || fprintf(file, "%s\n", value) < 0 || fclose(file) != 0) abort();
}

bool fake_iio_says(const char *name, const char *value)
{
    char path[512], text[256] = "";
    snprintf(path, sizeof path, "%s/%s", device, name);
    FILE *file = fopen(path, "r");
    if (file == NULL) return false;
    const bool read = fgets(text, sizeof text, file) != NULL;
    (void)fclose(file);
    text[strcspn(text, "\n")] = '\0';
    return read && strcmp(text, value) == 0;
}

bool fake_iio_comes_to_say(const char *name, const char *value)
{
    bool says = false;
    int64_t end_ns = 0;
    while (!(says = fake_iio_says(name, value)) && fv_test_patient(&end_ns, 5)) {
    }
    return says;
}

static void buffer_make(void)
{
    make_folders(node);
    if (mkfifo(node, 0600) != 0) abort();
    fd = open(node, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) abort();
}

static void buffer_remove(void)
{
    if (fd >= 0) close(fd);
    fd = -1;
    (void)unlink(node);
}

void fake_iio_make(void)
{
    static const char *const elements[] = {"anglvel_x", "anglvel_y", "anglvel_z", "accel_x",
                                           "accel_y",   "accel_z",   "temp",      "timestamp"};
    snprintf(root, sizeof root, "/tmp/fovea-fake-iio-XXXXXX");
    if (mkdtemp(root) == NULL) abort();
    snprintf(device, sizeof device, "%s/sys/bus/iio/devices/iio:device3", root);
    snprintf(away, sizeof away, "%s/unplugged", root);
    snprintf(node, sizeof node, "%s/dev/iio:device3", root);
    fake_iio_file("name", "adis16448");
    fake_iio_file("in_anglvel_scale", "0.001");
    fake_iio_file("in_accel_scale", "0.01");
    fake_iio_file("sampling_frequency", "200.000000");
    fake_iio_file("current_timestamp_clock", "realtime");
    fake_iio_file("buffer/enable", "0");
    fake_iio_file("buffer/length", "2");
    for (int i = 0; i < 8; i++) {
        char name[64], index[8];
        snprintf(name, sizeof name, "scan_elements/in_%s_en", elements[i]);
        fake_iio_file(name, i == 6 ? "1" : "0");
        snprintf(name, sizeof name, "scan_elements/in_%s_index", elements[i]);
        snprintf(index, sizeof index, "%d", i);
        fake_iio_file(name, index);
        snprintf(name, sizeof name, "scan_elements/in_%s_type", elements[i]);
        fake_iio_file(name, i == 7 ? "le:s64/64>>0" : "be:s16/32>>8");
    }
    buffer_make();
    setenv("FOVEA_IIO_ROOT", root, 1);
}

void fake_iio_remove(void)
{
    char command[128];
    buffer_remove();
    snprintf(command, sizeof command, "rm -rf '%s'", root);
    if (system(command) != 0) abort();
    unsetenv("FOVEA_IIO_ROOT");
}

static void scan_make(const int16_t raw[6], int64_t stamp_ns, uint8_t data[SCAN_BYTES])
{
    memset(data, 0xa5, SCAN_BYTES); /* bits that do not count, and the gap before the stamp */
    for (int i = 0; i < 6; i++) {
        data[4 * i + 1] = (uint8_t)((uint16_t)raw[i] >> 8);
        data[4 * i + 2] = (uint8_t)raw[i];
    }
    for (int i = 0; i < 8; i++)
        data[24 + i] = (uint8_t)((uint64_t)stamp_ns >> 8 * i);
}

enum { SCAN_USED = 32 };

bool fake_iio_scan(const int16_t raw[6], int64_t stamp_ns)
{
    uint8_t data[SCAN_BYTES];
    scan_make(raw, stamp_ns, data);
    return write(fd, data, SCAN_USED) == SCAN_USED;
}

void fake_iio_scan_in_pieces(const int16_t raw[6], int64_t stamp_ns)
{
    uint8_t data[SCAN_BYTES];
    scan_make(raw, stamp_ns, data);
    if (write(fd, data, 13) != 13) abort();
    nanosleep(&(struct timespec){.tv_nsec = 30000000}, NULL);
    if (write(fd, data + 13, SCAN_USED - 13) != SCAN_USED - 13) abort();
}

void fake_iio_unplug(void)
{
    if (rename(device, away) != 0) abort();
    buffer_remove();
}

void fake_iio_plug(void)
{
    buffer_make();
    if (rename(away, device) != 0) abort();
}
