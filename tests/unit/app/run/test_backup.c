/* Settings that are restored: what the next start would refuse is refused, and a parameter that
 * changes while the file is being written (this test's own fsync) stays changed. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/config/setup.h"
#include "app/run/backup.h"
#include "support/text.h"

#include "fovea_parameter_result_t.h"
#include "fovea_parameter_t.h"
#include "fovea_settings_result_t.h"
#include "fovea_settings_t.h"

enum { WIDTH = 160, HEIGHT = 120 };

static char folder[] = "/tmp/fovea_backup_XXXXXX", kept[64], camera_file[64];
static const char camera_text[] =
    "image_width: 160\nimage_height: 120\ncamera_name: cam\ndistortion_model: plumb_bob\n"
    "camera_matrix: {rows: 3, cols: 3, data: [121.5, 0, 80, 0, 121.5, 60, 0, 0, 1]}\n"
    "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
static struct fv_settings settings;
static struct fovea_source_info info;
static struct fv_requests requests;
static struct fv_parameters parameters;
static struct fv_setup setup; /* no source: no camera is set */
static struct fv_backup backup;
static struct fovea *rt;
static void *block;
static bool changes, fails; /* at the next fsync */
static bool keeps;

static void change(const char *key, const char *value, bool keep)
{
    uint8_t data[512];
    const fovea_parameter_t message = {.key = (char *)key, .value = (char *)value, .keep = keep};
    const int bytes = fovea_parameter_t_encode(data, 0, sizeof data, &message);
    const struct fv_received received = {.data = data, .bytes = (uint32_t)bytes, .from_host = true};
    const struct fv_receiver_channel row = fv_parameters_row(&parameters);
    row.take(row.context, &received);
}

/* In place of libc's. */
int fsync(int file)
{
    (void)file;
    if (changes) change("features.threshold", "33", keeps);
    changes = false;
    if (!fails) return 0;
    errno = EIO;
    return -1;
}

/* The result of restoring `text`. */
static int8_t restore(const char *text)
{
    static uint8_t data[FV_BACKUP_MESSAGE_BYTES];
    fovea_settings_result_t result;
    const fovea_settings_t message = {.id = 3, .text = (char *)text};
    const int bytes = fovea_settings_t_encode(data, 0, sizeof data, &message);
    assert_true(bytes > 0);
    const struct fv_received received = {.data = data, .bytes = (uint32_t)bytes, .from_host = true};
    const struct fv_receiver_channel row = fv_backup_row(&backup);
    row.take(row.context, &received);
    fv_backup_tend(&backup);
    assert_int_equal(atomic_load(&backup.stage), FV_BACKUP_ANSWERED);
    assert_true(
        fovea_settings_result_t_decode(backup.message, 0, (int)backup.answer_bytes, &result) > 0);
    const int8_t found = result.result;
    fovea_settings_result_t_decode_cleanup(&result);
    atomic_store(&backup.stage, FV_BACKUP_IDLE);
    return found;
}

enum {
    DONE = FOVEA_SETTINGS_RESULT_T_RESULT_DONE,
    REFUSED = FOVEA_SETTINGS_RESULT_T_RESULT_REFUSED,
    FAILED = FOVEA_SETTINGS_RESULT_T_RESULT_FAILED
};

static int open_all(void **state)
{
    struct fovea_error error;
    size_t bytes;
    const struct fv_command_rules rules = {.run_id = 1};
    (void)state;
    fv_settings_default(&settings);
    settings.runtime.image.seen_by |= FOVEA_VIEWER_NETWORKS;
    snprintf(settings.parameters_file, sizeof settings.parameters_file, "%s", kept);
    snprintf(settings.camera, sizeof settings.camera, "%s", camera_file);
    info = (struct fovea_source_info){.rig.camera_count = 1,
                                      .cameras[0] = {.width = WIDTH, .height = HEIGHT}};
    struct fovea_camera *camera = &settings.runtime.rig.cameras[0].camera;
    *camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 121.5, .fy = 121.5, .cx = 80, .cy = 60};
    if (fovea_camera_prepare(camera, &error) != FOVEA_OK ||
        fovea_size(&settings.runtime, &bytes, &error) != FOVEA_OK)
        return -1;
    block = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    if (block == NULL || fovea_init(block, bytes, &settings.runtime, &rt, &error) != FOVEA_OK ||
        fv_requests_open(&requests, &rules, &error) != FOVEA_OK ||
        fv_parameters_open(&parameters, rt, &settings, &setup, &requests, &error) != FOVEA_OK)
        return -1;
    changes = fails = keeps = false;
    return fv_backup_open(&backup, &parameters, &settings, &info, &error) == FOVEA_OK ? 0 : -1;
}

static int close_all(void **state)
{
    (void)state;
    fv_backup_close(&backup);
    fv_parameters_close(&parameters);
    fv_requests_close(&requests);
    free(block);
    (void)unlink(kept);
    return 0;
}

static void what_the_next_start_refuses_is_refused(void **state)
{
    static const char *const wrong[][2] = {
        {"camera_fov: 90\n", "camera_fov: found 90, expected 0 beside the calibration"},
        {"map.localise_only: true\n", "map.localise_only: found true without a map"},
        {"grid.enabled: true\nT_body_cam: [0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0.5]\n",
         "grid.enabled: found no detect.model"},
    };
    char text[1000];
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(restore(wrong[i][0]), REFUSED);
        if (strstr(backup.reason, wrong[i][1]) == NULL)
            fail_msg("found \"%s\", expected \"%s\"", backup.reason, wrong[i][1]);
        assert_int_not_equal(access(kept, F_OK), 0);
    }
    snprintf(text, sizeof text, "seed: 3\n---\n%s", camera_text);
    memcpy(strstr(text, "160"), "320", 3);
    memcpy(strstr(text, "120"), "240", 3);
    assert_int_equal(restore(text), REFUSED); /* of another size, */
    snprintf(text, sizeof text, "camera_scale: true\n---\n%s", camera_text);
    memcpy(strstr(text, "160"), "320", 3);
    memcpy(strstr(text, "120"), "240", 3);
    assert_int_equal(restore(text), DONE);                       /* which the same file allows */
    assert_int_equal(restore("camera_scale: false\n"), REFUSED); /* not without it */
}

static const struct fovea_source_info *info_of(const struct fovea_source *source)
{
    (void)source;
    return &info;
}

/* With a network of colours in the file `model`, if any, and a source of `format`. */
static void reopen(const char *model, enum fovea_pixel_format format)
{
    static const struct fovea_source_ops ops = {.info = info_of};
    struct fovea_error error;
    fv_backup_close(&backup);
    fv_parameters_close(&parameters);
    info.format = format;
    setup = (struct fv_setup){.ops = &ops};
    snprintf(settings.model, sizeof settings.model, "%s", model);
    if (model[0] != '\0')
        assert_int_equal(fv_model_file_read(model, &setup.model, &error), FOVEA_OK);
    assert_int_equal(fv_parameters_open(&parameters, rt, &settings, &setup, &requests, &error),
                     FOVEA_OK);
    assert_int_equal(fv_backup_open(&backup, &parameters, &settings, &info, &error), FOVEA_OK);
}

/* White balance that would change nothing, as a live change, kept or not, and as settings. */
static void white_balance_without_colours_is_refused(void **state)
{
    static const char network[] = "tests/golden/detector.fvm";
    static const struct {
        const char *model;
        enum fovea_pixel_format format;
        const char *reason; /* NULL: it is taken */
    } rows[] = {{"", FOVEA_PIXEL_RGB24, "expected a network of colours"},
                {network, FOVEA_PIXEL_GREY8, "expected a source with colours"},
                {network, FOVEA_PIXEL_Y10, "expected a source with colours"},
                {network, FOVEA_PIXEL_RGB24, NULL}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        reopen(rows[i].model, rows[i].format);
        for (int form = 0; form < 3; form++) { /* the last needs a restart for its denoise */
            size_t bytes;
            change("image.operations", form < 2 ? "[white_balance]" : "[denoise, white_balance]",
                   form > 0);
            const struct fv_parameter_change *judged =
                (const void *)fv_ring_peek(&parameters.ring, &bytes);
            assert_non_null(judged);
            if (rows[i].reason != NULL) {
                assert_int_equal(judged->result, FOVEA_PARAMETER_RESULT_T_RESULT_REFUSED);
                assert_non_null(strstr(judged->reason, rows[i].reason));
                assert_int_equal(parameters.settings->runtime.image.preprocess.operations.count, 0);
            } else {
                assert_int_equal(judged->result,
                                 form < 2 ? FOVEA_PARAMETER_RESULT_T_RESULT_DONE
                                          : FOVEA_PARAMETER_RESULT_T_RESULT_NEEDS_RESTART);
            }
            fv_ring_release(&parameters.ring, bytes);
        }
        fv_parameters_tend(&parameters, true);
        assert_int_equal(access(kept, F_OK), rows[i].reason != NULL ? -1 : 0);
        assert_int_equal(restore("image.operations: [white_balance]\n"),
                         rows[i].reason != NULL ? REFUSED : DONE);
        if (rows[i].reason != NULL) assert_non_null(strstr(backup.reason, rows[i].reason));
        fv_setup_close(&setup);
    }
    setup = (struct fv_setup){.ops = NULL};
}

static void a_change_during_the_write_holds(void **state)
{
    (void)state;
    changes = true;
    assert_int_equal(restore("statistics_every: 31\n"), DONE);
    assert_int_equal(parameters.settings->runtime.features.threshold, 33);
    assert_int_equal(restore("features.threshold: 27\n"), DONE);
    assert_int_equal(parameters.settings->runtime.features.threshold, 27);
}

static void a_failed_restore_loses_nothing_that_is_kept(void **state)
{
    (void)state;
    changes = keeps = fails = true;
    assert_int_equal(restore("statistics_every: 31\n"), FAILED);
    fails = false;
    fv_parameters_tend(&parameters, true);
    char *text;
    size_t bytes;
    struct fovea_error error;
    assert_int_equal(fv_text_read(kept, FV_KEPT_BYTES_MAX, &text, &bytes, &error), FOVEA_OK);
    assert_non_null(strstr(text, "features.threshold: 33\n"));
    assert_null(strstr(text, "statistics_every"));
    free(text);
}

/* A calibration is kept without what is around it, and never more than can be read. */
static void what_is_kept_can_be_read(void **state)
{
    static char text[FV_KEPT_BYTES_MAX + 100];
    struct fovea_error error;
    size_t bytes;
    char *read;
    (void)state;
    size_t used = (size_t)snprintf(text, sizeof text, "---\n%s", camera_text);
    memmove(text + 8, text, used + 1);
    memcpy(text, "seed: 3\n", 8);
    for (used += 8; used < 30000; used += 50)
        snprintf(text + used, sizeof text - used, "# %047d\n", 7);
    assert_int_equal(restore(text), DONE);
    assert_int_equal(fv_text_read(kept, 2000, &read, &bytes, &error), FOVEA_OK);
    free(read);
    memset(text, '#', sizeof text - 1);
    assert_int_equal(fv_kept_parameters_write(&settings, text, kept, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_text_read(kept, 2000, &read, &bytes, &error), FOVEA_OK);
    free(read);
}

/* What a check of the files says on stderr. */
static void said_by_check(char *said, size_t bytes)
{
    struct fv_settings *checked = malloc(sizeof *checked);
    struct fovea_error error;
    FILE *file = tmpfile();
    const int kept_stderr = dup(STDERR_FILENO);
    assert_true(checked != NULL && file != NULL && kept_stderr >= 0);
    *checked = settings;
    strcpy(checked->source, "sim:orbit?width=160&height=120&frames=2");
    dup2(fileno(file), STDERR_FILENO);
    const enum fovea_status status = fv_setup_check_files(checked, &error);
    dup2(kept_stderr, STDERR_FILENO);
    close(kept_stderr);
    rewind(file);
    said[fread(said, 1, bytes - 1, file)] = '\0';
    fclose(file);
    free(checked);
    if (status != FOVEA_OK) fail_msg("%s", error.text);
}

/* A kept calibration does not stand for the user's file in silence. */
static void a_kept_calibration_is_named(void **state)
{
    char text[1000], said[1000];
    (void)state;
    said_by_check(said, sizeof said);
    assert_string_equal(said, "");
    snprintf(text, sizeof text, "seed: 3\n---\n%s", camera_text);
    assert_int_equal(restore(text), DONE);
    said_by_check(said, sizeof said);
    snprintf(text, sizeof text, "camera: the calibration kept in %s stands for %s\n", kept,
             camera_file);
    assert_string_equal(said, text);
    const struct timespec later[2] = {{.tv_sec = INT64_C(4000000000)},
                                      {.tv_sec = INT64_C(4000000000)}};
    assert_int_equal(utimensat(AT_FDCWD, camera_file, later, 0), 0);
    said_by_check(said, sizeof said);
    assert_non_null(strstr(said, ", which was changed later;"));
    assert_int_equal(utimensat(AT_FDCWD, camera_file, NULL, 0), 0);
}

/* Who comes while one before is not through hears of it, as all who are refused. */
static void others_are_refused_meanwhile(void **state)
{
    static char text[FV_KEPT_BYTES_MAX + 2];
    static const struct {
        int64_t id;
        bool long_text;
        const char *reason;
    } rows[] = {{8, false, "the request before this one is not through"},
                {9, false, "the request before this one is not through"},
                {10, true, "found 32768 bytes, expected at most 32767"}};
    const struct fv_receiver_channel row = fv_backup_row(&backup);
    static uint8_t data[FV_BACKUP_MESSAGE_BYTES];
    fovea_settings_t message = {.id = 7, .text = (char *)"seed: 3\n"};
    (void)state;
    memset(text, '#', sizeof text - 1);
    for (int i = -1; i < 3; i++) { /* the first is taken */
        if (i >= 0) message.id = rows[i].id;
        if (i == 2) {
            message.text = text;
            atomic_store(&backup.stage, FV_BACKUP_IDLE);
        }
        const int bytes = fovea_settings_t_encode(data, 0, sizeof data, &message);
        const struct fv_received received = {
            .data = data, .bytes = (uint32_t)bytes, .from_host = true};
        row.take(row.context, &received);
        assert_int_equal(backup.id, 7);
    }
    assert_string_equal(backup.text, "seed: 3\n");
    for (int i = 0; i < 3; i++) {
        size_t bytes;
        fovea_settings_result_t result;
        const uint8_t *answer = fv_ring_peek(&requests.ring, &bytes);
        assert_non_null(answer);
        const size_t head = sizeof(uint32_t) + FV_MESSAGE_CHANNEL_BYTES; /* requests.c */
        assert_true(fovea_settings_result_t_decode(answer + head, 0, FV_REQUESTS_ANSWER_BYTES,
                                                   &result) > 0);
        assert_int_equal(result.id, rows[i].id);
        assert_int_equal(result.result, REFUSED);
        assert_string_equal(result.reason, rows[i].reason);
        fovea_settings_result_t_decode_cleanup(&result);
        fv_ring_release(&requests.ring, head + FV_REQUESTS_ANSWER_BYTES);
    }
    assert_int_equal(atomic_load(&requests.gate.counts[FV_COMMAND_BUSY]), 2);
}

/* Who asks while the run ends hears of it. */
static void the_end_answers(void **state)
{
    (void)state;
    atomic_store(&backup.stage, FV_BACKUP_ASKED);
    snprintf(backup.text, 20, "seed: 3\n");
    backup.answer_bytes = 0;
    fv_backup_end(&backup, NULL, NULL);
    assert_int_equal(atomic_load(&backup.stage), FV_BACKUP_IDLE);
    assert_true(backup.answer_bytes > 0);
    assert_string_equal(backup.reason, "the run has ended");
    assert_int_not_equal(access(kept, F_OK), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_the_next_start_refuses_is_refused, open_all,
                                        close_all),
        cmocka_unit_test_setup_teardown(white_balance_without_colours_is_refused, open_all,
                                        close_all),
        cmocka_unit_test_setup_teardown(a_change_during_the_write_holds, open_all, close_all),
        cmocka_unit_test_setup_teardown(a_failed_restore_loses_nothing_that_is_kept, open_all,
                                        close_all),
        cmocka_unit_test_setup_teardown(what_is_kept_can_be_read, open_all, close_all),
        cmocka_unit_test_setup_teardown(a_kept_calibration_is_named, open_all, close_all),
        cmocka_unit_test_setup_teardown(the_end_answers, open_all, close_all),
        cmocka_unit_test_setup_teardown(others_are_refused_meanwhile, open_all, close_all),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(kept, sizeof kept, "%s/kept.yaml", folder);
    snprintf(camera_file, sizeof camera_file, "%s/camera.yaml", folder);
    FILE *file = fopen(camera_file, "w");
    if (file == NULL || fputs(camera_text, file) < 0 || fclose(file) != 0) return 1;
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(camera_file);
    rmdir(folder);
    return failed;
}
