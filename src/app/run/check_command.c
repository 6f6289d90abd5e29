/* fovea check: will this configuration run on this machine, and with what memory? One line per
 * question, each ok, warning or failed, with what to do about it. */
#include <inttypes.h>
#include <malloc.h>
#include <math.h>
#include <stdarg.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "app/run/check_memory.h"
#include "app/run/commands.h"
#include "app/run/loop.h"
#include "app/run/realtime.h"
#include "app/run/self_test.h"
#include "support/say.h"
#include "app/config/imu.h"
#include "app/config/setup.h"
#include "app/network/transport_url.h"
#include "kernels/cpu.h"

struct check {
    struct fv_setup_options options;
    bool memory_only, bench;
    struct fv_settings settings;
    struct fv_setup setup;
    size_t source_bytes; /* of the heap that opening the source took */
    void *memory;
    size_t bytes;
    struct fovea *rt;
    bool locked;
    bool failed, wrong; /* a line failed; because of wrong input */
    bool absent;        /* the camera did not open */
    bool rough;         /* the calibration that the settings ask for is lacking */
};

enum verdict { OK, WARNING, FAILED };

static void line(struct check *check, enum verdict verdict, const char *what, const char *format,
                 ...) __attribute__((format(printf, 4, 5)));

static void line(struct check *check, enum verdict verdict, const char *what, const char *format,
                 ...)
{
    static const char *const names[] = {"ok", "warning", "failed"};
    va_list arguments;
    va_start(arguments, format);
    printf("%-8s %-12s ", names[verdict], what);
    vprintf(format, arguments);
    printf("\n");
    va_end(arguments);
    if (verdict == FAILED) check->failed = true;
}

/* ---- memory ---------------------------------------------------------------------------------- */

/* Bytes in use on the C library's heap, mapped pieces included. */
static size_t heap_bytes(void)
{
    struct mallinfo2 info = mallinfo2();
    return info.uordblks + info.hblkhd;
}

/* ---- the machine ----------------------------------------------------------------------------- */

static enum fovea_status kernels_check(struct check *check, struct fovea_error *error)
{
    const enum fv_cpu_set best = fv_cpu_best(fv_cpu_detect());
    enum fv_cpu_set picked;
    const enum fovea_status status = fv_cpu_from_environment(&picked, error);
    if (status != FOVEA_OK) return status;
    if (picked == best)
        line(check, OK, "kernels", "set %s, the best for this processor", fv_cpu_set_name(picked));
    else
        line(check, WARNING, "kernels", "set %s, though this processor has %s: unset FOVEA_CPU",
             fv_cpu_set_name(picked), fv_cpu_set_name(best));
    char wrong[FV_SELF_TEST_REASON_BYTES];
    fv_self_test(wrong);
    line(check, wrong[0] == '\0' ? OK : WARNING, "self-test", "%s",
         wrong[0] == '\0' ? "the kernels give the bits of plain C, and the clock goes" : wrong);
    return FOVEA_OK;
}

static void *nothing(void *argument)
{
    return argument;
}

static void rights_check(struct check *check)
{
    struct fv_realtime_rights rights;
    struct fovea_error error = {0};
    struct rlimit limit = {0};
    struct fv_realtime_thread thread;
    uint32_t priority = check->settings.priority;
    getrlimit(RLIMIT_RTPRIO, &limit);
    if (fv_realtime_start(&thread, priority, check->settings.cpu, nothing, NULL, &rights, &error) !=
        FOVEA_OK) {
        line(check, FAILED, "scheduling", "%s", error.text);
        return;
    }
    fv_realtime_join(&thread);
    if (rights.why.text[0] != '\0' && priority > 0 && !rights.fifo)
        line(check, WARNING, "scheduling",
             "%s (permanently: 'USER - rtprio %" PRIu32 "' in /etc/security/limits.conf)",
             rights.why.text, priority);
    else if (rights.why.text[0] != '\0')
        line(check, WARNING, "scheduling", "%s: set loop.cpu to one from 0 to %ld, or to -1",
             rights.why.text, sysconf(_SC_NPROCESSORS_CONF) - 1);
    else if (rights.lent)
        line(check, OK, "scheduling", "real-time as the program was started%s",
             rights.bound ? ", bound to its processor" : "");
    else if (priority == 0)
        line(check, WARNING, "scheduling",
             "ordinary, as loop.priority is 0: other programs may delay the loop");
    else
        line(check, OK, "scheduling", "SCHED_FIFO priority %" PRIu32 "%s", priority,
             rights.bound ? ", bound to its processor" : "");
}

static void lock_check(struct check *check, bool locked, const char *why)
{
    if (!check->settings.lock_memory)
        line(check, WARNING, "memory lock", "not requested: loop.lock_memory is false");
    else if (!locked)
        line(check, WARNING, "memory lock",
             "%s (permanently: 'USER - memlock unlimited' in /etc/security/limits.conf)", why);
    else
        line(check, OK, "memory lock", "the block and the program are locked");
}

static void governor_check(struct check *check)
{
    char text[64] = "";
    FILE *file = fopen("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "re");
    if (file == NULL) return; /* virtual machines have none */
    if (fscanf(file, "%63s", text) == 1 && strcmp(text, "performance") != 0)
        line(check, WARNING, "clock rate",
             "governor '%s' lets times vary: sudo cpupower frequency-set -g performance", text);
    else
        line(check, OK, "clock rate", "governor 'performance'");
    fclose(file);
}

static void commands_check(struct check *check)
{
    const struct fv_settings *settings = &check->settings;
    const bool network =
        strcmp(settings->listen, "none") != 0 && strcmp(settings->listen, "loopback") != 0;
    uint8_t key[FV_SIPHASH_KEY_BYTES];
    struct fovea_error error = {0};
    const enum fv_transport_kind kind = fv_transport_kind_of(settings->lcm_url);
    if (kind != FV_TRANSPORT_UDPM && kind != FV_TRANSPORT_TCPQ)
        line(check, WARNING, "commands", "none is received: lcm_url only sends, or is empty");
    else if (strcmp(settings->listen, "none") == 0)
        line(check, WARNING, "commands", "none is received: listen is none");
    else if (settings->command_key[0] != '\0' &&
             fv_command_key_read(settings->command_key, key, &error) != FOVEA_OK) {
        line(check, FAILED, "commands", "%s", error.text);
        check->wrong = true;
    } else if (settings->command_key[0] != '\0')
        line(check, OK, "commands", "are accepted with the key in %s", settings->command_key);
    else if (network && settings->commands != FV_COMMAND_AUTO && settings->commands != 0)
        line(check, WARNING, "commands",
             "are accepted from everybody who reaches %s: set command_key to require a proof",
             strcmp(settings->listen, "any") == 0 ? "this host" : settings->listen);
    else if (kind == FV_TRANSPORT_TCPQ && settings->commands == FV_COMMAND_AUTO)
        line(check, WARNING, "commands",
             "none is accepted: those of a server count as sent from a network (set commands or "
             "command_key)");
    else
        line(check, OK, "commands", "are accepted from programs on this host");
}

static void lcm_check(struct check *check)
{
    const char *url = check->settings.lcm_url;
    struct fovea_error error = {0};
    if (url[0] == '\0') {
        line(check, WARNING, "LCM", "nothing is sent: lcm_url is empty");
        return;
    }
    if (fv_transport_check(url, check->settings.lcm_ttl, &error) != FOVEA_OK) {
        line(check, FAILED, "LCM", "%s", error.text);
        check->wrong |= error.status == FOVEA_ERROR_INPUT;
        return;
    }
    switch (fv_transport_kind_of(url)) {
    case FV_TRANSPORT_UDPM:
        line(check, OK, "LCM", "a message over %s reaches a subscriber on this host", url);
        return;
    case FV_TRANSPORT_TCPQ:
        line(check, WARNING, "LCM",
             "the server at %s answers; when it stops reading, messages are dropped", url);
        return;
    default:
        line(check, WARNING, "LCM", "%s reaches no subscribers; udpm:// does", url);
        return;
    }
}

static size_t lcm_bytes(const struct check *check)
{
    struct fovea_error error;
    struct fv_transport *transport = NULL;
    char log[FV_TRANSPORT_URL_BYTES];
    /* A log takes as much wherever it is, and opening it would cut it. */
    const char *url = fv_transport_file(check->settings.lcm_url, log) ? "file:///dev/null?mode=w"
                                                                      : check->settings.lcm_url;
    size_t before = heap_bytes();
    if (fv_transport_open(url, check->settings.lcm_ttl, &transport, &error) != FOVEA_OK) return 0;
    size_t bytes = heap_bytes() - before;
    fv_transport_close(transport);
    return bytes;
}

/* ---- the camera ------------------------------------------------------------------------------ */

/* How far two sensors of the body are apart. */
static double distance(const double a[12], const double b[12])
{
    double sum = 0;
    for (int i = 3; i < 12; i += 4)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(sum);
}

/* A line for each camera after the first. */
static void others_check(struct check *check, const struct fovea_frame *frame)
{
    const struct fovea_rig *rig = &check->settings.runtime.rig;
    for (uint32_t i = 1; i < rig->camera_count; i++) {
        const struct fovea_rig_camera *camera = &rig->cameras[i];
        const struct fovea_image *image = &frame->images[i];
        char what[24], place[48] = "no pose on the body";
        snprintf(what, sizeof what, "camera %u", i + 1); /* as mask2 and camera2 count */
        if (camera->has_T_body_cam)
            snprintf(place, sizeof place, "%.3f m from the first",
                     distance(camera->T_body_cam, rig->cameras[0].T_body_cam));
        if (image->data == NULL)
            line(check, WARNING, what, "gives no image with the first frame; %s, %s",
                 camera->calibrated ? "calibrated" : "not calibrated", place);
        else
            line(check, camera->calibrated && camera->has_T_body_cam ? OK : WARNING, what,
                 "%d x %d %s, %s, %s", image->width, image->height,
                 fovea_pixel_format_name(image->format),
                 camera->calibrated ? "calibrated" : "not calibrated", place);
    }
}

/* The inertial sensor, and whether it gives samples with the first frame. */
static void imu_check(struct check *check, const struct fovea_frame *frame)
{
    static struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    const struct fovea_rig *rig = &check->settings.runtime.rig;
    const struct fovea_rig_imu *imu = &rig->imu;
    const struct fovea_source_ops *ops = check->setup.ops;
    uint32_t found = 0;
    if (!rig->has_imu) return;
    if (check->settings.imu[0] != '\0') {
        const bool heard = fv_imu_lcm_channel(&check->settings) == NULL;
        line(
            check, heard ? OK : WARNING, "IMU",
            "%s, %s; %g Hz; %.3f m from the first camera; noise %.2g rad/s/sqrt(Hz), %.2g m/s^2/sqrt(Hz)",
            check->settings.imu,
            heard ? "opened"
                  : "not listened to here: IMU_STATUS of a run says whether samples come",
            imu->rate_hz, distance(imu->T_body_imu, rig->cameras[0].T_body_cam), imu->gyro_noise,
            imu->acceleration_noise);
        return;
    }
    const uint32_t count = ops->samples != NULL ? ops->samples(check->setup.source, frame, samples,
                                                               FOVEA_INPUT_SAMPLES_MAX)
                                                : 0;
    for (uint32_t i = 0; i < count; i++)
        found += samples[i].kind == FOVEA_SAMPLE_IMU;
    line(check, found > 0 ? OK : WARNING, "IMU",
         "%g Hz, samples with the first frame: %u; %.3f m from the first camera; noise %.2g "
         "rad/s/sqrt(Hz), %.2g m/s^2/sqrt(Hz); %.3f ms to add to its stamps",
         imu->rate_hz, found, distance(imu->T_body_imu, rig->cameras[0].T_body_cam),
         imu->gyro_noise, imu->acceleration_noise, (double)imu->time_offset_ns * 1e-6);
}

/* What of the configuration needs the camera's calibration, where it is rough or lacking. */
static void calibration_check(struct check *check)
{
    const struct fv_settings *settings = &check->settings;
    const char *const needs[] = {settings->runtime.odometry.enabled ? "odometry.enabled" : "",
                                 settings->runtime.objects.ground ? "objects.ground" : "",
                                 settings->heights[0] != '\0' ? "objects.heights" : ""};
    char list[64] = "";
    if (settings->runtime.camera_fov_deg > 0)
        line(check, WARNING, "calibration",
             "rough, from a field of view of %g degrees: poses are marked uncalibrated",
             settings->runtime.camera_fov_deg);
    if (!check->rough) return;
    for (size_t i = 0; i < sizeof needs / sizeof needs[0]; i++) {
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s",
                 used > 0 && needs[i][0] != '\0' ? ", " : "", needs[i]);
    }
    line(check, WARNING, "calibration",
         "none, and 'fovea run' needs one for %s: 'fovea-calibrate camera --source %s --target "
         "chessboard:9x6:0.025 --out camera.yaml' makes one for --camera; --fov DEGREES gives "
         "rough poses",
         list, settings->source);
}

static void camera_check(struct check *check)
{
    const struct fovea_source_ops *ops = check->setup.ops;
    struct fovea_source *source = check->setup.source;
    struct fovea_error error;
    struct fovea_frame frame;
    int64_t begin_ns, now_ns, cpu_ns;
    const int64_t patience_ns = 5000000000;
    if (ops->start(source, &error) != FOVEA_OK) {
        line(check, FAILED, "camera", "%s", error.text);
        return;
    }
    fv_timing_clock(NULL, &begin_ns, &cpu_ns);
    enum fovea_status status = FOVEA_AGAIN;
    for (now_ns = begin_ns;
         (status == FOVEA_AGAIN || status == FOVEA_GONE) && now_ns < begin_ns + patience_ns;) {
        status = ops->dequeue(source, begin_ns + patience_ns, &frame);
        fv_timing_clock(NULL, &now_ns, &cpu_ns);
        if (status == FOVEA_GONE) nanosleep(&(struct timespec){.tv_nsec = 50000000}, NULL);
    }
    if (status == FOVEA_OK) {
        const double rate_hz = ops->info(source)->rate_hz;
        char rate[32] = "";
        if (rate_hz > 0) snprintf(rate, sizeof rate, " at %.4g Hz", rate_hz);
        line(check, OK, "camera", "%s answers: %d x %d %s%s after %.0f ms", check->settings.source,
             frame.images[0].width, frame.images[0].height,
             fovea_pixel_format_name(frame.images[0].format), rate,
             (double)(now_ns - begin_ns) * 1e-6);
        others_check(check, &frame);
        imu_check(check, &frame);
        ops->requeue(source, &frame);
    } else {
        line(
            check, FAILED, "camera",
            "%s gives no frame within 5 s (%s): is it plugged in, and not used by another program?",
            check->settings.source, fovea_status_name(status));
    }
    ops->stop(source);
    while (ops->complaint != NULL && ops->complaint(source, &error) != FOVEA_AGAIN)
        line(check, WARNING, "frames", "%s", error.text);
}

/* ---- bench ----------------------------------------------------------------------------------- */

static void *loop_body(void *argument)
{
    fv_loop_run(argument);
    return NULL;
}

/* Frames at full speed through the loop; what 99 of 100 need must fit in 85 % of a period (the
 * governor's part). */
static enum fovea_status bench(struct check *check, struct fovea_error *error)
{
    static struct fv_timings timings;
    static struct fv_loop_shared shared;
    struct fv_realtime_rights rights;
    struct fv_realtime_thread thread;
    struct fv_loop loop = {.rt = check->rt,
                           .config = &check->settings.runtime,
                           .ops = check->setup.ops,
                           .source = check->setup.source,
                           .frames_max = 600,
                           .timings = &timings,
                           .shared = &shared};
    fv_timings_init(&timings);
    enum fovea_status status = loop.ops->start(loop.source, error);
    if (status != FOVEA_OK) return status;
    status = fv_realtime_start(&thread, check->settings.priority, check->settings.cpu, loop_body,
                               &loop, &rights, error);
    if (status != FOVEA_OK) return status;
    fv_realtime_join(&thread);
    loop.ops->stop(loop.source);
    if (loop.counts.processed < 30)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: found %" PRIu64 " frames, expected 30 for a measurement",
                               check->settings.source, loop.counts.processed);
    double p99_ms = (double)fv_histogram_percentile(&timings.frame.cpu, 0.99) * 1e-6;
    double mean_ms = (double)fv_histogram_mean(&timings.frame.cpu) * 1e-6;
    line(check, OK, "frame rate",
         "this board can hold %.0f Hz: of %" PRIu64
         " frames at %d x %d 99 %% took at most %.2f ms (mean %.2f), 85 %% of a period is used",
         850.0 / p99_ms, loop.counts.processed, check->settings.runtime.rig.cameras[0].camera.width,
         check->settings.runtime.rig.cameras[0].camera.height, p99_ms, mean_ms);
    double rate_hz = loop.ops->info(loop.source)->rate_hz;
    if (rate_hz > 850.0 / p99_ms)
        line(check, WARNING, "frame rate",
             "the source gives %.1f Hz: lower features.count_max or the camera's rate", rate_hz);
    return FOVEA_OK;
}

/* ---- the command ----------------------------------------------------------------------------- */

static enum fovea_status machine_check(struct check *check, const struct fovea_error *lock,
                                       struct fovea_error *error)
{
    printf("\n");
    const enum fovea_status status = kernels_check(check, error);
    if (status != FOVEA_OK) return status;
    rights_check(check);
    if (check->memory != NULL) lock_check(check, check->locked, lock->text);
    governor_check(check);
    lcm_check(check);
    commands_check(check);
    return FOVEA_OK;
}

/* The table, and the block that it describes. */
static enum fovea_status memory_check(struct check *check, struct fovea_error *lock,
                                      struct fovea_error *error)
{
    const struct fovea_config *config = &check->settings.runtime;
    enum fovea_status status = fovea_size(config, &check->bytes, error);
    if (status == FOVEA_OK)
        status = fv_check_memory_print(
            &(struct fv_check_memory){.settings = &check->settings,
                                      .setup = &check->setup,
                                      .block = check->bytes,
                                      .source = check->source_bytes,
                                      .lcm = check->memory_only ? 0 : lcm_bytes(check)},
            error);
    if (status != FOVEA_OK || check->memory_only) return status;
    status = fv_realtime_map(check->bytes, check->settings.lock_memory, &check->memory,
                             &check->locked, lock);
    if (status == FOVEA_OK && check->locked) check->locked = fv_realtime_lock_program(lock);
    return status == FOVEA_OK ? status : fovea_error_set(error, status, "%s", lock->text);
}

/* The camera does not answer, as `error` says: everything else is checked and printed. */
static enum fovea_status check_without_source(struct check *check, enum fovea_status why,
                                              struct fovea_error *error)
{
    struct fovea_error other = {0}, lock = {0};
    enum fovea_status status = FOVEA_OK;
    if (check->settings.runtime.rig.cameras[0].camera.width > 0) {
        status = fv_setup_read(&check->settings, &check->setup, &other);
        if (status == FOVEA_OK) status = memory_check(check, &lock, &other);
    } else {
        printf(
            "memory of %s: known when it answers, or with a calibration that states the size of its frames\n",
            check->settings.source);
    }
    if (status == FOVEA_OK && !check->memory_only) status = machine_check(check, &lock, &other);
    check->absent = status == FOVEA_OK;
    if (check->absent) return why;
    *error = other;
    return status;
}

static enum fovea_status check_all(struct check *check, struct fovea_error *error)
{
    struct fovea_source_selection selection = {.step = 1};
    struct fovea_config *config = &check->settings.runtime;
    struct fovea_error lock = {0};
    enum fovea_status status = fv_setup_settings(&check->options, &check->settings, error);
    if (status != FOVEA_OK) return status;
    size_t before = heap_bytes();
    status = fv_setup_open(&check->settings, &selection, &check->setup, error);
    if (status != FOVEA_OK && check->setup.ops != NULL && check->setup.source == NULL)
        return check_without_source(check, status, error);
    check->rough =
        status != FOVEA_OK && fv_setup_lacks_calibration(&check->settings, &check->setup);
    if (check->rough) status = fv_setup_open_rough(&check->settings, &check->setup, error);
    if (status != FOVEA_OK) return status;
    check->source_bytes = heap_bytes() - before;
    config->clock = fv_timing_clock;
    status = memory_check(check, &lock, error);
    if (status != FOVEA_OK || check->memory_only) return status;
    status = fovea_init(check->memory, check->bytes, config, &check->rt, error);
    if (status == FOVEA_OK) status = machine_check(check, &lock, error);
    if (status != FOVEA_OK) return status;
    calibration_check(check);
    if (!check->bench) camera_check(check);
    return check->bench ? bench(check, error) : FOVEA_OK;
}

int fv_command_check(int argc, char **argv)
{
    static struct check check;
    struct fovea_error error = {0};
    const struct fv_option options[] = {
        {"config", "FILE", FV_OPTION_TEXT, &check.options.config, "configuration file to check"},
        {"source", "URI", FV_OPTION_TEXT, &check.options.source, FV_SETUP_SOURCE_HELP},
        {"camera", "FILE", FV_OPTION_TEXT, &check.options.camera,
         "calibration file; default: the source's own"},
        {"fov", "DEGREES", FV_OPTION_TEXT, &check.options.fov,
         "for a camera without a calibration: its horizontal field of view"},
        {"rate", "max|real", FV_OPTION_TEXT, &check.options.rate,
         "as for run; the memory of the recorder depends on it"},
        {"set", "KEY=VALUE", FV_OPTION_LIST, &check.options.sets,
         "override a key of the configuration"},
        {"memory-only", NULL, FV_OPTION_FLAG, &check.memory_only,
         "print the memory table and nothing else"},
        {"bench", NULL, FV_OPTION_FLAG, &check.bench,
         "measure the frame rate that this machine can sustain"},
        {0},
    };
    int first;
    enum fv_options_result result = fv_options_parse(options, "", 0, 0, argc, argv, &first);
    if (result == FV_OPTIONS_HELP) fv_setup_sources_print();
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    enum fovea_status status = check_all(&check, &error);
    fv_setup_close(&check.setup);
    if (check.memory != NULL) fv_realtime_unmap(check.memory, check.bytes);
    if (status != FOVEA_OK) {
        fflush(stdout);
        fv_say("%s%s", check.absent ? "failed   camera       " : "", error.text);
        return fv_setup_exit(status);
    }
    return check.wrong ? FV_EXIT_WRONG : check.failed ? FV_EXIT_FAILED : FV_EXIT_OK;
}
