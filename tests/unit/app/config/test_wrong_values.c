/* Wrong configurations and calibrations, made by hand and by mutation: each is refused in one line
 * that names the file, the line and the key. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/datasets.h"
#include "common/wrong_case.h"
#include "app/config/settings.h"

/* ---- configurations -------------------------------------------------------------------------- */

static const char *const wrong_values[] = {"",          "~",     "[1, 2]", "{a: 1}",
                                           "\"\\x01\"", "1e400", "0x10",   "12 apples"};

/* Every key with every value that is wrong for its kind. */
static void test_wrong_values(void **state)
{
    (void)state;
    for (size_t k = 0; k < fv_settings_key_count; k++) {
        const struct fv_settings_key *key = &fv_settings_keys[k];
        const char *dot = strchr(key->name, '.');
        for (size_t v = 0; v < sizeof wrong_values / sizeof wrong_values[0]; v++) {
            char text[512], names[256];
            if (key->kind == FV_CONFIG_TEXT && v > 3) continue; /* other scalars are texts */
            int bytes = dot != NULL
                            ? snprintf(text, sizeof text, "# a comment\n%.*s:\n  %s: %s\n",
                                       (int)(dot - key->name), key->name, dot + 1, wrong_values[v])
                            : snprintf(text, sizeof text, "# a comment\n%s: %s\n", key->name,
                                       wrong_values[v]);
            fv_test_put("value.yaml", text, (size_t)bytes);
            snprintf(names, sizeof names, "@/value.yaml:%d:|%s", dot != NULL ? 3 : 2, key->name);
            fv_test_refused("fovea config --check @/value.yaml", names);
        }
    }
}

/* Every key misspelt by a swap of neighbours, and given twice. */
static void test_wrong_keys(void **state)
{
    (void)state;
    for (size_t k = 0; k < fv_settings_key_count; k++) {
        const struct fv_settings_key *key = &fv_settings_keys[k];
        const char *dot = strchr(key->name, '.'), *leaf = dot != NULL ? dot + 1 : key->name;
        char section[64] = "", swapped[64], text[512], names[256];
        const char *indent = dot != NULL ? "  " : "";
        if (dot != NULL)
            snprintf(section, sizeof section, "%.*s:\n", (int)(dot - key->name), key->name);
        snprintf(swapped, sizeof swapped, "%s", leaf);
        size_t at = leaf[0] == leaf[1] ? 1 : 0;
        swapped[at] = leaf[at + 1];
        swapped[at + 1] = leaf[at];
        int bytes = snprintf(text, sizeof text, "%s%s%s: 1\n", section, indent, swapped);
        fv_test_put("key.yaml", text, (size_t)bytes);
        snprintf(names, sizeof names, "@/key.yaml:%d:|%s|'%s'", dot != NULL ? 2 : 1, swapped,
                 key->name);
        fv_test_refused("fovea config --check @/key.yaml", names);
        bytes = snprintf(text, sizeof text, "%s%s%s: 1\n%s%s: 1\n", section, indent, leaf, indent,
                         leaf);
        fv_test_put("key.yaml", text, (size_t)bytes);
        snprintf(names, sizeof names, "@/key.yaml:%d:|%s|each key once", dot != NULL ? 3 : 2, leaf);
        fv_test_refused("fovea config --check @/key.yaml", names);
    }
}

static void test_mutated_configurations(void **state)
{
    (void)state;
    enum { ITERATIONS = 120 };
    static struct fv_settings settings;
    char *valid = NULL;
    size_t valid_bytes = 0;
    fv_settings_default(&settings);
    FILE *file = open_memstream(&valid, &valid_bytes);
    fv_settings_print(file, &settings, false);
    fclose(file);
    struct fv_random random;
    fv_random_seed(&random, 11);
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        char *text = malloc(valid_bytes);
        size_t bytes = valid_bytes;
        memcpy(text, valid, bytes);
        fv_test_mutate(&random, text, &bytes);
        fv_test_put("mutated.yaml", text, bytes);
        free(text);
        fv_test_fine_or_refused("fovea config --check @/mutated.yaml", "@/mutated.yaml", iteration);
    }
    free(valid);
}

/* ---- calibrations ---------------------------------------------------------------------------- */

static const char calibration[] = "image_width: 640\n"
                                  "image_height: 480\n"
                                  "camera_name: cam\n"
                                  "camera_matrix:\n"
                                  "  rows: 3\n"
                                  "  cols: 3\n"
                                  "  data: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]\n"
                                  "distortion_model: plumb_bob\n"
                                  "distortion_coefficients:\n"
                                  "  rows: 1\n"
                                  "  cols: 5\n"
                                  "  data: [-0.28, 0.07, 0.0002, 0.00002, 0.0]\n";

static const char *const wrong_calibrations[][3] = {
    /* what stands in the file, what is put there, what the line must name */
    {"image_width: 640", "image_width: 641", "cam.yaml|641"},
    {"image_width: 640", "image_width: wide", "cam.yaml:1:|image_width|'wide'"},
    {"image_width: 640", "image_width: -640", "cam.yaml:1:|image_width|'-640'"},
    {"image_height: 480", "image_height: 0", "cam.yaml:2:|image_height"},
    {"[500.0, 0.0, 320.0", "[-500.0, 0.0, 320.0", "cam.yaml"},
    {"[500.0, 0.0, 320.0", "[0.0, 0.0, 320.0", "cam.yaml"},
    {"[500.0, 0.0, 320.0", "[500.0, 0.0, 32000.0", "cam.yaml"},
    {"[500.0, 0.0, 320.0", "[.nan, 0.0, 320.0", "cam.yaml:7:|camera_matrix.data[0]|'.nan'"},
    {"[500.0, 0.0, 320.0", "[500.0, 320.0", "cam.yaml:7:|camera_matrix.data|9"},
    {"camera_matrix:", "camera_matrx:", "cam.yaml|camera_matrix"},
    {"plumb_bob", "thin_prism", "cam.yaml:8:|distortion_model|'thin_prism'"},
    {"-0.28, 0.07", "-0.28, many", "cam.yaml:12:|distortion_coefficients.data[1]|'many'"},
    {"-0.28, 0.07, ", "-0.28, ", "cam.yaml:12:|distortion_coefficients"},
    {"-0.28, 0.07", "-0.28, 1e999", "cam.yaml:12:|distortion_coefficients.data[1]"},
    {"image_height", "image_width", "cam.yaml:2:|image_width|each key once"},
};

static void test_calibrations(void **state)
{
    (void)state;
    const char *command =
        "fovea run --camera @/cam.yaml --frames 1 --picture none --set lcm_url= --set loop.priority=0";
    const char *text;
    fv_test_put("cam.yaml", calibration, sizeof calibration - 1);
    const int status = fv_test_command(command, &text);
    if (status != 0) fail_msg("the valid calibration: wait status %x: [%s]", status, text);
    for (size_t i = 0; i < sizeof wrong_calibrations / sizeof wrong_calibrations[0]; i++) {
        char changed[2048];
        const char *at = strstr(calibration, wrong_calibrations[i][0]);
        assert_non_null(at);
        int bytes =
            snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - calibration), calibration,
                     wrong_calibrations[i][1], at + strlen(wrong_calibrations[i][0]));
        fv_test_put("cam.yaml", changed, (size_t)bytes);
        fv_test_refused(command, wrong_calibrations[i][2]);
    }
    struct fv_random random;
    fv_random_seed(&random, 5);
    for (int iteration = 0; iteration < 60; iteration++) {
        char changed[sizeof calibration];
        size_t bytes = sizeof calibration - 1;
        memcpy(changed, calibration, sizeof calibration);
        fv_test_mutate(&random, changed, &bytes);
        fv_test_put("cam.yaml", changed, bytes);
        fv_test_fine_or_refused(command, "@/cam.yaml", iteration);
    }
}

static void options_of_0_1_are_refused_with_their_name_now(void **state)
{
    (void)state;
    fv_test_refused("fovea run --source sim:orbit --tracks a.csv", "--tracks|0.1|'--objects'");
    fv_test_refused("fovea map draw a.map a.png --world=1", "--world|0.1|'--map'");
    fv_test_refused("fovea rectify a.png b.png --view cylinder", "--view|0.1|'--shape'");
}

static void test_there_were_enough(void **state)
{
    (void)state;
    print_message("%d wrong inputs\n", fv_test_cases());
    assert_true(fv_test_cases() >= 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wrong_values),
        cmocka_unit_test(test_wrong_keys),
        cmocka_unit_test(test_mutated_configurations),
        cmocka_unit_test(test_calibrations),
        cmocka_unit_test(options_of_0_1_are_refused_with_their_name_now),
        cmocka_unit_test(test_there_were_enough),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}
