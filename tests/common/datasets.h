/* Small recordings that tests write for themselves, so that they need no data from outside.
 * Whatever fails here fails the test with a message. */
#ifndef FOVEA_TESTS_DATASETS_H
#define FOVEA_TESTS_DATASETS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/source.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_TEST_WIDTH = 96, FV_TEST_HEIGHT = 64, FV_TEST_FRAMES = 12, FV_TEST_PATH_BYTES = 512 };

/* A new folder that fv_test_folder_remove takes away with all that is in it. Returns `path`. */
const char *fv_test_folder(char path[FV_TEST_PATH_BYTES]);
/* The same in memory where that can be had: for what is judged as it runs by the clock, since
 * others' writes can hold up a disk for seconds. */
enum { FV_TEST_IN_MEMORY_BYTES = 32 };
const char *fv_test_folder_in_memory(char path[FV_TEST_IN_MEMORY_BYTES]);
void fv_test_folder_remove(const char *path);
/* One for all tests of a program, as fixtures of CMocka. */
extern char fv_test_place[FV_TEST_PATH_BYTES];
int fv_test_place_set_up(void **state);
int fv_test_place_tear_down(void **state);

/* "folder/name", valid until eight calls later. */
const char *fv_test_path(const char *folder, const char *name);
void fv_test_make_folder(const char *path); /* and those above it */
void fv_test_write(const char *path, const void *bytes, size_t count);
void fv_test_write_text(const char *path, const char *text);
void *fv_test_read(const char *path, size_t *bytes); /* caller frees */

/* Frame `index` of every recording written here: width x height grey levels, or RGB with
 * channels 3. */
void fv_test_picture(uint32_t index, int32_t width, int32_t height, int32_t channels,
                     uint8_t *pixels);

struct fv_test_png {
    int32_t width, height, channels; /* 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA */
    int32_t depth;                   /* 8 or 16 bits */
    bool interlaced;
};
void fv_test_write_png(const char *path, const struct fv_test_png *form, const uint8_t *samples);
/* channels 1 or 3; `rgb` keeps RGB in the file instead of YCbCr. */
void fv_test_write_jpeg(const char *path, int32_t width, int32_t height, int32_t channels,
                        bool progressive, bool rgb, const uint8_t *samples);

/* Recordings of FV_TEST_FRAMES grey frames at 20 per second in a new folder below `folder`; returns
 * its path (of the file for logs and videos), valid until eight calls of fv_test_path later. With
 * calibration and ground truth where the layout has them: the camera moves by 0.1 m per frame along
 * x of the world. */
const char *fv_test_euroc(const char *folder);
const char *fv_test_tum(const char *folder); /* JPEG */
const char *fv_test_kitti(const char *folder);
const char *fv_test_images(const char *folder);
const char *fv_test_lcmlog(const char *folder);
const char *fv_test_video(const char *folder); /* motion JPEG in AVI */
const char *fv_test_long_video(const char *folder, uint32_t frames);

#ifdef __cplusplus
}
#endif
#endif
