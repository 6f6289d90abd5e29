/* Wrong arguments and wrong files, made by hand: each is refused in one line that names the option
 * or the file. */
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

enum { PATH_BYTES = FV_TEST_PATH_BYTES + 64 };

/* ---- arguments ------------------------------------------------------------------------------- */

static const char *const wrong_arguments[][2] = {
    {"fovea", "no command"},
    {"fovea rnu", "'rnu'|'run'"},
    {"fovea confg", "'confg'|'config'"},
    {"fovea --verion", "--verion"},
    {"fovea help nothing", "nothing"},
    {"fovea run --sorce sim:", "--sorce|--source"},
    {"fovea run --frames", "--frames|value missing"},
    {"fovea run --frames -1", "--frames|'-1'"},
    {"fovea run --frames 0", "--frames|'0'|from 1"},
    {"fovea export --frames 0 @/none", "--frames|'0'|from 1"},
    {"fovea run --source siim:\xc3\xa4", "source|'siim:\xc3\xa4'"},
    {"fovea run --frames ten", "--frames|'ten'"},
    {"fovea run --frames 1e3", "--frames|'1e3'"},
    {"fovea run --frames 99999999999999999999", "--frames|'99999999999999999999'"},
    {"fovea run --start 1.5", "--start|'1.5'"},
    {"fovea run --step 0", "--step|'0'|from 1"},
    {"fovea run --step -2", "--step|'-2'|from 1"},
    {"fovea run --step x", "--step|'x'"},
    {"fovea run --reverse=yes", "--reverse|no value"},
    {"fovea run -z", "'-z'"},
    {"fovea run -frames 5", "'-frames'|nearest is '--frames'"},
    {"fovea run --quiet -zz --frames 3", "'-zz'"},
    {"fovea run --quiet -z --frames 3", "'-z'"},
    {"fovea run sim:", "'sim:'|nothing"},
    {"fovea run --rate fast", "rate|'fast'|auto, max, real"},
    {"fovea run --rate=", "rate|''"},
    {"fovea run --config @/none.yaml", "@/none.yaml"},
    {"fovea run --config @", "@"},
    {"fovea run --stats @/none/stats.json", "--stats|@/none/stats.json"},
    {"fovea run --picture @/none/t.png", "--picture|@/none/t.png"},
    {"fovea run --record @/none/run.log --frames 1 --picture none --set lcm_url=",
     "@/none/run.log"},
    {"fovea run --record @/text.yaml --source lcmlog:@/text.yaml", "--record|@/text.yaml|--source"},
    {"fovea run --set record=@/./text.yaml --config @/text.yaml",
     "--record|@/./text.yaml|--config"},
    {"fovea run --stats @/text.yaml --config @/text.yaml", "--stats|@/text.yaml|--config"},
    {"fovea run --stats @/one --trajectory @/one", "--stats|@/one|--trajectory"},
    {"fovea run --camera @/none.yaml", "@/none.yaml"},
    {"fovea run --camera @/cam0.yaml", "@/cam0.yaml:2: cam0: |'5'|a mapping"},
    {"fovea export --frames 1 @/none/frames", "@/none/frames"},
    {"fovea export --frames 1 @/text.yaml/frames", "@/text.yaml/frames"},
    {"fovea replay @", "@: found a directory"},
    {"fovea run --config @/camera.yaml", "@/camera.yaml:2: camera: |/none/cam.yaml"},
    {"fovea run --config @/record.yaml --frames 1 --picture none",
     "@/record.yaml:1: record: |/none/run.lcm"},
    {"fovea run --set", "--set|value missing"},
    {"fovea run --set seed", "--set|seed"},
    {"fovea run --set sed=1", "--set|sed|'seed'"},
    {"fovea run --set seed=-1", "--set|seed|'-1'"},
    {"fovea run --set features.count_max=9e9", "--set|features.count_max"},
    {"fovea run --set preview.level=7 --set features.pyramid_levels=3", "preview.level|--set"},
    {"fovea run --set lcm_url=http://here --picture none", "lcm_url|http://here"},
    {"fovea run --set lcm_url=udpm://1.2.3.4:7667 --picture none", "lcm_url|1.2.3.4"},
    {"fovea run --set lcm_url=file://@/x.log --picture none", "lcm_url|@/x.log|mode=w"},
    {"fovea run --set lcm_url=udpm://239.255.76.67:7667?ttl=x --picture none",
     "lcm_url|ttl=0 to 255"},
    {"fovea run --set lcm_url=udpm://239.255.76.67:7667?lot=1 --picture none",
     "lcm_url|lot=1|recv_buf_size"},
    {"fovea check --set lcm_url=udpm://:7667", "lcm_url|udpm://:7667"},
    {"fovea run --set lcm_ttl=\"0\"", "lcm_ttl|the text '0'"},
    {"fovea run --set mask=@/none.png --picture none", "mask|@/none.png"},
    {"fovea run --set mask=@/text.yaml --picture none", "mask|@/text.yaml"},
    {"fovea run --source", "--source|value missing"},
    {"fovea run --source nothing", "source|'nothing'"},
    {"fovea run --source :", "source|':'"},
    {"fovea run --source siim:", "source|'siim:'|sim"},
    {"fovea run --source sim:orbt", "orbt|orbit"},
    {"fovea run --source sim:orbit?sed=7", "sed|seed"},
    {"fovea run --source sim:orbit?seed=x", "seed|'x'"},
    {"fovea run --source sim:orbit?width=10", "width|10"},
    {"fovea run --source sim:orbit?width", "width"},
    {"fovea run --source sim:?seed=1&width=320&seed=2", "seed|second time"},
    {"fovea run --source sim:?seed=-1", "seed|[0, 9007199254740992]"},
    {"fovea run --source euroc:", "mav0"},
    {"fovea run --source euroc:@/none", "@/none"},
    {"fovea run --source euroc:@", "@"},
    {"fovea run --source tum:@/none", "@/none"},
    {"fovea run --source tum:@", "@"},
    {"fovea run --source kitti:@/none", "@/none"},
    {"fovea run --source kitti:@", "@"},
    {"fovea run --source images:@/none/*.png", "@/none"},
    {"fovea run --source lcmlog:@/none.log", "@/none.log"},
    {"fovea run --source lcmlog:@/text.yaml", "@/text.yaml"},
    {"fovea check --bnech", "--bnech|--bench"},
    {"fovea check --config @/none.yaml", "@/none.yaml"},
    {"fovea check --source tum:@/none", "@/none"},
    {"fovea check extra", "'extra'"},
    {"fovea config --check", "--check|value missing"},
    {"fovea config --check @/none.yaml", "@/none.yaml"},
    {"fovea config extra", "'extra'"},
    {"fovea config --set lcm_url=udpm://1.2.3.4:7667", "lcm_url|1.2.3.4"},
    {"fovea config --check @/source.yaml", "@/source.yaml:2: source: |'nothing'|sim:"},
    {"fovea run --config @/save.yaml", "@/save.yaml:2: map.save: |/none/run.map"},
    {"fovea run --config @/only.yaml --picture none",
     "@/only.yaml:2: map.localise_only: |map.load"},
    {"fovea config --set T_body_cam=[1,2]", "T_body_cam|12 numbers"},
    {"fovea run --source sim: --set odometry.enabled=false --save-map @/no.map",
     "map.save|@/no.map|odometry.enabled"},
    {"fovea run --source sim: --set odometry.enabled=false --map @/no.map",
     "map.load|@/no.map|odometry.enabled"},
    {"fovea run --source sim: --set odometry.enabled=false --trajectory @/no.tum",
     "--trajectory|odometry.enabled"},
    {"fovea run --source sim: --set odometry.enabled=false --trajectory-final @/no.tum",
     "--trajectory-final|odometry.enabled"},
    {"fovea run --source sim: --truth=", "--truth|''"},
    {"fovea run --source fault:sim:orbit", "fault: kind|last '?'|freeze black"},
    {"fovea run --source fault:sim:orbit?kind=blurr", "fault: kind|'blurr'|freeze black"},
    {"fovea run --source fault:kitti:/none?kind=blur", "/none"},
    {"fovea run --source sim:orbit --frames 2 --truth @/none/x", "--truth|@/none/x"},
    {"fovea run --source sim: --map @/no.map --stats @/no.map", "--stats|the file of --map"},
    {"fovea run --source sim: --map @/no.map --save-map @/no.map --picture @/no.map",
     "--picture|@/no.map|--save-map"},
    {"fovea run --source sim: --map @/no.map --trajectory-final @/no.map",
     "--trajectory-final|the file of --map"},
    {"fovea run --stats @/two --trajectory @/./two", "--stats|@/two|--trajectory"},
    {"fovea run --record @/two --set lcm_url=file://@/./two?mode=w", "--record|@/two|lcm_url"},
    {"fovea run --config @/text.yaml --set lcm_url=file://@/text.yaml?mode=a",
     "lcm_url|@/text.yaml|--config"},
    {"fovea run --source lcmlog:@/text.yaml --set lcm_url=file://@/text.yaml?mode=w",
     "lcm_url|@/text.yaml|--source"},
    {"fovea replay @/text.yaml --lcm-url file://@/text.yaml?mode=w",
     "--lcm-url|@/text.yaml|the recording"},
    {"fovea run --config=", "--config|''"},
    {"fovea check --source sim: --set image.operations=[white_balance]",
     "image.operations|white_balance|image.seen_by"},
    {"fovea check --source sim: --set image.operations=[white_balance] --set image.seen_by=networks",
     "image.operations|white_balance|detect.model"},
    {"fovea check --source sim: --set image.operations=[white_balance] --set image.seen_by=networks "
     "--set detect.model=tests/golden/detector.fvm",
     "image.operations|white_balance|a source with colours"},
    /* Options that would do nothing, and values out of their ranges. */
    {"fovea image @/a @/b --operations denoise,blur", "--operations|'blur'|white_balance"},
    {"fovea image @/a @/b", "--operations"},
    {"fovea image @/a @/b --operations sharpen --limit 3", "--limit|contrast_enhancement"},
    {"fovea image @/a @/b --operations sharpen --denoise median", "--denoise|expected denoise"},
    {"fovea image @/a @/b --operations denoise --denoise median --sigma 2", "--sigma|bilateral"},
    {"fovea image @/a @/b --operations normalize --mean 90", "--mean|--normalize deviation"},
    {"fovea image @/a @/b.jpg --operations sharpen", "OUT|@/b.jpg|written as PNG"},
    {"fovea edges @/a @/b.TIF", "OUT|@/b.TIF|written as PNG"},
    {"fovea segments @/a @/b.bmp", "OUT|@/b.bmp|written as PNG"},
    {"fovea features @/a --draw @/b.jpeg", "--draw|@/b.jpeg|written as PNG"},
    {"fovea match @/a @/b --draw @/b.webp", "--draw|@/b.webp|written as PNG"},
    {"fovea match @/a @/b --geometry essential", "--focal|found none"},
    {"fovea image @/a @/b --operations white_balance --gamma 2", "--gamma|expected gamma"},
    {"fovea image @/a @/b --operations denoise --size 2.5", "--size|'2.5'|whole number"},
    {"fovea edges @/a @/b --method sobel --low 4", "--low|--method canny"},
    {"fovea edges @/a @/b --method laplacian --norm l2", "--norm|--method canny"},
    {"fovea edges @/a @/b --laplacian-size 3", "--laplacian-size|--method laplacian"},
    {"fovea features @/a --method harris --levels 3", "--levels|orb, sift or surf"},
    {"fovea features @/a --method fast --upright", "--upright|--oriented"},
    {"fovea features @/a --oriented", "--oriented|--upright"},
    {"fovea features @/a --distance 9", "--distance|harris or shi_tomasi"},
    {"fovea features @/a --method harris --distance 999", "--distance|999|256"},
    {"fovea features @/a --method sift --descriptor binary", "--descriptor|binary|float"},
    {"fovea match @/a @/b --method sift --threshold 9", "--threshold|fast or orb"},
    {"fovea match @/a @/b --focal 500", "--focal|--geometry essential"},
    {"fovea match @/a @/b --geometry any --residual 2", "--residual|homography"},
    {"fovea match @/a @/b --matcher approximate", "--matcher|approximate|brute_force"},
};

/* Where a file is read: none of these is opened, so none can hang. */
static const char *const readers[][2] = {
    {"fovea run --config %s", "%s"},
    {"fovea config --check %s", "%s"},
    {"fovea run --camera %s", "%s"},
    {"fovea run --map %s", "%s"},
    {"fovea run --model %s", "%s"},
    {"fovea run --set mask=%s", "%s: mask"},
    {"fovea run --source lcmlog:%s", "%s"},
    {"fovea run --source video:%s", "%s|expected a video"},
    {"fovea run --source images:%s", "%s"},
    {"fovea replay %s", "%s"},
    {"fovea features %s", "%s"},
    {"fovea detect --model src/detect/shipped.fvm %s", "%s"},
    {"fovea map info %s", "%s"},
    {"fovea model info %s", "%s"},
};

static void test_pipes_and_devices_as_files(void **state)
{
    static const char *const files[][2] = {{"@/sub/pipe", "a pipe"}, {"/dev/zero", "a device"}};
    char pipe[PATH_BYTES];
    (void)state;
    snprintf(pipe, sizeof pipe, "%s/sub", fv_test_place);
    assert_int_equal(mkdir(pipe, 0700), 0);
    snprintf(pipe, sizeof pipe, "%s/sub/pipe", fv_test_place);
    assert_int_equal(mkfifo(pipe, 0600), 0);
    for (size_t i = 0; i < sizeof readers / sizeof readers[0]; i++)
        for (int k = 0; k < 2; k++) {
            char command[256], names[256];
            const bool video = strstr(readers[i][0], "video") != NULL;
            snprintf(command, sizeof command, readers[i][0], files[k][0]);
            size_t used = (size_t)snprintf(names, sizeof names, readers[i][1], files[k][0]);
            if (!video) snprintf(names + used, sizeof names - used, "|found %s", files[k][1]);
            fv_test_refused(command, names);
        }
    unlink(pipe);
    *strrchr(pipe, '/') = '\0';
    rmdir(pipe);
}

/* An option's error names that option, not the key's. */
static void test_paths_that_are_too_long(void **state)
{
    static const char *const options[] = {"--save-map", "--map", "--model", "--record", "--camera"};
    char command[2048], names[64];
    (void)state;
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
        size_t used = (size_t)snprintf(command, sizeof command, "fovea run %s /", options[i]);
        memset(command + used, 'a', 1200);
        command[used + 1200] = '\0';
        snprintf(names, sizeof names, "%s: found 1201 bytes, expected at most 1023", options[i]);
        fv_test_refused(command, names);
    }
    fv_test_refused("fovea run --rate fast", "--rate: found");
}

/* What the path looks like is named. */
static void test_a_data_set_of_another_kind(void **state)
{
    static const char *const commands[][2] = {
        {"fovea run --source tum:@/set", "; this looks like euroc:@/set"},
        {"fovea export --source kitti:@/set @/out", "; this looks like euroc:@/set"},
        {"fovea run --source lcmlog:@/set", "; this looks like euroc:@/set"},
        {"fovea run --source euroc:@/set/log", "; this looks like lcmlog:@/set/log"},
        {"fovea run --source images:@/set", "; this looks like euroc:@/set"},
        {"fovea run --source images:@/set/log", "; this looks like lcmlog:@/set/log"},
        {"fovea run --source video:@/set", "; this looks like euroc:@/set"},
        {"fovea run --source tum:@/set/mav0/cam0/data",
         "; this looks like images:@/set/mav0/cam0/data"},
    };
    char path[PATH_BYTES];
    (void)state;
    static const char *const folders[] = {"set", "set/mav0", "set/mav0/cam0", "set/mav0/cam0/data"};
    for (int i = 0; i < 4; i++) {
        snprintf(path, sizeof path, "%s/%s", fv_test_place, folders[i]);
        assert_int_equal(mkdir(path, 0700), 0);
    }
    fv_test_put("set/mav0/cam0/data.csv", "#\n", 2);
    fv_test_put("set/mav0/cam0/data/1.PNG", "", 0);
    fv_test_put("set/log", "\xED\xA1\xDA\x01", 4);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
        fv_test_refused(commands[i][0], commands[i][1]);
    snprintf(path, sizeof path, "%s/set", fv_test_place);
    fv_test_folder_remove(path);
}

/* `config --check` opens what a configuration names. */
static void test_the_files_of_a_configuration(void **state)
{
    static const char *const files[][2] = {
        {"camera: /none.yaml\n", "@/files.yaml:1: camera: /none.yaml"},
        {"mask: /none.png\n", "@/files.yaml:1: mask: /none.png"},
        {"map: {load: /none.map}\n", "@/files.yaml:1: map.load: /none.map"},
        {"map: {load: tests/golden/decoders.txt}\n", "@/files.yaml:1: map.load:"},
        {"detect: {model: /none.fvm}\n", "@/files.yaml:1: detect.model: /none.fvm"},
        {"source: 'tum:/none'\n", "@/files.yaml:1: source: /none"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        fv_test_put("files.yaml", files[i][0], strlen(files[i][0]));
        fv_test_refused("fovea config --check @/files.yaml", files[i][1]);
    }
    fv_test_put("lite.tflite", "\x1c\0\0\0TFL3....", 12);
    fv_test_refused("fovea run --model @/lite.tflite",
                    "@/lite.tflite: found a TensorFlow Lite model|tools/import @/lite.tflite");
}

/* A file that is too large is refused before it is read. */
static void test_files_over_their_limit(void **state)
{
    static const char *const commands[] = {
        "fovea run --config @/large", "fovea run --camera @/large",   "fovea run --map @/large",
        "fovea run --model @/large",  "fovea run --set mask=@/large", "fovea features @/large"};
    char path[PATH_BYTES];
    (void)state;
    snprintf(path, sizeof path, "%s/large", fv_test_place);
    fv_test_put("large", "", 0);
    assert_int_equal(truncate(path, (off_t)1 << 40), 0);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
        fv_test_refused(commands[i], "@/large|found 1099511627776 bytes, expected at most");
    unlink(path);
}

static void test_arguments(void **state)
{
    (void)state;
    static const char camera[] = "seed: 1\ncamera: /none/cam.yaml\n",
                      record[] = "record: /none/run.lcm\nlcm_url: ''\n",
                      source[] = "seed: 1\nsource: nothing\n",
                      save[] = "map:\n  save: /none/run.map\n",
                      only[] = "map:\n  localise_only: true\n";
    fv_test_put("text.yaml", "seed: 1\n", 8);
    fv_test_put("camera.yaml", camera, sizeof camera - 1);
    fv_test_put("record.yaml", record, sizeof record - 1);
    fv_test_put("cam0.yaml", "# one\ncam0: 5\n", 14);
    fv_test_put("source.yaml", source, sizeof source - 1);
    fv_test_put("save.yaml", save, sizeof save - 1);
    fv_test_put("only.yaml", only, sizeof only - 1);
    for (size_t i = 0; i < sizeof wrong_arguments / sizeof wrong_arguments[0]; i++)
        fv_test_refused(wrong_arguments[i][0], wrong_arguments[i][1]);
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
        cmocka_unit_test(test_arguments),
        cmocka_unit_test(test_pipes_and_devices_as_files),
        cmocka_unit_test(test_files_over_their_limit),
        cmocka_unit_test(test_paths_that_are_too_long),
        cmocka_unit_test(test_a_data_set_of_another_kind),
        cmocka_unit_test(test_the_files_of_a_configuration),
        cmocka_unit_test(test_there_were_enough),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}
