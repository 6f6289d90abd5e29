/* The cameras of libcamera (drivers/cameras.h): its process is started once, to print them. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../cameras.h"
#include "../clock.h"
#include "../plugin.h"
#include "client.h"

extern char **environ;

enum { TEXT_BYTES = 1 << 18, FIELDS_MAX = 8 };

/* ---- what it prints (protocol.h) ------------------------------------------------------------- */

static size_t split(char *line, char *fields[FIELDS_MAX])
{
    size_t count = 0;
    for (char *rest = line; rest != NULL && count < FIELDS_MAX;)
        fields[count++] = strsep(&rest, "\t");
    return count;
}

static const struct fv_libcamera_format *format_of(const char *theirs, int32_t *rank)
{
#define TABLE_ROW(name, pixels, format) {name, pixels, format},
    static const struct fv_libcamera_format formats[] = {FV_LIBCAMERA_FORMATS(TABLE_ROW)};
    for (size_t i = 0; i < sizeof formats / sizeof formats[0]; i++) {
        *rank = (int32_t)i;
        if (strcmp(formats[i].theirs, theirs) == 0) return &formats[i];
    }
    *rank = 0;
    return NULL;
}

static void add_mode(struct fv_camera *camera, char *const fields[], size_t count)
{
    if (count < 4 || camera->mode_count == FV_CAMERA_MODES_MAX) return;
    struct fv_camera_mode *mode = &camera->modes[camera->mode_count++];
    const struct fv_libcamera_format *format = format_of(fields[1], &mode->rank);
    snprintf(mode->format, sizeof mode->format, "%.15s", format != NULL ? format->name : fields[1]);
    mode->read = format != NULL;
    mode->width = mode->width_max = (int32_t)strtol(fields[2], NULL, 10);
    mode->height = mode->height_max = (int32_t)strtol(fields[3], NULL, 10);
    if (count < 6) return;
    mode->rates_hz[0] = strtod(fields[4], NULL);
    mode->rates_hz[1] = strtod(fields[5], NULL);
    mode->any_rate = mode->rates_hz[1] > 0 && mode->rates_hz[0] > mode->rates_hz[1];
    mode->rate_count = mode->any_rate ? 2 : mode->rates_hz[0] > 0 ? 1 : 0;
}

static void add_control(struct fv_camera *camera, char *const fields[], size_t count)
{
    if (count < 5 || camera->control_count == FV_CAMERA_CONTROLS_MAX) return;
    struct fv_camera_control *control = &camera->controls[camera->control_count++];
    char *end;
    snprintf(control->name, sizeof control->name, "%.63s", fields[1]);
    control->minimum = strtod(fields[2], &end);
    control->has_range = end != fields[2];
    control->maximum = strtod(fields[3], NULL);
    control->standard = strtod(fields[4], NULL);
}

static void take_line(char *line, struct fv_camera *cameras, size_t capacity, size_t *count,
                      size_t first)
{
    char *fields[FIELDS_MAX] = {line};
    const size_t found = split(line, fields);
    if (strcmp(fields[0], "camera") == 0 && found >= 3 && *count < capacity) {
        struct fv_camera *camera = &cameras[(*count)++];
        memset(camera, 0, sizeof *camera);
        camera->driver = "libcamera";
        snprintf(camera->name, sizeof camera->name, "%.255s", fields[1]);
        snprintf(camera->model, sizeof camera->model, "%.127s", fields[2]);
    } else if (*count > first && strcmp(fields[0], "format") == 0) {
        add_mode(&cameras[*count - 1], fields, found);
    } else if (*count > first && strcmp(fields[0], "control") == 0) {
        add_control(&cameras[*count - 1], fields, found);
    } else if (*count > first && strcmp(fields[0], "trouble") == 0 && found >= 2) {
        snprintf(cameras[*count - 1].trouble, sizeof cameras[0].trouble, "%.159s", fields[1]);
    }
}

/* ---- the process ----------------------------------------------------------------------------- */

static int spawn(const char *path, int out, pid_t *pid)
{
    char name[] = FV_LIBCAMERA_PROGRAM, list[] = FV_LIBCAMERA_LIST;
    char *arguments[] = {name, list, NULL};
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
    const int failure = posix_spawn(pid, path, &files, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&files);
    return failure;
}

/* All that it prints until it ends. False: it did not within the time that a request has. */
static bool read_all(int fd, char text[TEXT_BYTES])
{
    const int64_t end_ns = fv_clock_ns(CLOCK_MONOTONIC) + fv_libcamera_answer_ns;
    size_t used = 0;
    for (;;) {
        const int64_t left_ns = end_ns - fv_clock_ns(CLOCK_MONOTONIC);
        struct pollfd one = {.fd = fd, .events = POLLIN};
        const struct timespec left = fv_clock_timespec(left_ns > 0 ? left_ns : 0);
        const int woken = ppoll(&one, 1, &left, NULL);
        if (woken == 0) return false;
        if (woken < 0) continue;
        const ssize_t bytes = read(fd, text + used, TEXT_BYTES - 1 - used);
        if (bytes < 0 && errno == EINTR) continue;
        if (bytes <= 0 || used + (size_t)bytes == TEXT_BYTES - 1) {
            text[used + (size_t)(bytes > 0 ? bytes : 0)] = '\0';
            return true;
        }
        used += (size_t)bytes;
    }
}

static enum fovea_status run(const char *path, char text[TEXT_BYTES], struct fovea_error *error)
{
    int ends[2], how = 0;
    pid_t pid;
    if (pipe2(ends, O_CLOEXEC) != 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: no pipe: %s",
                               strerror(errno));
    const int failure = spawn(path, ends[1], &pid);
    close(ends[1]);
    if (failure != 0) {
        close(ends[0]);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: %.300s cannot be started: %s",
                               path, strerror(failure));
    }
    const bool ended = read_all(ends[0], text);
    close(ends[0]);
    if (!ended) kill(pid, SIGKILL);
    while (waitpid(pid, &how, 0) < 0 && errno == EINTR) {
    }
    if (!ended)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "libcamera: it does not answer: its process was killed");
    if (WIFEXITED(how) && WEXITSTATUS(how) == 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: its process failed (%s %d)",
                           WIFSIGNALED(how) ? "signal" : "status",
                           WIFSIGNALED(how) ? WTERMSIG(how) : WEXITSTATUS(how));
}

enum fovea_status fv_cameras_libcamera(struct fv_camera *cameras, size_t capacity, size_t *count,
                                       struct fovea_error *error)
{
    static const struct fv_plugin_name name = {
        .scheme = "libcamera", .file = FV_LIBCAMERA_PROGRAM, .package = "libcamera-dev"};
    char path[FV_PLUGIN_PATH_BYTES];
    int place = 0;
    while (place < FV_PLUGIN_PLACES && !fv_plugin_path(name.file, place, path))
        place++;
    if (place == FV_PLUGIN_PLACES) return fv_plugin_missing(&name, "", error);
    if (fv_plugin_trusted(path, error) != FOVEA_OK) return FOVEA_ERROR_UNSUPPORTED;
    char *text = malloc(TEXT_BYTES);
    if (text == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: out of memory");
    const size_t first = *count;
    const enum fovea_status status = run(path, text, error);
    for (char *rest = text; status == FOVEA_OK && rest != NULL && *rest != '\0';)
        take_line(strsep(&rest, "\n"), cameras, capacity, count, first);
    free(text);
    for (size_t i = first; i < *count; i++)
        fv_camera_make_uri(&cameras[i]);
    return status;
}
