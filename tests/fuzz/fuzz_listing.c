/* Lists of data sets: the first byte chooses the kind, the rest is its index (and, of kitti, its
 * calibration), in a folder without pictures. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/table.h"
#include "fovea/source.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static char folder[] = "/tmp/fovea_fuzz_listing_XXXXXX";

static void put(const char *name, const uint8_t *data, size_t size)
{
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    if (file == NULL || fwrite(data, 1, size, file) != size || fclose(file) != 0) abort();
}

static void clean_up(void)
{
    static const char *const names[] = {
        "mav0/cam0/data.csv", "rgb.txt",   "times.txt", "calib.txt", "camera.yaml",
        "mav0/cam0/data",     "mav0/cam0", "mav0",      "image_0",   ""};
    char path[128];
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        remove(path);
    }
}

static void set_up(void)
{
    static const char *const folders[] = {"mav0", "mav0/cam0", "mav0/cam0/data", "image_0"};
    static const char camera[] = "image_width: 64\nimage_height: 48\ndistortion_model: plumb_bob\n"
                                 "D: []\nK: [80, 0, 32, 0, 81, 24, 0, 0, 1]\n";
    static bool is_made; /* a name that is made may end in X too */
    char path[128];
    if (is_made) return;
    is_made = true;
    if (mkdtemp(folder) == NULL) abort();
    for (int i = 0; i < 4; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, folders[i]);
        if (mkdir(path, 0700) != 0) abort();
    }
    put("camera.yaml", (const uint8_t *)camera, sizeof camera - 1);
    atexit(clean_up);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const sources[] = {"euroc:%s", "tum:%s", "kitti:%s", "kitti:%s"};
    static const char *const lists[] = {"mav0/cam0/data.csv", "rgb.txt", "times.txt", "calib.txt"};
    const struct fovea_source_selection all = {.step = 1};
    const struct fovea_source_ops *ops;
    struct fovea_source *source = NULL;
    struct fovea_error error;
    char uri[128];
    const char *address;
    if (size < 1) return 0;
    set_up();
    const int kind = data[0] % 4;
    put("times.txt", (const uint8_t *)"0.0\n0.1\n", 8);
    put(lists[kind], data + 1, size - 1);
    snprintf(uri, sizeof uri, sources[kind], folder);
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK) abort();
    if (ops->open(address, &all, &source, &error) == FOVEA_OK) ops->close(source);
    return 0;
}
