#include "device.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { VALUE_BYTES = 256, BUFFER_SCANS = 128 };

static const char *const devices_folder = "/sys/bus/iio/devices";

/* ---- files of sysfs -------------------------------------------------------------------------- */

static bool path_of(const char *folder, const char *file, char path[FV_IIO_PATH_BYTES])
{
    const int length = snprintf(path, FV_IIO_PATH_BYTES, "%s/%s", folder, file);
    return length > 0 && length < FV_IIO_PATH_BYTES;
}

/* A file's text without the newline. */
static bool value_read(const char *folder, const char *file, char value[VALUE_BYTES])
{
    char path[FV_IIO_PATH_BYTES];
    if (!path_of(folder, file, path)) return false;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) return false;
    const ssize_t bytes = read(fd, value, VALUE_BYTES - 1);
    close(fd);
    if (bytes < 0) return false;
    value[bytes] = '\0';
    value[strcspn(value, "\n")] = '\0';
    return true;
}

/* Write unless it says so already. False: refused; errno. */
static bool value_write(const char *folder, const char *file, const char *value)
{
    char path[FV_IIO_PATH_BYTES], found[VALUE_BYTES];
    if (value_read(folder, file, found) && strcmp(found, value) == 0) return true;
    if (!path_of(folder, file, path)) return false;
    const int fd = open(path, O_WRONLY | O_CLOEXEC | O_TRUNC);
    if (fd < 0) return false;
    const size_t length = strlen(value);
    const bool written = write(fd, value, length) == (ssize_t)length;
    const int why = errno;
    close(fd);
    errno = why;
    return written;
}

static bool number_read(const char *folder, const char *file, double *number)
{
    char value[VALUE_BYTES], *end;
    if (!value_read(folder, file, value)) return false;
    const double found = strtod(value, &end);
    if (end == value || *end != '\0' || !(found > -1e12 && found < 1e12)) return false;
    *number = found;
    return true;
}

/* ---- finding --------------------------------------------------------------------------------- */

/* N of "iio:deviceN"; -1: another name. */
static long number_of(const char *entry)
{
    static const char start[] = "iio:device";
    if (strncmp(entry, start, sizeof start - 1) != 0) return -1;
    char *end;
    const long number = strtol(entry + sizeof start - 1, &end, 10);
    return *end == '\0' && end != entry + sizeof start - 1 ? number : -1;
}

static bool is_wanted(const struct fv_iio_device *device, const char *folder, const char *entry)
{
    char value[VALUE_BYTES];
    return strcmp(entry, device->name) == 0 ||
           (value_read(folder, "name", value) && strcmp(value, device->name) == 0) ||
           (value_read(folder, "label", value) && strcmp(value, device->name) == 0);
}

/* FOVEA_GONE: `error` lists those that there are. */
static enum fovea_status find(struct fv_iio_device *device, struct fovea_error *error)
{
    char all[FV_IIO_PATH_BYTES], folder[FV_IIO_PATH_BYTES], name[VALUE_BYTES], list[200] = "";
    long best = -1;
    snprintf(all, sizeof all, "%s%s", device->root, devices_folder);
    DIR *entries = opendir(all);
    const struct dirent *entry;
    while (entries != NULL && (entry = readdir(entries)) != NULL) {
        const long number = number_of(entry->d_name);
        if (number < 0 || !path_of(all, entry->d_name, folder)) continue;
        const size_t used = strlen(list);
        if (value_read(folder, "name", name))
            snprintf(list + used, sizeof list - used, "%s%.60s", used > 0 ? ", " : "", name);
        if (!is_wanted(device, folder, entry->d_name) || (best >= 0 && number > best)) continue;
        best = number;
        memcpy(device->folder, folder, sizeof folder);
    }
    if (entries != NULL) closedir(entries);
    if (best >= 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_GONE,
                           "imu: iio:%s: found no such device, expected one of: %s", device->name,
                           list[0] != '\0' ? list : "(there is none)");
}

/* ---- what it has ----------------------------------------------------------------------------- */

static const char *const element_names[FV_IIO_ELEMENTS] = {
    "in_anglvel_x", "in_anglvel_y", "in_anglvel_z", "in_accel_x",
    "in_accel_y",   "in_accel_z",   "in_timestamp",
};

static enum fovea_status lacks(const struct fv_iio_device *device, const char *file,
                               const char *expected, struct fovea_error *error)
{
    char value[VALUE_BYTES];
    const bool there = value_read(device->folder, file, value);
    return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                           "imu: iio:%s: %s: found %s%.60s%s, expected %s", device->name, file,
                           there ? "'" : "", there ? value : "none", there ? "'" : "", expected);
}

/* A number that stands for all axes ("in_accel_scale") or for each ("in_accel_x_scale"). */
static bool shared_number(const struct fv_iio_device *device, const char *element, const char *of,
                          double *number)
{
    char file[64];
    snprintf(file, sizeof file, "%s_%s", element, of);
    if (number_read(device->folder, file, number)) return true;
    snprintf(file, sizeof file, "%.*s_%s", (int)strlen(element) - 2, element, of);
    return number_read(device->folder, file, number);
}

static enum fovea_status element_read(struct fv_iio_device *device, int i,
                                      struct fovea_error *error)
{
    struct fv_iio_element *element = &device->scan.elements[i];
    char file[64], value[VALUE_BYTES];
    double index;
    snprintf(file, sizeof file, "scan_elements/%s_index", element_names[i]);
    if (!number_read(device->folder, file, &index) || index < 0 || index > 1000)
        return lacks(device, file, "its place in the buffer", error);
    snprintf(file, sizeof file, "scan_elements/%s_type", element_names[i]);
    if (!value_read(device->folder, file, value) || !fv_iio_type_parse(value, &element->type))
        return lacks(device, file, "a type such as le:s16/16>>0", error);
    element->index = (uint32_t)index;
    element->scale = 1;
    element->shift = 0;
    if (i == FV_IIO_STAMP) return FOVEA_OK;
    if (!shared_number(device, element_names[i], "scale", &element->scale) || element->scale == 0) {
        snprintf(file, sizeof file, "%.*s_scale", (int)strlen(element_names[i]) - 2,
                 element_names[i]);
        return lacks(device, file, "a factor to SI units", error);
    }
    (void)shared_number(device, element_names[i], "offset", &element->shift);
    return FOVEA_OK;
}

/* Of a sort of axes, or of all; where there is none, the axes stand as they are. */
static enum fovea_status mount_read(struct fv_iio_device *device, const char *own, double matrix[9],
                                    struct fovea_error *error)
{
    static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const char *const files[] = {own, "in_mount_matrix", "mount_matrix"};
    char value[VALUE_BYTES];
    memcpy(matrix, identity, sizeof identity);
    for (int i = 0; i < 3; i++) {
        if (!value_read(device->folder, files[i], value) || value[0] == '\0') continue;
        if (fv_iio_matrix_parse(value, matrix)) return FOVEA_OK;
        return lacks(device, files[i], "a rotation such as 1, 0, 0; 0, 1, 0; 0, 0, 1", error);
    }
    return FOVEA_OK;
}

static enum fovea_status describe(struct fv_iio_device *device, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (int i = 0; i < FV_IIO_ELEMENTS && status == FOVEA_OK; i++)
        status = element_read(device, i, error);
    if (status == FOVEA_OK)
        status = mount_read(device, "in_anglvel_mount_matrix", device->scan.gyro_mount, error);
    if (status == FOVEA_OK)
        status =
            mount_read(device, "in_accel_mount_matrix", device->scan.acceleration_mount, error);
    if (status == FOVEA_OK && !fv_iio_scan_lay(&device->scan))
        status = lacks(device, "scan_elements/in_timestamp_type",
                       "64 bits, and places in the buffer that differ", error);
    return status;
}

/* ---- setting up ------------------------------------------------------------------------------ */

/* Ours into the buffer, others out of it. */
static enum fovea_status elements_choose(struct fv_iio_device *device, struct fovea_error *error)
{
    char folder[FV_IIO_PATH_BYTES], file[320];
    if (!path_of(device->folder, "scan_elements", folder)) return FOVEA_GONE;
    DIR *entries = opendir(folder);
    const struct dirent *entry;
    enum fovea_status status = entries != NULL ? FOVEA_OK : FOVEA_GONE;
    while (status == FOVEA_OK && (entry = readdir(entries)) != NULL) {
        const size_t length = strlen(entry->d_name);
        bool ours = false;
        if (length < 3 || strcmp(entry->d_name + length - 3, "_en") != 0) continue;
        for (int i = 0; i < FV_IIO_ELEMENTS; i++)
            ours = ours || (strlen(element_names[i]) == length - 3 &&
                            strncmp(entry->d_name, element_names[i], length - 3) == 0);
        snprintf(file, sizeof file, "scan_elements/%s", entry->d_name);
        if (!value_write(device->folder, file, ours ? "1" : "0"))
            status = fovea_error_set(
                error, FOVEA_ERROR_SYSTEM,
                "imu: iio:%s: %.80s: cannot be written: %s (needs the rights to set up the buffer: root, or udev rules)",
                device->name, file, strerror(errno));
    }
    if (entries != NULL) closedir(entries);
    return status;
}

/* The rate, where it is asked for and the device takes it; what it is then. */
static void rate_choose(struct fv_iio_device *device, struct fovea_error *notice)
{
    static const char *const files[] = {"sampling_frequency", "in_anglvel_sampling_frequency",
                                        "in_accel_sampling_frequency", "in_sampling_frequency"};
    char value[32];
    snprintf(value, sizeof value, "%.6g", device->asked_hz);
    for (int i = 0; i < 4; i++) {
        double found;
        if (!number_read(device->folder, files[i], &found)) continue;
        if (device->asked_hz > 0 && found != device->asked_hz)
            (void)value_write(device->folder, files[i], value);
        (void)number_read(device->folder, files[i], &found);
        if (device->rate_hz == 0 || i == 1) device->rate_hz = found;
    }
    const double off = device->rate_hz - device->asked_hz;
    if (device->asked_hz > 0 && device->rate_hz > 0 &&
        (off > 0.05 * device->asked_hz || off < -0.05 * device->asked_hz))
        fovea_error_set(notice, FOVEA_OK, "imu: iio:%s: gives %g samples per second, expected %g",
                        device->name, device->rate_hz, device->asked_hz);
}

/* Stamps of CLOCK_MONOTONIC where the kernel lets choose (4.5 and later). */
static void clock_choose(struct fv_iio_device *device)
{
    static const struct {
        const char *name;
        clockid_t clock;
    } clocks[] = {{"monotonic", CLOCK_MONOTONIC},
                  {"boottime", CLOCK_BOOTTIME},
                  {"monotonic_raw", CLOCK_MONOTONIC_RAW},
                  {"monotonic_coarse", CLOCK_MONOTONIC_COARSE}};
    char value[VALUE_BYTES];
    (void)value_write(device->folder, "current_timestamp_clock", "monotonic");
    device->clock = CLOCK_REALTIME;
    if (!value_read(device->folder, "current_timestamp_clock", value)) return;
    for (int i = 0; i < 4; i++)
        if (strcmp(value, clocks[i].name) == 0) device->clock = clocks[i].clock;
}

/* Drivers name their own trigger "NAME-devN"; where none is chosen yet, it is the one. */
static void trigger_choose(const struct fv_iio_device *device)
{
    char value[VALUE_BYTES], name[VALUE_BYTES], trigger[VALUE_BYTES + 32];
    if (!value_read(device->folder, "trigger/current_trigger", value) || value[0] != '\0') return;
    if (!value_read(device->folder, "name", name)) return;
    snprintf(trigger, sizeof trigger, "%s-dev%ld", name,
             number_of(strrchr(device->folder, '/') + 1));
    (void)value_write(device->folder, "trigger/current_trigger", trigger);
}

static enum fovea_status buffer_open(struct fv_iio_device *device, struct fovea_error *error)
{
    char path[FV_IIO_PATH_BYTES], length[16];
    snprintf(length, sizeof length, "%d", BUFFER_SCANS);
    (void)value_write(device->folder, "buffer/length", length);
    (void)value_write(device->folder, "buffer/watermark", "1");
    if (!value_write(device->folder, "buffer/enable", "1"))
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "imu: iio:%s: buffer/enable: cannot be written: %s", device->name,
                               strerror(errno));
    const int bytes =
        snprintf(path, sizeof path, "%s/dev%s", device->root, strrchr(device->folder, '/'));
    if (bytes < 0 || bytes >= (int)sizeof path) return FOVEA_GONE;
    device->fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (device->fd >= 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "imu: iio:%s: %.200s: cannot be opened: %s",
                           device->name, path, strerror(errno));
}

enum fovea_status fv_iio_device_set_up(struct fv_iio_device *device, struct fovea_error *error)
{
    struct fovea_error notice = {.text = ""};
    device->fd = -1;
    device->rate_hz = 0;
    enum fovea_status status = find(device, error);
    if (status != FOVEA_OK) return status;
    (void)value_write(device->folder, "buffer/enable", "0");
    status = describe(device, error);
    if (status == FOVEA_OK) status = elements_choose(device, error);
    if (status != FOVEA_OK) return status;
    rate_choose(device, &notice);
    clock_choose(device);
    trigger_choose(device);
    status = buffer_open(device, error);
    if (status != FOVEA_OK)
        fv_iio_device_tear_down(device);
    else
        *error = notice;
    return status;
}

void fv_iio_device_tear_down(struct fv_iio_device *device)
{
    if (device->fd >= 0) close(device->fd);
    device->fd = -1;
    (void)value_write(device->folder, "buffer/enable", "0");
}
