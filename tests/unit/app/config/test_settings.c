/* The configuration: it prints what it reads, and says precisely what is wrong. */
#include <locale.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/config/classes.h"
#include "detect/decode.h"
#include "app/config/model_file.h"
#include "app/config/settings.h"

static struct fv_settings settings, back;
static struct fovea_error error;

static char *printed(const struct fv_settings *from, bool commented)
{
    char *text = NULL;
    size_t bytes = 0;
    FILE *file = open_memstream(&text, &bytes);
    fv_settings_print(file, from, commented);
    fclose(file);
    return text;
}

static enum fovea_status parse(const char *text)
{
    fv_settings_default(&settings);
    return fv_settings_parse(&settings, "robot.yaml", text, strlen(text), &error);
}

/* Everything but where it was set. */
static void assert_same(struct fv_settings *a, struct fv_settings *b)
{
    memset(a->line, 0, sizeof a->line);
    memset(b->line, 0, sizeof b->line);
    memset(a->file, 0, sizeof a->file);
    memset(b->file, 0, sizeof b->file);
    assert_memory_equal(a, b, sizeof *a);
}

static void test_default_reads_back(void **state)
{
    (void)state;
    for (int commented = 0; commented < 2; commented++) {
        fv_settings_default(&settings);
        char *text = printed(&settings, commented != 0);
        memset(&back, 0, sizeof back);
        memset(
            &back, 0x55,
            offsetof(struct fv_settings, line)); /* every key must be printed to overwrite this */
        struct fv_settings filled = back;
        assert_int_equal(fv_settings_parse(&back, "printed", text, strlen(text), &error), FOVEA_OK);
        for (size_t i = 0; i < fv_settings_key_count; i++) {
            assert_true(back.line[i] > 0);
            size_t at = fv_settings_keys[i].offset;
            assert_true(memcmp((char *)&back + at, (char *)&filled + at, 1) != 0);
        }
        fv_settings_default(&back);
        assert_int_equal(fv_settings_parse(&back, "printed", text, strlen(text), &error), FOVEA_OK);
        assert_same(&settings, &back);
        free(text);
    }
}

static void test_changed_values_read_back(void **state)
{
    (void)state;
    const char *const changes[] = {
        "source=images:/a \"b\"\\c/*.png",
        "camera=\xc3\xa9t\xc3\xa9\xc2\x85\xe2\x80\xa8\xf0\x9f\x93\xb7.yaml",
        "T_body_cam=[[0, 0, 1, 0.1], [-1, 0, 0, 1e-17], [0, -1, 0, 0.333333333333333314]]",
        "rate=real",
        "seed=9223372036854775807",
        "lcm_url=",
        "lcm_ttl=3",
        "listen=eth0",
        "commands=[save, reset]",
        "command_key=k",
        "scale.wheel_odometry_max_m_s=0.5",
        "channel_prefix=LEFT/cam-1.a_b",
        "features.count_max=321",
        "features.threshold=30",
        "preview.level=1",
        "loop.cpu=1",
        "loop.lock_memory=false",
    };
    fv_settings_default(&settings);
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++)
        assert_int_equal(fv_settings_set(&settings, changes[i], &error), FOVEA_OK);
    assert_int_equal(fv_settings_check(&settings, &error), FOVEA_OK);
    assert_string_equal(settings.source, "images:/a \"b\"\\c/*.png");
    assert_int_equal(settings.runtime.features.count_max, 321);
    assert_int_equal(settings.cpu, 1);
    assert_int_equal(settings.commands, FOVEA_COMMAND_SAVE | FOVEA_COMMAND_RESET);
    assert_true(settings.runtime.rig.cameras[0].T_body_cam[7] == 1e-17);
    char *text = printed(&settings, true);
    fv_settings_default(&back);
    assert_int_equal(fv_settings_parse(&back, "printed", text, strlen(text), &error), FOVEA_OK);
    assert_int_equal(fv_settings_parse(&back, "printed", text, strlen(text), &error),
                     FOVEA_OK); /* over what it holds */
    assert_same(&settings, &back);
    free(text);
}

/* As matrices are printed by most programs. */
static void test_transform_with_its_last_row(void **state)
{
    (void)state;
    assert_int_equal(
        parse(
            "T_body_cam:\n  - [0, 0, 1, 0.1]\n  - [-1, 0, 0, 0.2]\n  - [0, -1, 0, 0.3]\n  - [0, 0, 0, 1]\n"),
        FOVEA_OK);
    assert_true(settings.runtime.rig.cameras[0].T_body_cam[3] == 0.1 &&
                settings.runtime.rig.cameras[0].T_body_cam[11] == 0.3);
    assert_int_equal(fv_settings_check(&settings, &error), FOVEA_OK);
    assert_int_equal(parse("T_body_cam: [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,2]\n"), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(
        error.text, "robot.yaml:1: T_body_cam: found a list of 16, expected a list of 12 numbers"));
}

struct wrong {
    const char *text;
    const char *names[4]; /* all must stand in the line */
};

static void test_wrong_files(void **state)
{
    (void)state;
    const struct wrong cases[] = {
        {"featurs:\n  count_max: 5\n",
         {"robot.yaml:1:", "featurs", "unknown key", "nearest is 'features'"}},
        {"features:\n  cuont_max: 500\n",
         {"robot.yaml:2:", "features.cuont_max", "'features.count_max'"}},
        {"seed: 1\ncount_max: 500\n",
         {"robot.yaml:2:", "count_max", "unknown", "'features.count_max'"}},
        {"zzzz: 1\n", {"robot.yaml:1:", "zzzz", "unknown key"}},
        {"features:\n  max_count: 500\n",
         {"robot.yaml:2:", "features.max_count", "'features.count_max'"}},
        {"features:\n  num_features: 500\n",
         {"robot.yaml:2:", "features.num_features", "'features.count_max'"}},
        {"lcm:\n  url: udpm://\n", {"robot.yaml:1:", "lcm", "'lcm_url'"}},
        {"objects:\n  max_tracks: 5\n",
         {"robot.yaml:2:", "objects.max_tracks", "'objects.count_max'"}},
        {"camera_calibration: a.yaml\n", {"robot.yaml:1:", "camera_calibration", "'camera'"}},
        {"frame_rate: real\n", {"robot.yaml:1:", "frame_rate", "'rate'"}},
        {"features:\n  count_max: many\n",
         {"robot.yaml:2:", "features.count_max", "'many'", "whole number"}},
        {"features:\n  count_max: 99\n",
         {"robot.yaml:2:", "features.count_max", "'99'", "[100, 4000]"}},
        {"features:\n  count_max: \"500\"\n",
         {"robot.yaml:2:", "features.count_max", "'500'", "whole number"}},
        {"features:\n  count_max: 500.5\n", {"robot.yaml:2:", "features.count_max", "'500.5'"}},
        {"features:\n  count_max: [500]\n", {"robot.yaml:2:", "features.count_max", "a list of 1"}},
        {"features: 500\n", {"robot.yaml:1:", "features", "section"}},
        {"seed: 1\n\nseed: 2\n", {"robot.yaml:3:", "seed", "first on line 1", "each key once"}},
        {"rate: fast\n", {"robot.yaml:1:", "rate", "'fast'", "auto, max, real"}},
        {"features:\n  method: harisr\n",
         {"robot.yaml:2:", "features.method", "'harisr'", "one of fast, orb, harris, shi_tomasi"}},
        {"features:\n  method: sift\n",
         {"robot.yaml:2:", "features.method: found 'sift'",
          "expected fast, orb, harris or shi_tomasi", "compares binary descriptors"}},
        {"features:\n  method: surf\n",
         {"robot.yaml:2:", "features.method: found 'surf'",
          "expected fast, orb, harris or shi_tomasi", "compares binary descriptors"}},
        {"features:\n  method: [orb]\n",
         {"robot.yaml:2:", "features.method", "a list of 1", "one of fast, orb"}},
        {"loop:\n  lock_memory: perhaps\n",
         {"robot.yaml:2:", "loop.lock_memory", "'perhaps'", "true or false"}},
        {"T_body_cam: [1, 2, 3]\n", {"robot.yaml:1:", "T_body_cam", "a list of 3", "12 numbers"}},
        {"T_body_cam: [1,0,0,0,0,1,0,0,0,0,1,.nan]\n",
         {"robot.yaml:1:", "T_body_cam[11]", "'.nan'", "finite"}},
        {"commands: [reset, fly]\n", {"robot.yaml:1:", "commands[1]", "'fly'", "reset, pause"}},
        {"commands: {save: true}\n", {"robot.yaml:1:", "commands", "mapping", "a list like"}},
        {"lcm_ttl: -1\n", {"robot.yaml:1:", "lcm_ttl", "'-1'", "[0, 255]"}},
        {"lcm_url:\n", {"robot.yaml:1:", "lcm_url"}},
        {"channel_prefix: aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa\n",
         {"robot.yaml:1:", "channel_prefix", "at most 31 bytes"}},
        {"seed: 1\n  bad: [\n", {"robot.yaml:2:"}},
        {"- 1\n- 2\n", {"robot.yaml:1:", "list"}},
        {"seed: *x\n", {"robot.yaml:1:", "alias"}},
        {"features.count_max: 500\nfeatures:\n  count_max: 600\n",
         {"robot.yaml:3:", "features.count_max", "again (first on line 1)", "once"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(parse(cases[i].text), FOVEA_ERROR_INPUT);
        for (int n = 0; n < 4 && cases[i].names[n] != NULL; n++)
            if (strstr(error.text, cases[i].names[n]) == NULL)
                fail_msg("case %zu: '%s' is not in: %s", i, cases[i].names[n], error.text);
        assert_null(strchr(error.text, '\n'));
    }
}

static void test_wrong_together(void **state)
{
    (void)state;
    const struct wrong cases[] = {
        {"features:\n  threshold: 10\n  threshold_min: 11\n",
         {"robot.yaml:3:", "features.threshold_min", "11", "10"}},
        {"features:\n  threshold: 5\n",
         {"robot.yaml:", "features.threshold_min (default)", "found 7",
          "at most features.threshold, which is 5"}},
        {"features:\n  pyramid_levels: 3\npreview:\n  level: 3\n",
         {"robot.yaml:4:", "preview.level", "found 3"}},
        {"channel_prefix: \"a b\"\n", {"robot.yaml:1:", "channel_prefix"}},
        {"T_body_cam: [2,0,0,0,0,1,0,0,0,0,1,0]\n", {"robot.yaml:1:", "T_body_cam", "orthonormal"}},
        {"T_body_cam: [-1,0,0,0,0,1,0,0,0,0,1,0]\n", {"robot.yaml:1:", "T_body_cam", "reflection"}},
        {"T_body_cam: [1,0,0,1e7,0,1,0,0,0,0,1,0]\n",
         {"robot.yaml:1:", "T_body_cam", "found 1e+07", "-1e+06 to 1e+06"}},
        {"channel_prefix: ''\n", {"robot.yaml:1:", "channel_prefix", "found ''", "1 to 31 bytes"}},
        {"lcm_url: http://here\n", {"robot.yaml:1:", "lcm_url", "http://here", "udpm://"}},
        {"seed: 1\nobjects:\n  heights: person\n",
         {"robot.yaml:3:", "objects.heights", "'person'", "class:metres"}},
        {"objects:\n  heights: person:1.7 ball:0\n",
         {"robot.yaml:2:", "objects.heights", "'ball:0'", "class:metres"}},
        {"seed: 1\nimu_file: imu.yaml\n",
         {"robot.yaml:2: imu_file: found 'imu.yaml' without imu, expected both or neither"}},
        {"detect2:\n  model: a.fvm\n", {"robot.yaml:2: detect2.model: found 'a.fvm' without"}},
        {"odometry:\n  enabled: false\nmap:\n  save: a.map\n",
         {"robot.yaml:4: map.save: found 'a.map' without odometry"}},
        {"objects:\n  movable: 128\n", {"robot.yaml:2:", "objects.movable", "'128'", "127"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(parse(cases[i].text), FOVEA_OK);
        assert_int_equal(fv_settings_check(&settings, &error), FOVEA_ERROR_INPUT);
        for (int n = 0; n < 4 && cases[i].names[n] != NULL; n++)
            if (strstr(error.text, cases[i].names[n]) == NULL)
                fail_msg("case %zu: '%s' is not in: %s", i, cases[i].names[n], error.text);
    }
}

/* The rig is not known before the source is open, so it is not held against them yet. */
static void test_sensors_wait_for_the_rig(void **state)
{
    (void)state;
    static const char *const words[] = {"odometry.sensors=stereo", "odometry.sensors=mono_inertial",
                                        "odometry.sensors=stereo_inertial"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        fv_settings_default(&settings);
        assert_int_equal(fv_settings_set(&settings, words[i], &error), FOVEA_OK);
        assert_int_equal(fv_settings_check(&settings, &error), FOVEA_OK);
    }
}

static void test_wrong_assignments(void **state)
{
    (void)state;
    const struct wrong cases[] = {
        {"seed", {"--set: ", "'seed'", "key=value"}},
        {"=5", {"--set: ", "key=value"}},
        {"sed=5", {"--set: ", "'sed'", "unknown", "'seed'"}},
        {"count_max=500", {"--set: ", "'features.count_max'"}},
        {"loop.core=1", {"--set: ", "'loop.core'", "unknown key"}},
        {"preview.jpeg_quality=50", {"--set: ", "'preview.quality'"}},
        {"features.count_max=", {"--set: ", "features.count_max", "whole number"}},
        {"features.count_max=5", {"--set: features.count_max: found '5'", "[100, 4000]"}},
        {"seed=1\nlcm_ttl: 5", {"--set: seed", "one line"}},
        {"seed=1}, {a: b", {"--set: seed", "'1}, {a: b'", "one value"}},
        {"seed=1, lcm_ttl: 3", {"--set: seed", "'1, lcm_ttl: 3'", "one value"}},
        {"features.count_max=500, threshold: 30", {"--set: features.count_max", "one value"}},
        {"features.count_max=500}, seed: 3, loop: {cpu: 1",
         {"--set: features.count_max", "one value"}},
        {"T_body_cam=[1, 2", {"--set: T_body_cam", "'[1, 2'", "one value"}},
        {"source=\xff\xfe", {"--set: source", "UTF-8"}},
        {"mask=\xc0\x80", {"--set: mask", "UTF-8"}},
        {"loop.cpu=0x1", {"--set: loop.cpu", "'0x1'"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        fv_settings_default(&settings);
        assert_int_equal(fv_settings_set(&settings, cases[i].text, &error), FOVEA_ERROR_INPUT);
        for (int n = 0; n < 4 && cases[i].names[n] != NULL; n++)
            if (strstr(error.text, cases[i].names[n]) == NULL)
                fail_msg("case %zu: '%s' is not in: %s", i, cases[i].names[n], error.text);
        assert_null(strchr(error.text, '\n'));
    }
    char *longest = malloc(5000);
    memset(longest, 'x', 4999);
    memcpy(longest, "source=", 7);
    longest[4999] = '\0';
    assert_int_equal(fv_settings_set(&settings, longest, &error), FOVEA_ERROR_INPUT);
    free(longest);
}

/* Every key of 0.1 that is gone, in a file and with --set. */
static void test_keys_of_0_1_are_refused_with_their_names_now(void **state)
{
    static const char *const renamed[][2] = {
        {"T_base_cam", "T_body_cam"},
        {"map.loops", "map.closures"},
        {"scale.odometry_channel", "scale.wheel_odometry_channel"},
        {"track.coast_s", "objects.coast_s"},
        {"track.confirm_hits", "objects.confirm_hits"},
        {"track.ground", "objects.ground"},
        {"track.heights", "objects.heights"},
        {"track.max_disappeared", "objects.max_disappeared"},
        {"track.max_distance_px", "objects.max_distance_px"},
        {"track.mode", "objects.mode"},
        {"track.movable", "objects.movable"},
        {"track.score_confirm", "objects.score_confirm"},
        {"track.score_high", "objects.score_high"},
        {"track.score_low", "objects.score_low"},
        {"track.score_new", "objects.score_new"},
        {"track.tracks_max", "objects.count_max"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof renamed / sizeof renamed[0]; i++) {
        const char *old = renamed[i][0], *dot = strchr(old, '.');
        char text[128], found[160];
        bool known = false;
        for (size_t k = 0; k < fv_settings_key_count; k++)
            known |= strcmp(fv_settings_keys[k].name, renamed[i][1]) == 0;
        assert_true(known);
        snprintf(text, sizeof text, "%.*s%s%s: 1\n", dot != NULL ? (int)(dot - old) : 0, old,
                 dot != NULL ? ":\n  " : "", dot != NULL ? dot + 1 : old);
        snprintf(found, sizeof found,
                 "robot.yaml:%d: %s: found a key that Fovea 0.1 reads, expected its name now, '%s'",
                 dot != NULL ? 2 : 1, old, renamed[i][1]);
        assert_int_equal(parse(text), FOVEA_ERROR_INPUT);
        assert_string_equal(error.text, found);
        snprintf(text, sizeof text, "%s=1", old);
        snprintf(found, sizeof found,
                 "--set: %s: found a key that Fovea 0.1 reads, expected its name now, '%s'", old,
                 renamed[i][1]);
        assert_int_equal(fv_settings_set(&settings, text, &error), FOVEA_ERROR_INPUT);
        assert_string_equal(error.text, found);
    }
    assert_int_equal(parse("scale:\n  source: odometry\n"), FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "robot.yaml:2: scale.source: found 'odometry', expected "
                                    "'wheel_odometry': Fovea 0.1 reads the old word");
    assert_int_equal(parse("track:\n  nothing: 1\n"), FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "robot.yaml:1: track: found a key that Fovea 0.1 reads, "
                                    "expected its name now, 'objects'");
}

static void test_every_key_is_ranged(void **state)
{
    (void)state;
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        if (key->kind != FV_CONFIG_U32 && key->kind != FV_CONFIG_I32) continue;
        char assignment[128];
        fv_settings_default(&settings);
        snprintf(assignment, sizeof assignment, "%s=%lld", key->name, (long long)key->max + 1);
        assert_int_equal(fv_settings_set(&settings, assignment, &error), FOVEA_ERROR_INPUT);
        snprintf(assignment, sizeof assignment, "%s=%lld", key->name, (long long)key->min - 1);
        assert_int_equal(fv_settings_set(&settings, assignment, &error), FOVEA_ERROR_INPUT);
        snprintf(assignment, sizeof assignment, "%s=%lld", key->name, (long long)key->max);
        assert_int_equal(fv_settings_set(&settings, assignment, &error), FOVEA_OK);
    }
}

/* What moves is masked without being asked for; names that the network lacks are no error in
 * `auto`, and one when asked for. */
static void test_movable_classes(void **state)
{
    struct fv_model_file file;
    const char *const lists[] = {"auto", "", "person", "auto person"};
    uint32_t found[4];
    (void)state;
    assert_int_equal(fv_model_file_read("src/detect/shipped.fvm", &file, &error), FOVEA_OK);
    for (int i = 0; i < 4; i++) {
        fv_settings_default(&settings);
        assert_string_equal(settings.movable, "auto");
        snprintf(settings.movable, sizeof settings.movable, "%s", lists[i]);
        assert_int_equal(fv_classes_resolve(&settings, &file.model, &error), FOVEA_OK);
        found[i] = settings.runtime.objects.movable[0];
    }
    assert_int_equal(found[0],
                     15); /* the shipped network knows four things, and all of them move */
    assert_int_equal(found[1], 0);
    assert_int_equal(__builtin_popcount(found[2]), 1);
    assert_int_equal(found[3], found[0]);
    snprintf(settings.movable, sizeof settings.movable, "auto tractor");
    assert_int_equal(fv_classes_resolve(&settings, &file.model, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "tractor"));
    fv_model_file_free(&file);
}

/* The shipped network as one that labels pixels, with two of its labels known to `auto`. */
static void test_classes_of_the_grid(void **state)
{
    (void)state;
    struct fv_model_file file;
    fv_settings_default(&settings);
    assert_int_equal(fv_model_file_read("src/detect/shipped.fvm", &file, &error), FOVEA_OK);
    const struct fv_model *model = &file.model;
    assert_int_equal(fv_classes_resolve_grid(&settings, model, NULL, &error), FOVEA_OK); /* off */
    settings.runtime.grid_job.enabled = true;
    assert_int_equal(fv_classes_resolve_grid(&settings, model, NULL, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "grid.enabled: found no network that labels pixels"));
    ((struct fv_model_header *)(uintptr_t)model->header)->decode.kind = FV_DECODER_SEGMENT;
    assert_int_equal(fv_classes_resolve_grid(&settings, model, NULL, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "grid.floor: found 'auto', expected at least one class"));
    strcpy(settings.grid_floor, "1");
    strcpy(settings.grid_ignored, "0");
    assert_int_equal(fv_classes_resolve_grid(&settings, model, NULL, &error), FOVEA_OK);
    const uint8_t *labels = settings.runtime.grid_job.labels;
    const int32_t first = model->header->decode.first_label;
    assert_true(labels[0] == FOVEA_GRID_IGNORED && labels[1] == FOVEA_GRID_FLOOR);
    int movable = 0;
    for (int32_t c = 2; c + first < (int32_t)model->header->label_count; c++)
        movable += labels[c] == FOVEA_GRID_MOVABLE; /* ball, cone, box of the shipped network */
    assert_true(movable > 0);
    assert_int_equal(labels[200], FOVEA_GRID_OBSTACLE);
    /* Labels of several names, as ADE20K has them: "floor, flooring". */
    strcpy(settings.grid_floor, "auto");
    strcpy(settings.grid_ignored, "");
    char *label[4], text[64];
    const uint32_t label_count = model->header->label_count;
    for (int32_t c = 0; c < 4; c++)
        label[c] = (char *)(uintptr_t)fv_model_label(model, c + first);
    assert_true(strlen(label[1]) == 4 && strlen(label[3]) == 6);
    memcpy(label[1], "sky,", 4);
    memcpy(label[3], "x;path", 6);
    assert_int_equal(fv_classes_resolve_grid(&settings, model, NULL, &error), FOVEA_OK);
    assert_true(labels[1] == FOVEA_GRID_BEYOND && labels[3] == FOVEA_GRID_FLOOR);
    assert_int_equal(labels[0], FOVEA_GRID_MOVABLE);
    fv_classes_floor(&settings, model, NULL, text, sizeof text);
    assert_string_equal(text, "x;path");
    ((struct fv_model_header *)(uintptr_t)model->header)->label_count = 0;
    fv_classes_floor(&settings, model, NULL, text, sizeof text);
    assert_string_equal(text, "class 3"); /* without labels */
    ((struct fv_model_header *)(uintptr_t)model->header)->label_count = label_count;
    memcpy(label[3], "x;pat;", 6); /* a part of a name is none */
    assert_int_equal(fv_classes_resolve_grid(&settings, model, NULL, &error), FOVEA_ERROR_INPUT);
    strcpy(settings.grid_floor, "3");
    strcpy(settings.grid_movable, "lion");
    assert_int_equal(fv_classes_resolve_grid(&settings, model, NULL, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "grid.movable: found 'lion'"));
    fv_model_file_free(&file);
}

/* Of the network that comes with Fovea and labels pixels, nothing needs to be said. */
static void test_classes_of_the_shipped_segmenter(void **state)
{
    (void)state;
    static const uint8_t expected[] = {FOVEA_GRID_FLOOR, FOVEA_GRID_OBSTACLE, FOVEA_GRID_OBSTACLE,
                                       FOVEA_GRID_MOVABLE, FOVEA_GRID_BEYOND};
    struct fv_model_file file;
    fv_settings_default(&settings);
    settings.runtime.grid_job.enabled = true;
    assert_int_equal(fv_model_file_read("src/detect/segmenter.fvm", &file, &error), FOVEA_OK);
    assert_int_equal(fv_classes_resolve_grid(&settings, &file.model, NULL, &error), FOVEA_OK);
    assert_memory_equal(settings.runtime.grid_job.labels, expected, sizeof expected);
    /* A network of objects with masks in front of it knows no floor, and is passed over. */
    struct fv_model_file objects;
    assert_int_equal(fv_model_file_read("src/detect/shipped.fvm", &objects, &error), FOVEA_OK);
    struct fv_model_decode *decode =
        &((struct fv_model_header *)(uintptr_t)objects.model.header)->decode;
    decode->kind = FV_DECODER_YOLOV8_SEG;
    decode->roles[FV_ROLE_PROTOTYPES] = 1; /* the only output */
    decode->coefficients = objects.model.tensors[objects.model.outputs[0]].dims[3];
    assert_int_equal(fv_detect_gives(&objects.model), FV_DETECT_BOXES | FV_DETECT_MASK);
    assert_int_equal(fv_classes_resolve_grid(&settings, &objects.model, &file.model, &error),
                     FOVEA_OK);
    assert_memory_equal(settings.runtime.grid_job.labels, expected, sizeof expected);
    fv_model_file_free(&objects);
    /* What a list names goes before what another knows by name; no class has two labels. */
    strcpy(settings.grid_ignored, "floor auto");
    assert_int_equal(fv_classes_resolve_grid(&settings, &file.model, NULL, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "grid.floor: found 'auto', expected at least one class"));
    strcpy(settings.grid_ignored, "wall auto");
    assert_int_equal(fv_classes_resolve_grid(&settings, &file.model, NULL, &error), FOVEA_OK);
    assert_int_equal(settings.runtime.grid_job.labels[1], FOVEA_GRID_IGNORED);
    strcpy(settings.grid_ignored, "other auto"); /* as where the robot's arm is */
    assert_int_equal(fv_classes_resolve_grid(&settings, &file.model, NULL, &error), FOVEA_OK);
    assert_int_equal(settings.runtime.grid_job.labels[4], FOVEA_GRID_IGNORED);
    strcpy(settings.grid_beyond, "other");
    assert_int_equal(fv_classes_resolve_grid(&settings, &file.model, NULL, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "grid.ignored: found 'other', expected each class in one"));
    strcpy(settings.grid_ignored, "wall auto");
    strcpy(settings.grid_beyond, "auto");
    strcpy(settings.grid_movable, "wall");
    assert_int_equal(fv_classes_resolve_grid(&settings, &file.model, NULL, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "grid.ignored: found 'wall', expected each class in one"));
    fv_model_file_free(&file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_default_reads_back),
        cmocka_unit_test(test_changed_values_read_back),
        cmocka_unit_test(test_wrong_files),
        cmocka_unit_test(test_wrong_together),
        cmocka_unit_test(test_movable_classes),
        cmocka_unit_test(test_classes_of_the_grid),
        cmocka_unit_test(test_classes_of_the_shipped_segmenter),
        cmocka_unit_test(test_sensors_wait_for_the_rig),
        cmocka_unit_test(test_wrong_assignments),
        cmocka_unit_test(test_keys_of_0_1_are_refused_with_their_names_now),
        cmocka_unit_test(test_every_key_is_ranged),
        cmocka_unit_test(test_transform_with_its_last_row),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
