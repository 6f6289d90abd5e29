#include "common/datasets.h"

#include <ftw.h>
#include <png.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <jpeglib.h>

static void need(bool holds, const char *what, const char *where)
{
    if (holds) return;
    fprintf(stderr, "test data: %s: %s\n", what, where);
    abort();
}

/* ---- files ----------------------------------------------------------------------------------- */

const char *fv_test_folder(char path[FV_TEST_PATH_BYTES])
{
    const char *top = getenv("TMPDIR");
    snprintf(path, FV_TEST_PATH_BYTES, "%s/fovea-test-XXXXXX", top != NULL ? top : P_tmpdir);
    need(mkdtemp(path) != NULL, "no folder", path);
    return path;
}

const char *fv_test_folder_in_memory(char path[FV_TEST_IN_MEMORY_BYTES])
{
    snprintf(path, FV_TEST_IN_MEMORY_BYTES, "%s/fovea-test-XXXXXX",
             access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
    need(mkdtemp(path) != NULL, "no folder", path);
    return path;
}

static int remove_one(const char *path, const struct stat *about, int kind, struct FTW *walk)
{
    (void)about;
    (void)kind;
    (void)walk;
    return remove(path);
}

void fv_test_folder_remove(const char *path)
{
    need(nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS) == 0, "not removed", path);
}

char fv_test_place[FV_TEST_PATH_BYTES];

int fv_test_place_set_up(void **state)
{
    (void)state;
    fv_test_folder(fv_test_place);
    return 0;
}

int fv_test_place_tear_down(void **state)
{
    (void)state;
    fv_test_folder_remove(fv_test_place);
    return 0;
}

const char *fv_test_path(const char *folder, const char *name)
{
    static char paths[8][FV_TEST_PATH_BYTES];
    static unsigned next;
    char *path = paths[next++ % 8];
    need(snprintf(path, FV_TEST_PATH_BYTES, "%s/%s", folder, name) < FV_TEST_PATH_BYTES,
         "path too long", name);
    return path;
}

void fv_test_make_folder(const char *path)
{
    char part[FV_TEST_PATH_BYTES];
    for (size_t i = 1; path[i - 1] != '\0'; i++) {
        if (path[i] != '/' && path[i] != '\0') continue;
        snprintf(part, sizeof part, "%.*s", (int)i, path);
        mkdir(part, 0755);
    }
    need(access(path, X_OK) == 0, "no folder", path);
}

void fv_test_write(const char *path, const void *bytes, size_t count)
{
    FILE *file = fopen(path, "wb");
    need(file != NULL, "not opened", path);
    need(fwrite(bytes, 1, count, file) == count && fclose(file) == 0, "not written", path);
}

void fv_test_write_text(const char *path, const char *text)
{
    fv_test_write(path, text, strlen(text));
}

void *fv_test_read(const char *path, size_t *bytes)
{
    FILE *file = fopen(path, "rb");
    need(file != NULL, "not opened", path);
    fseek(file, 0, SEEK_END);
    *bytes = (size_t)ftell(file);
    rewind(file);
    char *memory = malloc(*bytes + 1);
    need(memory != NULL && fread(memory, 1, *bytes, file) == *bytes, "not read", path);
    fclose(file);
    memory[*bytes] = '\0';
    return memory;
}

/* ---- pictures -------------------------------------------------------------------------------- */

void fv_test_picture(uint32_t index, int32_t width, int32_t height, int32_t channels,
                     uint8_t *pixels)
{
    for (int32_t y = 0; y < height; y++)
        for (int32_t x = 0; x < width; x++)
            for (int32_t c = 0; c < channels; c++)
                *pixels++ = (uint8_t)(((x / 8 + y / 8 + (int32_t)index) % 2) * 120 +
                                      (x * (c + 1)) % 64 + y % 32 + (int32_t)index);
}

void fv_test_write_png(const char *path, const struct fv_test_png *form, const uint8_t *samples)
{
    static const int types[] = {0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA,
                                PNG_COLOR_TYPE_RGB, PNG_COLOR_TYPE_RGB_ALPHA};
    FILE *file = fopen(path, "wb");
    need(file != NULL, "not opened", path);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    const size_t row_bytes = (size_t)form->width * (size_t)form->channels * (size_t)form->depth / 8;
    png_bytep *rows = calloc((size_t)form->height, sizeof *rows);
    need(rows != NULL, "out of memory", path);
    for (int32_t y = 0; y < form->height; y++)
        rows[y] = (png_bytep)(uintptr_t)(samples + (size_t)y * row_bytes);
    png_init_io(png, file);
    png_set_IHDR(png, info, (png_uint_32)form->width, (png_uint_32)form->height, form->depth,
                 types[form->channels], form->interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_rows(png, info, rows);
    png_write_png(png, info, PNG_TRANSFORM_IDENTITY, NULL);
    png_destroy_write_struct(&png, &info);
    free(rows);
    need(fclose(file) == 0, "not written", path);
}

void fv_test_write_jpeg(const char *path, int32_t width, int32_t height, int32_t channels,
                        bool progressive, bool rgb, const uint8_t *samples)
{
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    FILE *file = fopen(path, "wb");
    need(file != NULL, "not opened", path);
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    jpeg_stdio_dest(&jpeg, file);
    jpeg.image_width = (JDIMENSION)width;
    jpeg.image_height = (JDIMENSION)height;
    jpeg.input_components = channels;
    jpeg.in_color_space = channels == 3 ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_set_defaults(&jpeg);
    if (rgb) jpeg_set_colorspace(&jpeg, JCS_RGB);
    jpeg_set_quality(&jpeg, 90, TRUE);
    if (progressive) jpeg_simple_progression(&jpeg);
    jpeg_start_compress(&jpeg, TRUE);
    for (int32_t y = 0; y < height; y++) {
        JSAMPROW row =
            (JSAMPROW)(uintptr_t)(samples + (size_t)y * (size_t)width * (size_t)channels);
        jpeg_write_scanlines(&jpeg, &row, 1);
    }
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    need(fclose(file) == 0, "not written", path);
}

/* ---- recordings ------------------------------------------------------------------------------ */

static void write_frame(const char *path, uint32_t index, bool as_jpeg)
{
    static const struct fv_test_png grey = {
        .width = FV_TEST_WIDTH, .height = FV_TEST_HEIGHT, .channels = 1, .depth = 8};
    uint8_t pixels[FV_TEST_WIDTH * FV_TEST_HEIGHT];
    fv_test_picture(index, FV_TEST_WIDTH, FV_TEST_HEIGHT, 1, pixels);
    if (as_jpeg)
        fv_test_write_jpeg(path, FV_TEST_WIDTH, FV_TEST_HEIGHT, 1, false, false, pixels);
    else
        fv_test_write_png(path, &grey, pixels);
}

/* Lines are gathered here; a small data set fits. */
struct text {
    char bytes[8192];
    size_t used;
};

__attribute__((format(printf, 2, 3))) static void say(struct text *text, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    text->used += (size_t)vsnprintf(text->bytes + text->used, sizeof text->bytes - text->used,
                                    format, arguments);
    va_end(arguments);
    need(text->used < sizeof text->bytes, "text too long", format);
}

const char *fv_test_euroc(const char *folder)
{
    struct text list = {.used = 0}, truth = {.used = 0};
    char top[FV_TEST_PATH_BYTES];
    snprintf(top, sizeof top, "%s/euroc", folder);
    fv_test_make_folder(fv_test_path(top, "mav0/cam0/data"));
    fv_test_make_folder(fv_test_path(top, "mav0/state_groundtruth_estimate0"));
    say(&list, "#timestamp [ns],filename\r\n");
    say(&truth, "#timestamp, p_RS_R_x [m], ...\n");
    for (uint32_t i = 0; i < FV_TEST_FRAMES; i++) {
        const long long stamp_ns = 1403638538577829376LL + (long long)i * 50000000;
        char name[64];
        snprintf(name, sizeof name, "mav0/cam0/data/%lld.png", stamp_ns);
        write_frame(fv_test_path(top, name), i, false);
        say(&list, "%lld,%lld.png\r\n", stamp_ns, stamp_ns);
    }
    for (uint32_t i = 0; i < 4 * FV_TEST_FRAMES;
         ++i) /* off the frames' stamps, so that it has to be interpolated */
        say(&truth, "%lld,%.6f,0,0,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
            1403638538577829376LL - 5000000 + (long long)i * 12500000, -0.01 + 0.025 * i);
    fv_test_write(fv_test_path(top, "mav0/cam0/data.csv"), list.bytes, list.used);
    fv_test_write(fv_test_path(top, "mav0/state_groundtruth_estimate0/data.csv"), truth.bytes,
                  truth.used);
    fv_test_write_text(
        fv_test_path(top, "mav0/cam0/sensor.yaml"),
        "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
        "  data: [0, 0, 1, 0.5,  -1, 0, 0, 0,  0, -1, 0, 0,  0, 0, 0, 1]\n"
        "rate_hz: 20\nresolution: [96, 64]\ncamera_model: pinhole\nintrinsics: [80, 81, 47.5, 31.5]\n"
        "distortion_model: radial-tangential\ndistortion_coefficients: [-0.2, 0.05, 0.001, -0.001]\n");
    return fv_test_path(folder, "euroc");
}

const char *fv_test_tum(const char *folder)
{
    struct text list = {.used = 0}, truth = {.used = 0};
    char top[FV_TEST_PATH_BYTES];
    snprintf(top, sizeof top, "%s/tum", folder);
    fv_test_make_folder(fv_test_path(top, "rgb"));
    say(&list, "# color images\n# timestamp filename\n");
    for (uint32_t i = 0; i < FV_TEST_FRAMES; i++) {
        char name[64];
        snprintf(name, sizeof name, "rgb/%04u.jpg", i);
        write_frame(fv_test_path(top, name), i, true);
        say(&list, "%.6f %s\n", 1305031102.175304 + 0.05 * i, name);
        say(&truth, "%.6f %.4f 0 0 0 0 0 1\n", 1305031102.175304 + 0.05 * i, 0.1 * i);
    }
    fv_test_write(fv_test_path(top, "rgb.txt"), list.bytes, list.used);
    fv_test_write(fv_test_path(top, "groundtruth.txt"), truth.bytes, truth.used);
    fv_test_write_text(
        fv_test_path(top, "camera.yaml"),
        "image_width: 96\nimage_height: 64\ncamera_name: small\n"
        "camera_matrix: {rows: 3, cols: 3, data: [80, 0, 47.5, 0, 80, 31.5, 0, 0, 1]}\n"
        "distortion_model: plumb_bob\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n");
    return fv_test_path(folder, "tum");
}

const char *fv_test_kitti(const char *folder)
{
    struct text times = {.used = 0}, truth = {.used = 0};
    char top[FV_TEST_PATH_BYTES];
    snprintf(top, sizeof top, "%s/kitti", folder);
    fv_test_make_folder(fv_test_path(top, "image_0"));
    for (uint32_t i = 0; i < FV_TEST_FRAMES; i++) {
        char name[64];
        snprintf(name, sizeof name, "image_0/%06u.png", i);
        write_frame(fv_test_path(top, name), i, false);
        say(&times, "%e\n", 0.05 * i);
        say(&truth, "1 0 0 %g 0 1 0 0 0 0 1 0\n", 0.1 * i);
    }
    fv_test_write(fv_test_path(top, "times.txt"), times.bytes, times.used);
    fv_test_write(fv_test_path(top, "poses.txt"), truth.bytes, truth.used);
    fv_test_write_text(fv_test_path(top, "calib.txt"), "P0: 80 0 47.5 0 0 80 31.5 0 0 0 1 0\n");
    return fv_test_path(folder, "kitti");
}

const char *fv_test_images(const char *folder)
{
    char top[FV_TEST_PATH_BYTES];
    snprintf(top, sizeof top, "%s/images", folder);
    fv_test_make_folder(top);
    for (uint32_t i = 0; i < FV_TEST_FRAMES; i++) {
        char name[64];
        snprintf(name, sizeof name, "img%u.%s", i, i % 2 == 0 ? "png" : "jpg");
        write_frame(fv_test_path(top, name), i, i % 2 == 1);
    }
    return fv_test_path(folder, "images");
}

/* ---- containers ------------------------------------------------------------------------------ */

static void put_bytes(FILE *file, const void *bytes, size_t count)
{
    need(fwrite(bytes, 1, count, file) == count, "not written", "container");
}

static void put_number(FILE *file, uint64_t number, int bytes, bool big_endian)
{
    for (int i = 0; i < bytes; i++)
        fputc((int)(number >> 8 * (big_endian ? bytes - 1 - i : i) & 255), file);
}

int64_t __fovea_frame_t_get_hash(void); /* of the generated type */

const char *fv_test_lcmlog(const char *folder)
{
    const char *path = fv_test_path(folder, "frames.lcmlog");
    FILE *file = fopen(path, "wb");
    need(file != NULL, "not opened", path);
    uint8_t pixels[FV_TEST_WIDTH * FV_TEST_HEIGHT];
    for (uint32_t i = 0; i < FV_TEST_FRAMES; i++) {
        static const char channel[] = "FOVEA_FRAME";
        fv_test_picture(i, FV_TEST_WIDTH, FV_TEST_HEIGHT, 1, pixels);
        put_number(file, 0xEDA1DA01, 4, true);
        put_number(file, i, 8, true);
        put_number(file, 1700000000000000 + i * 50000, 8, true);
        put_number(file, sizeof channel - 1, 4, true);
        put_number(file, 8 + 26 + 4 + 12 + 1 + 8 + 8 + 4 + sizeof pixels, 4, true);
        put_bytes(file, channel, sizeof channel - 1);
        put_number(file, (uint64_t)__fovea_frame_t_get_hash(), 8, true);
        put_number(file, 1000 + (uint64_t)i * 50000000, 8,
                   true); /* stamp: time, clock, meaning, offset, sequence */
        put_number(file, FOVEA_CLOCK_MONOTONIC, 1, true);
        put_number(file, FOVEA_STAMP_EXPOSURE_MIDDLE, 1, true);
        put_number(file, 0, 8, true);
        put_number(file, i, 8, true);
        put_number(file, 1, 4, true); /* images */
        put_number(file, FV_TEST_WIDTH, 4, true);
        put_number(file, FV_TEST_HEIGHT, 4, true);
        put_number(file, FV_TEST_WIDTH, 4, true);
        put_number(file, FOVEA_PIXEL_GREY8, 1, true);
        put_number(file, 0, 8, true);       /* offset */
        put_number(file, 5000000, 8, true); /* exposure */
        put_number(file, sizeof pixels, 4, true);
        put_bytes(file, pixels, sizeof pixels);
    }
    need(fclose(file) == 0, "not written", path);
    return path;
}

static void put_chunk(FILE *file, const char *name, uint32_t bytes)
{
    put_bytes(file, name, 4);
    put_number(file, bytes, 4, false);
}

static void put_list(FILE *file, const char *name, uint32_t bytes)
{
    put_chunk(file, "LIST", bytes + 4);
    put_bytes(file, name, 4);
}

static void put_words(FILE *file, const uint32_t *words, size_t count)
{
    for (size_t i = 0; i < count; i++)
        put_number(file, words[i], 4, false);
}

const char *fv_test_long_video(const char *folder, uint32_t frames)
{
    enum { AVIH = 56, STRH = 56, STRF = 40 };
    const char *path = fv_test_path(folder, "video.avi"),
               *still = fv_test_path(folder, "still.jpg");
    FILE *file = fopen(path, "wb");
    need(file != NULL, "not opened", path);
    void **pictures = calloc(frames, sizeof *pictures);
    size_t *bytes = calloc(frames, sizeof *bytes), movie = 0;
    need(pictures != NULL && bytes != NULL, "out of memory", path);
    for (uint32_t i = 0; i < frames; i++) {
        write_frame(still, i, true);
        pictures[i] = fv_test_read(still, &bytes[i]);
        movie += 8 + (bytes[i] + 1) / 2 * 2;
    }
    const uint32_t stream = 4 + 8 + STRH + 8 + STRF, head = 4 + 8 + AVIH + 8 + stream;
    const uint32_t avih[14] = {50000,          0, 0, 0, frames, 0, 1, 0, FV_TEST_WIDTH,
                               FV_TEST_HEIGHT, 0, 0, 0, 0};
    const uint32_t strh[12] = {0,      0, 0,          1, 20, 0,
                               frames, 0, 0xFFFFFFFF, 0, 0,  FV_TEST_WIDTH | FV_TEST_HEIGHT << 16};
    const uint32_t strf[10] = {STRF,
                               FV_TEST_WIDTH,
                               FV_TEST_HEIGHT,
                               1 | 24 << 16,
                               0x47504A4D,
                               FV_TEST_WIDTH * FV_TEST_HEIGHT * 3,
                               0,
                               0,
                               0,
                               0};
    put_chunk(file, "RIFF", (uint32_t)(4 + 8 + head + 8 + 4 + movie));
    put_bytes(file, "AVI ", 4);
    put_list(file, "hdrl", head - 4);
    put_chunk(file, "avih", AVIH);
    put_words(file, avih, 14);
    put_list(file, "strl", stream - 4);
    put_chunk(file, "strh", STRH);
    put_bytes(file, "vidsMJPG", 8);
    put_words(file, strh, 12);
    put_chunk(file, "strf", STRF);
    put_words(file, strf, 10);
    put_list(file, "movi", (uint32_t)movie);
    for (uint32_t i = 0; i < frames; i++) {
        put_chunk(file, "00dc", (uint32_t)bytes[i]);
        put_bytes(file, pictures[i], bytes[i]);
        if (bytes[i] % 2 != 0) put_number(file, 0, 1, false);
        free(pictures[i]);
    }
    need(fclose(file) == 0, "not written", path);
    remove(still);
    free(pictures);
    free(bytes);
    return path;
}

const char *fv_test_video(const char *folder)
{
    return fv_test_long_video(folder, FV_TEST_FRAMES);
}
