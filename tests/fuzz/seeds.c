/* Writes the seeds of the fuzz targets that read recordings and calibrations
 * (tools/make_fuzz_seeds.sh). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/datasets.h"
#include "common/small_map.h"
#include "fovea/calibration.h"

static void write_pictures(const char *corpus)
{
    static uint8_t picture[64 * 64 * 4];
    char name[64];
    fv_test_make_folder(fv_test_path(corpus, "fuzz_png"));
    fv_test_make_folder(fv_test_path(corpus, "fuzz_jpeg"));
    for (int kind = 0; kind < 8; ++kind) {
        const struct fv_test_png form = {.width = 64,
                                         .height = 64,
                                         .channels = 1 + kind % 4,
                                         .depth = 8,
                                         .interlaced = kind >= 4};
        memset(picture, 40 * kind, sizeof picture);
        snprintf(name, sizeof name, "fuzz_png/kind%d.png", kind);
        fv_test_write_png(fv_test_path(corpus, name), &form, picture);
        if (kind >= 6) continue;
        snprintf(name, sizeof name, "fuzz_jpeg/kind%d.jpg", kind);
        fv_test_write_jpeg(fv_test_path(corpus, name), 64, 64, kind < 2 ? 1 : 3, kind % 2 == 1,
                           kind >= 4, picture);
    }
}

static void write_calibrations(const char *corpus)
{
    struct fovea_calibration c = {
        .camera = {.width = 640, .height = 480, .fx = 500, .fy = 501, .cx = 320, .cy = 240},
        .name = "cam0",
        .has_T_body_cam = true,
        .T_body_cam = {1, 0, 0, 0.1, 0, 1, 0, 0.2, 0, 0, 1, 0.3},
        .rate_hz = 20};
    fv_test_make_folder(fv_test_path(corpus, "fuzz_calibration"));
    for (int format = 0; format < FOVEA_CALIBRATION_FORMAT_COUNT; ++format) {
        char name[64], text[FOVEA_CALIBRATION_BYTES_MAX];
        struct fovea_error error;
        c.camera.lens = format % 2 == 0 ? FOVEA_LENS_RADTAN : FOVEA_LENS_EQUIDISTANT;
        c.camera.k[0] = -0.1;
        if (fovea_calibration_format_text((enum fovea_calibration_format)format, &c, text, NULL,
                                          &error) != FOVEA_OK)
            abort();
        snprintf(name, sizeof name, "fuzz_calibration/%s.yaml",
                 fovea_calibration_format_name((enum fovea_calibration_format)format));
        fv_test_write_text(fv_test_path(corpus, name), text);
    }
}

static void write_maps(const char *corpus)
{
    struct small_map small;
    struct fovea_random random;
    fv_test_make_folder(fv_test_path(corpus, "fuzz_map"));
    small_map_make(&small);
    fovea_random_seed(&random, 1);
    for (int keyframes = 0; keyframes < 3; keyframes++) {
        char name[64];
        size_t bytes;
        small.map.state->scale =
            (struct fv_map_scale){(uint32_t)keyframes, 0, 0.5, 0.01}; /* enum fovea_scale_source */
        uint8_t *data = small_map_save(&small, &bytes);
        snprintf(name, sizeof name, "fuzz_map/keyframes%d.map", keyframes);
        fv_test_write(fv_test_path(corpus, name), data, bytes);
        free(data);
        small_map_grow(&small, &random);
    }
    small_map_free(&small);
}

static void write_rest(const char *corpus)
{
    size_t bytes;
    char folder[FV_TEST_PATH_BYTES];
    fv_test_folder(folder);
    fv_test_make_folder(fv_test_path(corpus, "fuzz_lcmlog"));
    fv_test_make_folder(fv_test_path(corpus, "fuzz_poses"));
    uint8_t *log = fv_test_read(fv_test_lcmlog(folder), &bytes);
    fv_test_write(fv_test_path(corpus, "fuzz_lcmlog/two.lcmlog"), log, bytes / FV_TEST_FRAMES * 2);
    free(log);
    fv_test_write_text(fv_test_path(corpus, "fuzz_poses/euroc.csv"),
                       "#t\n5,1,2,3,1,0,0,0,9\n50000000,1,2,3,0.6,0.8,0,0\n");
    fv_test_write_text(fv_test_path(corpus, "fuzz_poses/tum.txt"),
                       "0.1 1 2 3 0 0 0 1\n0.2 1 2 3 0.6 0.8 0 0\n");
    fv_test_write_text(fv_test_path(corpus, "fuzz_poses/kitti.txt"),
                       "1 0 0 9e-1 0 1 0 0 0 0 1 0\n");
    fv_test_folder_remove(folder);
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: seeds CORPUS\n");
        return 2;
    }
    write_pictures(argv[1]);
    write_calibrations(argv[1]);
    write_maps(argv[1]);
    write_rest(argv[1]);
    return 0;
}
