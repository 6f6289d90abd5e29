/* Nothing that a run reads is written over: every output is aimed at every file of every kind of
 * source, directly, by links and by folders. Each such run is refused in one line, and no byte of
 * any file has changed. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <ftw.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/command.h"
#include "base/hash.h"
#include "common/datasets.h"

enum { TEXT_MAX = 4096, FILES_MAX = 160, SECONDS_MAX = 300 };

static char *const folder = fv_test_place;
static char line[TEXT_MAX];
static const char *settings[5]; /* more of them for the next run, up to NULL */
static bool loud;               /* the next run: not --quiet, so it draws a picture unasked */

/* Run `fovea run` in a process of its own; what it says on stderr is in `line`. */
static int run(const char *source, const char *option, const char *path)
{
    int ends[2], status = -1;
    assert_int_equal(pipe(ends), 0);
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        const char *words[24] = {"fovea", "run",      "--source", source, "--camera", "camera",
                                 "--set", "lcm_url=", "--frames", "2",    option,     path};
        int count = 12;
        if (!loud) words[count++] = "--quiet";
        for (int i = 0; settings[i] != NULL; i++) {
            words[count++] = "--set";
            words[count++] = settings[i];
        }
        alarm(SECONDS_MAX);
        dup2(ends[1], STDERR_FILENO);
        close(ends[0]);
        if (chdir(folder) != 0 || freopen("/dev/null", "w", stdout) == NULL) _exit(99);
        exit(fv_dispatch(count, (char **)(uintptr_t)words));
    }
    close(ends[1]);
    size_t used = 0;
    for (ssize_t got; (got = read(ends[0], line + used, sizeof line - 1 - used)) > 0;)
        used += (size_t)got;
    line[used] = '\0';
    close(ends[0]);
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 100 + WTERMSIG(status);
}

/* ---- what is there --------------------------------------------------------------------------- */

static struct {
    char path[FILES_MAX][FV_TEST_PATH_BYTES];
    int count;
    uint64_t hash;
} found;

static int look(const char *path, const struct stat *about, int kind, struct FTW *at)
{
    (void)about;
    (void)at;
    if (kind != FTW_F || strstr(path, "/links/") != NULL) return 0;
    assert_true(found.count < FILES_MAX);
    size_t bytes;
    void *data = fv_test_read(path, &bytes);
    found.hash = fv_hash(found.hash, path, strlen(path));
    found.hash = fv_hash(found.hash, data, bytes);
    free(data);
    snprintf(found.path[found.count++], FV_TEST_PATH_BYTES, "%s", path);
    return 0;
}

/* Names and bytes of all files; order is that of the folder, which nothing changes. */
static uint64_t take_stock(const char *where)
{
    found.count = 0;
    found.hash = FV_HASH_START;
    assert_int_equal(nftw(where, look, 8, FTW_PHYS), 0);
    return found.hash;
}

static void assert_refused(const char *source, const char *option, const char *path)
{
    const uint64_t before = take_stock(folder);
    const int end = run(source, option, path);
    const char *stop = strchr(line, '\n');
    if (end != FV_EXIT_WRONG || stop == NULL || stop[1] != '\0' || strstr(line, option) == NULL ||
        strstr(line, "--source") == NULL)
        fail_msg("%s %s %s: status %d [%s]", source, option, path, end, line);
    if (take_stock(folder) != before)
        fail_msg("%s %s %s: a file has changed", source, option, path);
}

/* ---- tests ----------------------------------------------------------------------------------- */

static const struct row {
    const char *name;
    const char *(*make)(const char *folder);
} rows[] = {
    {"euroc", fv_test_euroc},   {"tum", fv_test_tum},       {"kitti", fv_test_kitti},
    {"images", fv_test_images}, {"lcmlog", fv_test_lcmlog}, {"video", fv_test_video},
};

/* Half of the files each time, and each option with some: what differs is only the row's name. */
static void no_file_of_a_source_is_written_over(void **state)
{
    static const char *const options[] = {"--record",    "--stats",    "--picture",
                                          "--truth",     "--save-map", "--trajectory-final",
                                          "--trajectory"};
    const int option_count = sizeof options / sizeof options[0];
    int option = 0;
    (void)state;
    for (size_t r = 0; r < sizeof rows / sizeof rows[0]; r++) {
        char source[FV_TEST_PATH_BYTES + 32], files[FILES_MAX][FV_TEST_PATH_BYTES], root[64];
        snprintf(root, sizeof root, "%.40s/%s", folder, rows[r].name);
        fv_test_make_folder(root);
        const char *address = rows[r].make(root);
        snprintf(source, sizeof source, "%s:%s", rows[r].name, address);
        if (run(source, "--picture", "none") == FV_EXIT_WRONG &&
            strcmp(rows[r].name, "video") == 0) {
            print_message("SKIPPED video: %s", line);
            continue;
        }
        (void)take_stock(root);
        const int count = found.count;
        memcpy(files, found.path, sizeof files);
        assert_true(count > 0);
        for (int i = 0; i < count; i += i < 3 ? 1 : 4)
            assert_refused(source, options[option++ % option_count], files[i]);
        /* By a hard link and a soft one from elsewhere, and by the temporary name. */
        char links[FV_TEST_PATH_BYTES + 16];
        snprintf(links, sizeof links, "%s/links", folder);
        (void)mkdir(links, 0777);
        (void)unlink(fv_test_path(links, "hard"));
        (void)unlink(fv_test_path(links, "soft"));
        assert_int_equal(link(files[count - 1], fv_test_path(links, "hard")), 0);
        assert_int_equal(symlink(files[0], fv_test_path(links, "soft")), 0);
        assert_refused(source, "--stats", fv_test_path(links, "hard"));
        assert_refused(source, "--record", fv_test_path(links, "soft"));
        /* As a part of a sequence. */
        snprintf(source, sizeof source, "sequence:%s:%.200s then %s:%.200s", rows[r].name, address,
                 rows[r].name, address);
        assert_refused(source, "--record", files[count / 2]);
    }
}

static void a_folder_of_images_takes_no_output(void **state)
{
    char root[64], source[FV_TEST_PATH_BYTES], picture[FV_TEST_PATH_BYTES];
    (void)state;
    snprintf(root, sizeof root, "%.40s/folder", folder);
    fv_test_make_folder(root);
    const char *images = fv_test_images(root);
    struct stat about;
    if (stat(images, &about) != 0 || !S_ISDIR(about.st_mode)) { /* a pattern: take its folder */
        snprintf(picture, sizeof picture, "%.*s", (int)(strrchr(images, '/') - images), images);
        images = picture;
    }
    snprintf(source, sizeof source, "images:%.400s", images);
    char new[FV_TEST_PATH_BYTES + 16];
    snprintf(new, sizeof new, "%s/new.png", images);
    assert_refused(source, "--picture", new);
    assert_refused(source, "--stats", new);
}

/* The folder itself: a recording would be added to it, also where none is ever removed. */
static void a_folder_of_images_takes_no_recordings(void **state)
{
    char root[64], source[FV_TEST_PATH_BYTES + 32], box[FV_TEST_PATH_BYTES];
    (void)state;
    snprintf(root, sizeof root, "%.40s/box", folder);
    fv_test_make_folder(root);
    const char *address = fv_test_euroc(root);
    snprintf(source, sizeof source, "euroc:%s", address);
    snprintf(box, sizeof box, "%s/mav0/cam0/data/", address);
    assert_refused(source, "--record", box);
    snprintf(box, sizeof box, "%s/mav0/", address); /* nothing is taken whole there */
    if (run(source, "--record", box) != FV_EXIT_OK) fail_msg("%s", line);
}

static void an_output_beside_a_data_set_is_written(void **state)
{
    char root[64], source[FV_TEST_PATH_BYTES + 32], stats[96];
    (void)state;
    snprintf(root, sizeof root, "%.40s/beside", folder);
    fv_test_make_folder(root);
    const char *address = fv_test_euroc(root);
    snprintf(source, sizeof source, "euroc:%s", address);
    snprintf(stats, sizeof stats, "%s/stats.json", root);
    if (run(source, "--stats", stats) != FV_EXIT_OK) fail_msg("%s", line);
    assert_int_equal(access(stats, F_OK), 0);
}

/* Heights are written beside the grid, to a name that nobody gave. */
static void heights_are_not_written_over_what_is_read(void **state)
{
    char source[FV_TEST_PATH_BYTES + 96];
    (void)state;
    fv_test_write_text(fv_test_path(folder, "g-heights.png"), "a mask");
    snprintf(source, sizeof source, "euroc:%s/beside", folder);
    settings[0] = "mask=g-heights.png"; /* no mask: each run ends with an error */
    settings[1] = "T_body_cam=[[0, 0, 1, 0.3], [-1, 0, 0, 0], [0, -1, 0, 0.5]]";
    settings[2] = "grid.enabled=true";
    for (int kept = 0; kept < 2; kept++) {
        settings[3] = kept ? "grid.heights=true" : NULL;
        const uint64_t before = take_stock(folder);
        assert_int_equal(run(source, "--grid", "g.png"), FV_EXIT_WRONG);
        assert_int_equal(strstr(line, "the file of mask") != NULL, kept);
        assert_true(take_stock(folder) == before);
    }
    memset(settings, 0, sizeof settings);
}

/* The file of `option` has the name of the picture that is drawn unasked, and keeps it. */
static void assert_not_drawn_over(const char *option)
{
    const char *name = "fovea-run.png";
    char said[96], first[4] = "";
    if (run("sim:orbit?width=96&height=64", option, name) != FV_EXIT_OK) fail_msg("%s", line);
    snprintf(said, sizeof said, "no picture is drawn: the picture: found %s, the file of %s", name,
             option);
    if (strstr(line, said) == NULL) fail_msg("%s", line);
    FILE *file = fopen(fv_test_path(folder, name), "rb");
    assert_non_null(file);
    assert_int_equal(fread(first, 1, sizeof first, file), sizeof first);
    fclose(file);
    assert_memory_not_equal(first, "\x89PNG", sizeof first);
}

/* It is left out where another output, or what is read, has its name. */
static void the_unasked_picture_takes_no_other_file(void **state)
{
    static const char *const outputs[] = {"--stats", "--truth", "--save-map"};
    const char *name = "fovea-run.png";
    (void)state;
    loud = true;
    for (size_t i = 0; i < sizeof outputs / sizeof outputs[0]; i++) {
        unlink(fv_test_path(folder, name));
        assert_not_drawn_over(outputs[i]);
    }
    assert_not_drawn_over("--map"); /* the one that was saved last */
    fv_test_write_text(fv_test_path(folder, name), "features: {count_max: 500}\n");
    assert_not_drawn_over("--config");
    unlink(fv_test_path(folder, name));
    if (run("sim:orbit?width=96&height=64", "--stats", "other") != FV_EXIT_OK) fail_msg("%s", line);
    assert_null(strstr(line, "picture"));
    assert_int_equal(access(fv_test_path(folder, name), F_OK), 0);
    loud = false;
}

/* Pictures are PNG: said before anything is written, not when an hour has gone. */
static void names_of_other_pictures_are_refused(void **state)
{
    char source[FV_TEST_PATH_BYTES + 32], root[64];
    (void)state;
    snprintf(root, sizeof root, "%.40s/named", folder);
    fv_test_make_folder(root);
    snprintf(source, sizeof source, "euroc:%s", fv_test_euroc(root));
    const uint64_t before = take_stock(folder);
    assert_int_equal(run(source, "--picture", "drawn.JPG"), FV_EXIT_WRONG);
    if (strstr(line, "--picture: found drawn.JPG, expected a name that ends in .png") == NULL)
        fail_msg("%s", line);
    assert_true(take_stock(folder) == before);
}

/* ---- maps ------------------------------------------------------------------------------------ */

/* `--map LOADED --save-map m`; the files are no maps, so that every run ends with an error. */
static void assert_loaded(const char *loaded, bool refused)
{
    char config[FV_TEST_PATH_BYTES + 64], source[FV_TEST_PATH_BYTES + 96];
    const uint64_t before = take_stock(folder);
    snprintf(config, sizeof config, "map.load=%s", loaded);
    snprintf(source, sizeof source, "euroc:%s/beside", folder);
    settings[0] = config;
    const int end = run(source, "--save-map", "m");
    settings[0] = NULL;
    const bool said = strstr(line, "--save-map") != NULL;
    if (refused) assert_non_null(strstr(line, "the file of --map"));
    if (end != FV_EXIT_WRONG || said != refused)
        fail_msg("--map %s --save-map m: status %d [%s]", loaded, end, line);
    assert_true(take_stock(folder) == before);
}

static void a_loaded_map_is_not_renamed_away(void **state)
{
    static const char *const names[] = {"m", "m.1", "m.2", "m.3", "m.small", "m.small.1"};
    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        fv_test_write_text(fv_test_path(folder, names[i]), names[i]);
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        assert_loaded(names[i], strcmp(names[i], "m") != 0 && strcmp(names[i], "m.3") != 0);
    fv_test_write_text(fv_test_path(folder, "m.part"), "m.part");
    assert_loaded("m.part", true); /* which a save would remove */
    assert_int_equal(unlink(fv_test_path(folder, "m.part")), 0);
    /* As a death in a save leaves them: m.1 is a second name of m, and stays at the next save. */
    char first[FV_TEST_PATH_BYTES];
    snprintf(first, sizeof first, "%s", fv_test_path(folder, "m.1"));
    assert_int_equal(unlink(first), 0);
    assert_int_equal(link(fv_test_path(folder, "m"), first), 0);
    assert_loaded("m", false);
    assert_loaded("m.1", false);
    assert_loaded("m.2", true);
}

static int set_up(void **state)
{
    if (fv_test_place_set_up(state) != 0) return -1;
    fv_test_write_text(fv_test_path(folder, "camera"),
                       "image_width: 96\nimage_height: 64\n"
                       "camera_matrix: {rows: 3, cols: 3, data: [80, 0, 48, 0, 80, 32, 0, 0, 1]}\n"
                       "distortion_coefficients: {rows: 1, cols: 4, data: [0, 0, 0, 0]}\n");
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_file_of_a_source_is_written_over),
        cmocka_unit_test(a_folder_of_images_takes_no_output),
        cmocka_unit_test(a_folder_of_images_takes_no_recordings),
        cmocka_unit_test(an_output_beside_a_data_set_is_written),
        cmocka_unit_test(heights_are_not_written_over_what_is_read),
        cmocka_unit_test(the_unasked_picture_takes_no_other_file),
        cmocka_unit_test(names_of_other_pictures_are_refused),
        cmocka_unit_test(a_loaded_map_is_not_renamed_away),
    };
    return cmocka_run_group_tests(tests, set_up, fv_test_place_tear_down);
}
