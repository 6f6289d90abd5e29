/* Writes the seeds of the fuzz targets that read recordings and calibrations
 * (tools/make_fuzz_seeds.sh). */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/datasets.h"
#include "common/small_map.h"
#include "app/network/siphash.h"
#include "support/calibration.h"

#include "bot_core_pose_t.h"
#include "fovea_command_t.h"

static void write_pictures(const char *corpus)
{
    static uint8_t picture[64 * 64 * 4];
    char name[64];
    fv_test_make_folder(fv_test_path(corpus, "fuzz_png"));
    fv_test_make_folder(fv_test_path(corpus, "fuzz_jpeg"));
    for (int kind = 0; kind < 8; kind++) {
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
    struct fv_calibration c = {
        .camera = {.width = 640, .height = 480, .fx = 500, .fy = 501, .cx = 320, .cy = 240},
        .name = "cam0",
        .has_T_body_cam = true,
        .T_body_cam = {1, 0, 0, 0.1, 0, 1, 0, 0.2, 0, 0, 1, 0.3},
        .rate_hz = 20};
    fv_test_make_folder(fv_test_path(corpus, "fuzz_calibration"));
    for (int format = 0; format < FV_CALIBRATION_FORMAT_COUNT; format++) {
        char name[64], text[FV_CALIBRATION_BYTES_MAX];
        struct fovea_error error;
        const bool radtan = format % 2 == 0 || format == FV_CALIBRATION_PHOTONVISION; /* no other */
        c.camera.lens = radtan ? FOVEA_LENS_RADTAN : FOVEA_LENS_EQUIDISTANT;
        c.camera.k[0] = -0.1;
        if (fv_calibration_format_text((enum fv_calibration_format)format, &c, text, NULL,
                                       &error) != FOVEA_OK)
            abort();
        snprintf(name, sizeof name, "fuzz_calibration/%s.yaml",
                 fv_calibration_format_name((enum fv_calibration_format)format));
        fv_test_write_text(fv_test_path(corpus, name), text);
    }
}

static void write_maps(const char *corpus)
{
    struct small_map small;
    struct fv_random random;
    fv_test_make_folder(fv_test_path(corpus, "fuzz_map"));
    small_map_make(&small);
    fv_random_seed(&random, 1);
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
    int8_t cells[16 * 16];
    size_t bytes;
    small.map.state->gravity = (struct fv_map_gravity){{0.6, 0, 0.8}, 0.01};
    const struct fv_archive_grid grid = small_map_grid(&small, 16, &random, cells);
    uint8_t *data = small_map_save_with(&small, &grid, cells, sizeof cells, &bytes);
    fv_test_write(fv_test_path(corpus, "fuzz_map/grid.map"), data, bytes);
    free(data);
    small_map_free(&small);
}

static size_t put(uint8_t *at, const void *data, size_t bytes)
{
    memcpy(at, data, bytes);
    return bytes;
}

static void write_seed(const char *corpus, const char *name, const uint8_t *data, size_t bytes)
{
    char path[96];
    snprintf(path, sizeof path, "fuzz_receiver/%s", name);
    fv_test_write(fv_test_path(corpus, path), data, bytes);
}

/* A packet, a server's stream, and commands with and without their proof. */
static void write_received(const char *corpus)
{
    static const uint8_t key[FV_SIPHASH_KEY_BYTES] = "sixteen letters.";
    static const uint8_t greeting[] = {0x28, 0x76, 0x17, 0xfa, 0, 0, 1, 0};
    uint8_t text[512], out[512], pose[256];
    fovea_command_t command = {.commands = 2, .run_id = 77, .sender = 5, .counter = 10};
    const bot_core_pose_t odometry = {.utime = 1000000, .pos = {1, 2, 3}, .orientation = {1}};
    fv_test_make_folder(fv_test_path(corpus, "fuzz_receiver"));
    const size_t bytes = (size_t)fovea_command_t_encode(text, 0, sizeof text, &command);
    const size_t pose_bytes = (size_t)bot_core_pose_t_encode(pose, 0, sizeof pose, &odometry);
    command.mac = (int64_t)fv_siphash(key, text, bytes, 0);
    fovea_command_t_encode(text, 0, sizeof text, &command);
    for (uint8_t kind = 2; kind < 4; kind++) {
        size_t used = put(out, &kind, 1);
        used += put(out + used, text, bytes);
        write_seed(corpus, kind == 2 ? "keyed" : "command", out, used);
    }
    size_t used = put(out, "\0LC02\0\0\0\1C", 11);
    used += put(out + used, text, bytes);
    write_seed(corpus, "packet", out, used);
    used = put(out, "\0LC02\0\0\0\1O", 11);
    used += put(out + used, pose, pose_bytes);
    write_seed(corpus, "odometry", out, used);
    used = put(out, "\0LC03\0\0\0\1\0\0\0\x64\xff\xff\xff\xc0\0\0\0\2C", 24);
    write_seed(corpus, "fragment", out, used);
    used = put(out, "\1\7", 2);
    used += put(out + used, greeting, sizeof greeting);
    used += put(out + used, "\0\0\0\1\0\0\0\1O\0\0\0", 12);
    out[used++] = (uint8_t)pose_bytes;
    used += put(out + used, pose, pose_bytes);
    used += put(out + used, "\0\0\0\1\0\0\0\1R\xff\xff\xff\xff", 13);
    write_seed(corpus, "stream", out, used);
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
    write_received(argv[1]);
    write_rest(argv[1]);
    return 0;
}
