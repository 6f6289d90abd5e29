/* fovea segment: masks and drawings of any network that labels pixels, the matrix of label pictures
 * beside one counted here, wrong maps and labels refused; and on real pictures with a real network
 * the matrix that a script of numpy finds. What the commands that run a network on pictures cannot
 * write, they refuse before it runs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "app/lab/commands.h"
#include "common/imported.h"
#include "nn/model.h"
#include "support/picture.h"

enum { PATH_BYTES = 160, WIDTH = 96, HEIGHT = 80, MODEL_MAX = 1 << 16, TEXT_MAX = 1 << 16 };

static char folder[] = "/tmp/fovea-segment-XXXXXX";
static char model[PATH_BYTES], picture[PATH_BYTES], labels[PATH_BYTES], label[PATH_BYTES],
    map[PATH_BYTES], mask[PATH_BYTES], drawn[PATH_BYTES], text[PATH_BYTES];

static void write_file(const char *path, const void *data, size_t bytes)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, bytes, file), bytes);
    assert_int_equal(fclose(file), 0);
}

/* A command with what it prints in `text`. */
static int call(int (*command)(int, char **), const char *const *words)
{
    char *argv[64];
    int argc = 0;
    for (; words[argc] != NULL && argc < 63; argc++)
        argv[argc] = (char *)(uintptr_t)words[argc];
    argv[argc] = NULL;
    fflush(stdout);
    const int kept = dup(1);
    assert_non_null(freopen(text, "w", stdout));
    const int status = command(argc, argv);
    fflush(stdout);
    assert_true(dup2(kept, 1) >= 0);
    close(kept);
    return status;
}
#define SEGMENT(...) call(fv_command_segment, (const char *const[]){"segment", __VA_ARGS__, NULL})

static const char *read_text(const char *path)
{
    static char read[TEXT_MAX];
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    const size_t bytes = fread(read, 1, sizeof read - 1, file);
    fclose(file);
    read[bytes] = '\0';
    return read;
}

static const char *said(void)
{
    return read_text(text);
}

static void write_picture(const char *path, int width, int height, const uint8_t *pixels)
{
    struct fovea_error error;
    const struct fovea_image image = {.data = pixels,
                                      .width = width,
                                      .height = height,
                                      .stride_bytes = width,
                                      .format = FOVEA_PIXEL_GREY8,
                                      .size_bytes = (size_t)width * (size_t)height};
    assert_int_equal(fv_picture_write(path, &image, &error), FOVEA_OK);
}

/* The golden network as one that labels pixels. */
static void make_model(int32_t decoder)
{
    static _Alignas(64) uint8_t bytes[MODEL_MAX];
    FILE *file = fopen("tests/golden/detector.fvm", "rb");
    assert_non_null(file);
    const size_t count = fread(bytes, 1, MODEL_MAX, file);
    fclose(file);
    struct fv_model_header *header = (struct fv_model_header *)(void *)bytes;
    header->decode = (struct fv_model_decode){.kind = decoder, .probabilities = 1};
    header->checksum = fv_model_checksum(bytes + 16, count - 16);
    write_file(model, bytes, count);
}

static int set_up(void **state)
{
    (void)state;
    static uint8_t pixels[WIDTH * HEIGHT];
    if (mkdtemp(folder) == NULL) return -1;
    const struct {
        char *path;
        const char *name;
    } paths[] = {{model, "m.fvm"},        {picture, "a.png"}, {labels, "labels"},
                 {label, "labels/a.png"}, {map, "map.txt"},   {mask, "mask.png"},
                 {drawn, "drawn.png"},    {text, "said.txt"}};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++)
        snprintf(paths[i].path, PATH_BYTES, "%s/%s", folder, paths[i].name);
    mkdir(labels, 0777);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)(i % WIDTH * 5 ^ i / WIDTH * 3);
    write_picture(picture, WIDTH, HEIGHT, pixels);
    make_model(FV_DECODER_SEGMENT);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    char command[PATH_BYTES + 16];
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

static struct fovea_image read_mask(void)
{
    struct fovea_image image;
    struct fovea_error error;
    if (fv_picture_read(mask, &image, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(image.width == WIDTH && image.height == HEIGHT);
    return image;
}

static void masks_and_drawings_are_written_alike_in_units(void **state)
{
    (void)state;
    assert_int_equal(SEGMENT("--model", model, picture, "--draw", drawn, "--mask", mask), 0);
    assert_non_null(strstr(said(), "\"segments\": [{\"class\": "));
    assert_non_null(strstr(said(), "\"confidence\": 0."));
    assert_int_equal(access(drawn, R_OK), 0);
    const struct fovea_image whole = read_mask();
    unlink(mask);
    assert_int_equal(SEGMENT("--model", model, picture, "--mask", mask, "--units", "1"), 0);
    const struct fovea_image sliced = read_mask();
    assert_memory_equal(whole.data, sliced.data, (size_t)WIDTH * HEIGHT);
    bool differ = false;
    for (int i = 1; i < WIDTH * HEIGHT; i++)
        differ |= whole.data[i] != whole.data[0];
    assert_true(differ);
    free((void *)(uintptr_t)whole.data);
    free((void *)(uintptr_t)sliced.data);
}

/* Labels 0 to 4, of which 4 is ignored, 3 is other, 0 and 1 are both class 0, 2 is class 1. */
static void the_matrix_counts_pixels_by_label_and_class(void **state)
{
    (void)state;
    static uint8_t truth[WIDTH * HEIGHT];
    static const char lines[] = "# labels\n0 0\n 1\t0 # too\r\n\n2 1\n3 other\n4 ignore\n";
    static const int row_of[6] = {0, 0, 1, 2, -1, -1};
    int cells[3][3] = {{0}}, pixels = 0;
    char expected[400];
    assert_int_equal(SEGMENT("--model", model, picture, "--mask", mask), 0);
    const struct fovea_image seen = read_mask();
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        truth[i] = (uint8_t)(i / 7 % 6);
        const int row = row_of[truth[i]], column = seen.data[i] < 2 ? seen.data[i] : 2;
        if (row < 0) continue;
        cells[row][column]++;
        pixels++;
    }
    free((void *)(uintptr_t)seen.data);
    write_picture(label, WIDTH, HEIGHT, truth);
    write_file(map, lines, sizeof lines - 1);
    assert_int_equal(
        SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map, "--json"),
        0);
    const double iou0 =
        cells[0][0] / (double)(cells[0][0] + cells[0][1] + cells[0][2] + cells[1][0] + cells[2][0]);
    snprintf(
        expected, sizeof expected,
        "{\"pictures\": 1, \"pixels\": %d, \"ignored\": %d, \"classes\": [\"0\", \"1\", "
        "\"other\"], \"confusion\": [[%d, %d, %d], [%d, %d, %d], [%d, %d, %d]], \"iou\": [%.6f, ",
        pixels, WIDTH * HEIGHT - pixels, cells[0][0], cells[0][1], cells[0][2], cells[1][0],
        cells[1][1], cells[1][2], cells[2][0], cells[2][1], cells[2][2], iou0);
    if (strstr(said(), expected) == NULL) fail_msg("%s is not in %s", expected, said());
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map),
                     0);
    assert_non_null(strstr(said(), "\nmean "));
}

/* What `fovea export --masks` leaves beside its pictures goes before a picture of the same name. */
static void masks_of_exports_are_labels(void **state)
{
    (void)state;
    static uint8_t truth[WIDTH * HEIGHT];
    char exported[PATH_BYTES + 16];
    snprintf(exported, sizeof exported, "%s/a.mask.png", labels);
    write_picture(label, WIDTH, HEIGHT, truth);
    memset(truth, 9, sizeof truth);
    write_picture(exported, WIDTH, HEIGHT, truth);
    write_file(map, "0 0\n9 ignore\n", 13);
    assert_int_equal(
        SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map, "--json"),
        2); /* nothing is judged */
    unlink(exported);
    assert_int_equal(
        SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map, "--json"),
        0);
    assert_non_null(strstr(said(), "\"ignored\": 0,"));
}

/* A folder of `fovea export --masks` says itself what its labels are to the network that comes with
 * Fovea, whose class "other" is a class as any other. */
static void exported_folders_judge_the_shipped_network(void **state)
{
    (void)state;
    char frames[PATH_BYTES], first[PATH_BYTES + 16], classes[PATH_BYTES + 32];
    snprintf(frames, sizeof frames, "%s/frames", folder);
    snprintf(first, sizeof first, "%s/000000.png", frames);
    snprintf(classes, sizeof classes, "%s/classes-map.txt", frames);
    const char *const words[] = {
        "export",   "--masks", "--source", "sim:orbit?width=320&height=240",
        "--frames", "1",       frames,     NULL};
    assert_int_equal(call(fv_command_export, words), 0);
    assert_int_equal(SEGMENT("--model", "src/detect/segmenter.fvm", first, "--evaluate", frames,
                             "--classes-map", classes, "--json"),
                     0);
    assert_non_null(strstr(said(), "\"pixels\": 76800, \"ignored\": 0, \"classes\": [\"other\", "
                                   "\"movable\", \"floor\", \"wall\", \"obstacle\", "
                                   "\"none of them\"]"));
    assert_non_null(strstr(said(), ", [0, 0, 0, 0, 0, 0]], \"iou\": ")); /* no label is none */
}

/* All pictures of two cameras' export: those of the first are judged, by the masks. */
static void label_pictures_and_further_cameras_are_left_out(void **state)
{
    (void)state;
    static const char *const kinds[] = {"", ".mask", ".cam1"};
    static char frames[PATH_BYTES], other[PATH_BYTES], paths[6][PATH_BYTES + 32],
        classes[PATH_BYTES + 32];
    static char alone[TEXT_MAX];
    snprintf(frames, sizeof frames, "%s/rig", folder);
    snprintf(other, sizeof other, "%s/other", folder);
    snprintf(classes, sizeof classes, "%s/classes-map.txt", frames);
    for (int i = 0; i < 6; i++)
        snprintf(paths[i], sizeof paths[i], "%s/%06d%s.png", frames, i % 2, kinds[i / 2]);
    static const char uri[] = "sim:drive?seed=3&width=160&height=120&baseline=0.12";
    const char *const words[] = {"export", "--masks", "--source", uri, "--frames",
                                 "2",      "--step",  "30",       NULL};
    for (int i = 0; i < 2; i++) {
        const char *to[10];
        memcpy(to, words, sizeof words);
        to[8] = i == 0 ? frames : other;
        to[9] = NULL;
        assert_int_equal(call(fv_command_export, to), 0);
    }
#define JUDGE(...)                                                                                 \
    SEGMENT("--model", "src/detect/segmenter.fvm", "--classes-map", classes, "--json",             \
            "--evaluate", __VA_ARGS__)
    assert_int_equal(JUDGE(frames, paths[0], paths[1]), 0);
    assert_non_null(strstr(said(), "{\"pictures\": 2, \"pixels\": 38400, \"ignored\": 0,"));
    strcpy(alone, said());
    assert_int_equal(JUDGE(frames, paths[0], paths[1], paths[2], paths[3], paths[4], paths[5]), 0);
    assert_string_equal(said(), alone);
    assert_int_equal(JUDGE(frames, paths[2], paths[4]), 2); /* nothing is left */
    assert_int_equal(JUDGE(frames, paths[0], paths[0]), 2); /* two pictures by one mask */
    assert_int_equal(JUDGE(other, paths[0], paths[1]), 2);  /* beside which their own masks lie */
    for (int i = 2; i < 4; i++)
        unlink(paths[i]);
    assert_int_equal(JUDGE(other, paths[0], paths[1], paths[4]), 0);
    assert_string_equal(said(), alone);
    assert_int_equal(JUDGE(frames, paths[0]), 2); /* by itself */
    assert_int_equal(JUDGE(frames, paths[4]), 2);
#undef JUDGE
}

static void wrong_maps_labels_and_networks_are_refused(void **state)
{
    (void)state;
    static const char *const wrong[] = {"",        "# none\n", "0 0\n0 1\n", "256 0\n",
                                        "-1 0\n",  "x 0\n",    "0\n",        "0 nothing\n",
                                        "0 255\n", "0 -1\n",   "0 ignore\n", "7 0\n"};
    static uint8_t truth[WIDTH * HEIGHT];
    write_picture(label, WIDTH, HEIGHT, truth);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        write_file(map, wrong[i], strlen(wrong[i]));
        assert_int_equal(
            SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map), 2);
    }
    write_file(map, "0 0\n", 4);
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map),
                     0);
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map,
                             "--draw", label),
                     2); /* which would be lost */
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map),
                     0);
    write_picture(label, WIDTH - 1, HEIGHT, truth);
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map),
                     2);
    write_file(label, "\x89PNG\r\n\x1a\n damage", 15);
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map),
                     2);
    unlink(label);
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels, "--classes-map", map),
                     2);
    assert_int_equal(SEGMENT("--model", model, picture, "--evaluate", labels), 2);
    assert_int_equal(SEGMENT("--model", model, picture, "--classes-map", map), 2);
    assert_int_equal(SEGMENT("--model", model, picture, picture, "--mask", mask), 2);
    assert_int_equal(SEGMENT("--model", model, picture, "--mask", picture), 2);
    assert_int_equal(SEGMENT(picture), 2);
    assert_int_equal(SEGMENT("--model", "src/detect/shipped.fvm", picture), 2);
}

/* The command ends before it runs a network: one line says why `path` cannot be written. */
static void refuses(int (*command)(int, char **), const char *const *words, const char *path,
                    int why)
{
    char errors[PATH_BYTES], line[PATH_BYTES + 80];
    snprintf(errors, sizeof errors, "%s/errors.txt", folder);
    snprintf(line, sizeof line, "%s: cannot be written: %s\n", path, strerror(why));
    const int kept = dup(2), file = open(errors, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_true(kept >= 0 && dup2(file, 2) >= 0);
    const int status = call(command, words);
    assert_true(dup2(kept, 2) >= 0);
    close(kept);
    close(file);
    assert_int_equal(status, 2);
    assert_string_equal(said(), "");
    assert_string_equal(read_text(errors), line);
}
#define REFUSES(command, path, why, ...)                                                           \
    refuses(command, (const char *const[]){__VA_ARGS__, NULL}, path, why)

static void what_cannot_be_written_is_refused_before_the_network_runs(void **state)
{
    (void)state;
    char absent[PATH_BYTES], beside[PATH_BYTES + 8];
    snprintf(absent, sizeof absent, "%s/absent/out.png", folder);
    snprintf(beside, sizeof beside, "%s/a.png", picture); /* the picture is no folder */
    write_file(mask, "kept", 4);
    unlink(drawn);
    REFUSES(fv_command_segment, absent, ENOENT, "segment", "--model", model, picture, "--draw",
            absent, "--mask", mask);
    assert_string_equal(read_text(mask), "kept");
    REFUSES(fv_command_segment, absent, ENOENT, "segment", "--model", model, picture, "--draw",
            drawn, "--mask", absent);
    assert_int_not_equal(access(drawn, F_OK), 0);
    REFUSES(fv_command_segment, beside, ENOTDIR, "segment", "--model", model, picture, "--mask",
            beside);
    REFUSES(fv_command_model, absent, ENOENT, "model", "run", model, picture, "--out", absent);
    snprintf(beside, sizeof beside, "%s/", mask);
    REFUSES(fv_command_detect, beside, ENOTDIR, "detect", "--model", model, picture, "--draw",
            mask);
    assert_string_equal(read_text(mask), "kept");
}

/* ---- a real network -------------------------------------------------------------------------- */

static int shell(const char *format, const char *a, const char *b, const char *c)
{
    char command[1600];
    const char *python = getenv("FOVEA_PYTHON");
    const int used = snprintf(command, sizeof command, "%s ",
                              python != NULL ? python : "build/venv-import/bin/python");
    snprintf(command + used, sizeof command - (size_t)used, format, a, b, c);
    return system(command);
}

/* Image and label folders' pictures into `words`. */
static int street_pictures(const char *data, const char **words, char paths[][512], int most)
{
    char command[700];
    int count = 0;
    snprintf(command, sizeof command, "ls '%s'/street_camvid/img/*.png 2>/dev/null", data);
    FILE *list = popen(command, "r");
    assert_non_null(list);
    while (count < most && fgets(paths[count], 512, list) != NULL) {
        paths[count][strcspn(paths[count], "\n")] = '\0';
        words[count] = paths[count];
        count++;
    }
    pclose(list);
    return count;
}

static void streets_give_the_matrix_of_an_independent_script(void **state)
{
    (void)state;
    enum { MOST = 40 };
    static char paths[MOST][512], outputs[PATH_BYTES], annotations[512];
    static const char lines[] = "8 car\n9 person\n10 bicycle\n";
    const char *words[MOST + 12] = {"segment",       "--model", model,        "--json",
                                    "--classes-map", map,       "--evaluate", annotations};
    const char *data = fv_data_folder();
    const int count = street_pictures(data, words + 8, paths, MOST);
    snprintf(outputs, sizeof outputs, "%s/outputs.npz", folder);
    snprintf(annotations, sizeof annotations, "%s/street_camvid/annot", data);
    if (count == 0) printf("SKIPPED streets: no pictures in $FOVEA_DATA\n");
    if (count == 0 || !fv_test_import("deeplabv3_mnv2_dm05_pascal_quant",
                                      "pascal_voc_segmentation_labels.txt", model))
        return;
    write_file(map, lines, sizeof lines - 1);
    assert_int_equal(call(fv_command_segment, words), 0);
    char evaluation[PATH_BYTES + 8];
    snprintf(evaluation, sizeof evaluation, "%s.json", text);
    assert_int_equal(rename(text, evaluation), 0);
    const char *again[MOST + 8] = {"model", "run", model};
    memcpy(again + 3, words + 8, (size_t)count * sizeof *again);
    again[3 + count] = "--out";
    again[4 + count] = outputs;
    assert_int_equal(call(fv_command_model, again), 0);
    char rest[900];
    snprintf(rest, sizeof rest, "'%s/street_camvid/img' '%s' '%s'", data, annotations, map);
    assert_int_equal(shell("tests/segment/confusion.py '%s' %s '%s' car=7 person=15 bicycle=2",
                           outputs, rest, evaluation),
                     0);
}

/* Of the network that comes with Fovea, on pictures of three shapes, which do not fill its input;
 * of the second its borders end within pixels of the mask. */
static void letterboxed_pictures_give_the_matrix_of_an_independent_script(void **state)
{
    (void)state;
    static const char *const sizes[] = {"width=320&height=240", "width=618&height=188",
                                        "width=250&height=330"};
    static const char lines[] = "5 floor\n6 wall\n7 obstacle\n8 obstacle\n0 "
                                "other\n1 movable\n4 movable\n";
    char command[1400], uri[80], images[PATH_BYTES], outputs[PATH_BYTES], truths[PATH_BYTES],
        seen[2][PATH_BYTES];
    if (shell("-c 'import numpy' 2>/dev/null%s%s%s", "", "", "") != 0) {
        puts("SKIPPED letterboxed pictures: no python with numpy");
        return;
    }
    snprintf(images, sizeof images, "%s/boxed", folder);
    snprintf(truths, sizeof truths, "%s/truths", folder);
    snprintf(outputs, sizeof outputs, "%s/boxed.npz", folder);
    write_file(map, lines, sizeof lines - 1);
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        snprintf(uri, sizeof uri, "sim:drive?seed=%zu&%s", 40 + i, sizes[i]);
        const char *const words[] = {"export", "--masks", "--source", uri,    "--frames",
                                     "2",      "--step",  "30",       images, NULL};
        assert_int_equal(call(fv_command_export, words), 0);
        for (int k = 0; k < 2; k++)
            snprintf(seen[k], sizeof seen[k], "%.140s/%06d.png", images, k);
        snprintf(
            command, sizeof command,
            "cd '%s' && mkdir '%s' && for i in 0 1; do mv 00000$i.mask.png '%s'/00000$i.png || "
            "exit 1; done && rm *.txt *.json",
            images, truths, truths);
        assert_int_equal(system(command), 0);
        assert_int_equal(SEGMENT("--model", "src/detect/segmenter.fvm", "--json", "--classes-map",
                                 map, "--evaluate", truths, seen[0], seen[1]),
                         0);
        snprintf(command, sizeof command, "mv '%s' '%s.json'", text, text);
        assert_int_equal(system(command), 0);
        const char *const again[] = {
            "model", "run", "src/detect/segmenter.fvm", seen[0], seen[1], "--out", outputs, NULL};
        assert_int_equal(call(fv_command_model, again), 0);
        snprintf(command, sizeof command, "'%s' '%s' '%s' '%s' '%s.json'", outputs, images, truths,
                 map, text);
        assert_int_equal(shell("tests/segment/confusion.py --letterbox 640x480 %s%s%s floor=0 "
                               "wall=1 obstacle=2 movable=3 other=4",
                               command, "", ""),
                         0);
        snprintf(command, sizeof command, "rm -r '%s' '%s'", images, truths);
        assert_int_equal(system(command), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(masks_and_drawings_are_written_alike_in_units),
        cmocka_unit_test(the_matrix_counts_pixels_by_label_and_class),
        cmocka_unit_test(masks_of_exports_are_labels),
        cmocka_unit_test(exported_folders_judge_the_shipped_network),
        cmocka_unit_test(label_pictures_and_further_cameras_are_left_out),
        cmocka_unit_test(wrong_maps_labels_and_networks_are_refused),
        cmocka_unit_test(what_cannot_be_written_is_refused_before_the_network_runs),
        cmocka_unit_test(streets_give_the_matrix_of_an_independent_script),
        cmocka_unit_test(letterboxed_pictures_give_the_matrix_of_an_independent_script),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
