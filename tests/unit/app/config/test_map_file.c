/* Map files outlive a death at any instant: a child that saves one map after another is killed at a
 * random moment, and what is there then is one of the maps, whole. FOVEA_KILLS: how often (100; the
 * campaign says 1,000). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "app/config/map_file.h"
#include "common/datasets.h"
#include "common/patience.h"
#include "common/small_map.h"

static char *const folder = fv_test_place;
static char path[FV_TEST_PATH_BYTES + 16];

struct file {
    uint8_t *data;
    size_t bytes;
};

static struct file make_file_with(uint32_t keyframes, bool with_grid)
{
    enum { SIDE = 4 };
    int8_t cells[SIDE * SIDE];
    struct small_map small;
    struct fv_random random;
    struct file file;
    fv_random_seed(&random, keyframes);
    small_map_make(&small);
    for (uint32_t k = 0; k < keyframes; k++)
        small_map_grow(&small, &random);
    const struct fv_archive_grid grid = small_map_grid(&small, SIDE, &random, cells);
    file.data = with_grid ? small_map_save_with(&small, &grid, cells, SIDE, &file.bytes)
                          : small_map_save(&small, &file.bytes);
    small_map_free(&small);
    return file;
}

static struct file make_file(uint32_t keyframes)
{
    return make_file_with(keyframes, false);
}

/* Whatever was there, and without keeping it. */
static enum fovea_status write_map(const char *to, const uint8_t *data, size_t bytes,
                                   struct fovea_error *error)
{
    const struct fv_map_file_rules alone = {.keep = 1, .overwrite = true};
    struct fv_map_file_saved saved;
    return fv_map_file_save(to, &alone, data, bytes, &saved, error);
}

static void save_for_ever(const struct file files[2], int first, atomic_int *saves)
{
    for (int n = first;; n = !n, atomic_fetch_add(saves, 1))
        if (write_map(path, files[n].data, files[n].bytes, NULL) != FOVEA_OK) _exit(1);
}

/* A process that saves one map and the other by turns, until it is killed: after so many saves, of
 * which it does none while it has no processor, and a while. */
static void kill_a_saver(const struct file files[2], int first, int after, int64_t while_ns)
{
    atomic_int *saves =
        mmap(NULL, sizeof *saves, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_ptr_not_equal(saves, MAP_FAILED);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) save_for_ever(files, first, saves);
    int status;
    int64_t end_ns = 0;
    while (atomic_load(saves) < after && fv_test_patient(&end_ns, 1)) {
    }
    nanosleep(&(struct timespec){.tv_nsec = while_ns}, NULL);
    kill(child, SIGKILL);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status)); /* it did not give up by itself */
    munmap(saves, sizeof *saves);
}

static void test_kills(void **state)
{
    (void)state;
    const char *asked = getenv("FOVEA_KILLS");
    const int kills = asked != NULL ? atoi(asked) : 100;
    const struct file files[2] = {make_file(4), make_file(9)};
    struct fv_random random;
    int found[2] = {0, 0}, parts = 0;
    fv_random_seed(&random, (uint64_t)time(NULL));
    assert_int_equal(write_map(path, files[0].data, files[0].bytes, NULL), FOVEA_OK);
    for (int n = 0; n < kills; n++) {
        const int after = (int)fv_random_below(&random, 3);
        kill_a_saver(files, n % 2, after, 200000 + fv_random_below(&random, 8000000));
        struct file read;
        struct fovea_error error;
        struct fv_archive_info info;
        char part[sizeof path + 8];
        snprintf(part, sizeof part, "%s.part", path);
        parts += access(part, F_OK) == 0;
        if (fv_map_file_read(path, &read.data, &read.bytes, &error) != FOVEA_OK)
            fail_msg("kill %d: %s", n, error.text);
        if (fv_archive_info(read.data, read.bytes, path, &info, &error) != FOVEA_OK)
            fail_msg("kill %d: %s", n, error.text);
        const int which = read.bytes == files[1].bytes;
        assert_int_equal(read.bytes, files[which].bytes);
        assert_memory_equal(read.data, files[which].data, read.bytes);
        found[which]++;
        free(read.data);
    }
    print_message(
        "%d kills: found one map %d times and the other %d times, cut short while writing %d times\n",
        kills, found[0], found[1], parts);
    if (kills >= 100) assert_true(found[0] > 0 && found[1] > 0 && parts > 0);
    free(files[0].data);
    free(files[1].data);
}

static void test_errors(void **state)
{
    (void)state;
    struct fovea_error error;
    struct file file = make_file(2), read;
    assert_int_equal(write_map("/nonexistent/a.map", file.data, file.bytes, &error),
                     FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "/nonexistent/a.map"));
    assert_int_equal(fv_map_file_read("/nonexistent/a.map", &read.data, &read.bytes, &error),
                     FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_read(folder, &read.data, &read.bytes, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_probe("/nonexistent/a.map", &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_probe(folder, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_probe("/dev/null", &error), FOVEA_ERROR_INPUT);
    /* A full disk leaves the old map, and no other file. */
    assert_int_equal(write_map(path, file.data, file.bytes, &error), FOVEA_OK);
    char part[sizeof path + 8];
    snprintf(part, sizeof part, "%s.part", path);
    (void)unlink(part);
    assert_int_equal(fv_map_file_probe(path, &error), FOVEA_OK);
    assert_int_equal(access(part, F_OK), -1);
    struct rlimit before;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    const struct rlimit little = {100, before.rlim_max};
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &little), 0);
    assert_int_equal(write_map(path, file.data, file.bytes, &error), FOVEA_ERROR_SYSTEM);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_non_null(strstr(error.text, "File too large"));
    assert_int_equal(access(part, F_OK), -1);
    /* A link planted at the temporary name is not followed. */
    char victim[sizeof path + 8];
    snprintf(victim, sizeof victim, "%s.victim", path);
    assert_int_equal(write_map(victim, file.data, 100, &error), FOVEA_OK);
    assert_int_equal(symlink(victim, part), 0);
    assert_int_equal(write_map(path, file.data, file.bytes, &error), FOVEA_OK);
    assert_int_equal(fv_map_file_read(victim, &read.data, &read.bytes, &error), FOVEA_OK);
    assert_int_equal(read.bytes, 100);
    free(read.data);
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(fv_map_file_read(path, &read.data, &read.bytes, &error), FOVEA_OK);
    assert_int_equal(read.bytes, file.bytes);
    free(read.data);
    free(file.data);
}

/* ---- keeping older ones ---------------------------------------------------------------------- */

static void save(const struct file *file, uint32_t keep, bool overwrite, bool beside)
{
    const struct fv_map_file_rules rules = {keep, overwrite};
    struct fv_map_file_saved saved;
    struct fovea_error error;
    if (fv_map_file_save(path, &rules, file->data, file->bytes, &saved, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_int_equal(saved.beside, beside);
}

/* NULL: no such file. */
static void assert_is(const char *end, const struct file *file)
{
    char name[sizeof path + 16];
    snprintf(name, sizeof name, "%s%s", path, end);
    if (file == NULL) {
        assert_int_equal(access(name, F_OK), -1);
        return;
    }
    struct file read;
    struct fovea_error error;
    if (fv_map_file_read(name, &read.data, &read.bytes, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_int_equal(read.bytes, file->bytes);
    assert_memory_equal(read.data, file->data, read.bytes);
    free(read.data);
}

static void begin_anew(void)
{
    fv_test_folder_remove(folder);
    fv_test_make_folder(folder);
}

static void the_last_maps_are_kept(void **state)
{
    (void)state;
    struct file f[5];
    begin_anew();
    for (uint32_t i = 0; i < 5; i++) {
        f[i] = make_file(5 + i); /* each has over half of the landmarks of the one before */
        save(&f[i], 3, false, false);
    }
    assert_is("", &f[4]);
    assert_is(".1", &f[3]);
    assert_is(".2", &f[2]);
    assert_is(".3", NULL);
    assert_is(".1.part", NULL);
    /* A gap is filled: nothing is pushed out. */
    char gap[sizeof path + 8];
    snprintf(gap, sizeof gap, "%s.1", path);
    unlink(gap);
    save(&f[3], 3, false, false);
    assert_is("", &f[3]);
    assert_is(".1", &f[4]);
    assert_is(".2", &f[2]);
    save(&f[4], 1, false, false); /* 1: none is kept, and none is touched */
    assert_is("", &f[4]);
    assert_is(".1", &f[4]);
    for (uint32_t i = 0; i < 5; i++)
        free(f[i].data);
}

static void a_map_with_under_half_of_the_landmarks_is_saved_beside(void **state)
{
    (void)state;
    struct file large = make_file(9), small = make_file(2), empty = make_file(0);
    begin_anew();
    save(&empty, 3, false, false); /* there is none yet */
    save(&large, 3, false, false);
    save(&empty, 3, false, true); /* as by one packet RESET | SAVE */
    save(&small, 3, false, true);
    assert_is("", &large);
    assert_is(".1", &empty);
    assert_is(".small", &small);
    assert_is(".small.1", &empty);
    save(&small, 3, true, false);
    assert_is("", &small);
    assert_is(".1", &large);
    free(large.data);
    free(small.data);
    free(empty.data);
}

static void a_map_without_the_grid_of_the_other_is_saved_beside(void **state)
{
    (void)state;
    struct file mapped = make_file_with(5, true), again = make_file_with(4, true),
                blind = make_file(9);
    begin_anew();
    save(&mapped, 3, false, false);
    save(&blind, 3, false, true);
    assert_is("", &mapped);
    assert_is(".small", &blind);
    save(&again, 3, false, false);
    assert_is("", &again);
    assert_is(".1", &mapped);
    save(&blind, 3, true, false);
    assert_is("", &blind);
    save(&again, 3, false, true); /* under half of the landmarks, though with a grid */
    free(mapped.data);
    free(again.data);
    free(blind.data);
}

static void spoil(const struct file *file, size_t bytes, size_t flipped)
{
    struct fovea_error error;
    file->data[flipped] ^= 1;
    assert_int_equal(write_map(path, file->data, bytes, &error), FOVEA_OK);
    file->data[flipped] ^= 1;
}

/* What cannot be loaded does not hold the place of what can. */
static void a_damaged_map_counts_as_none(void **state)
{
    (void)state;
    struct file large = make_file(9), small = make_file(2);
    begin_anew();
    spoil(&large, large.bytes, large.bytes / 2);
    save(&small, 3, false, false);
    assert_is("", &small);
    spoil(&large, large.bytes, large.bytes - 1);
    save(&small, 3, false, false);
    for (size_t bytes = 100; bytes < large.bytes; bytes += large.bytes / 3) {
        spoil(&large, bytes, bytes); /* cut; what is flipped is not written */
        save(&small, 3, false, false);
        assert_is("", &small);
    }
    save(&large, 3, false, false);
    save(&small, 3, false, true);
    free(large.data);
    free(small.data);
}

/* Also of the older ones of small maps, and of what is written beside them. */
static void a_name_that_grows_too_long_is_refused_at_once(void **state)
{
    (void)state;
    const size_t longest = 255 - strlen(FV_MAP_FILE_SMALL ".9.part");
    struct fovea_error error;
    begin_anew();
    for (size_t length = longest; length <= 246; length++) {
        char long_path[sizeof path + 256];
        const size_t used = (size_t)snprintf(long_path, sizeof long_path, "%s/", folder);
        memset(long_path + used, 'm', length);
        long_path[used + length] = '\0';
        assert_int_equal(fv_map_file_probe(long_path, &error),
                         length == longest ? FOVEA_OK : FOVEA_ERROR_INPUT);
        if (length > longest) assert_non_null(strstr(error.text, "File name too long"));
        assert_int_equal(rmdir(folder), 0); /* nothing is left in it */
        fv_test_make_folder(folder);
    }
}

/* ---- deaths while older ones are kept -------------------------------------------------------- */

enum { FRAME_NUMBER_AT = 176, KEPT = 3 };

/* Give the map a number that reading gives back. */
static void number_it(struct file *file, uint64_t number)
{
    memcpy(file->data + FRAME_NUMBER_AT, &number, sizeof number);
    fv_archive_seal(file->data, file->bytes);
}

/* Numbers of PATH, PATH.1, PATH.2; 0: not there. */
static void read_kept(uint64_t numbers[KEPT], const char *when)
{
    for (int i = 0; i < KEPT; i++) {
        char name[sizeof path + 16];
        struct file read;
        struct fovea_error error;
        struct fv_archive_info info;
        snprintf(name, sizeof name, i == 0 ? "%s" : "%s.%d", path, i);
        numbers[i] = 0;
        if (access(name, F_OK) != 0) continue;
        if (fv_map_file_read(name, &read.data, &read.bytes, &error) != FOVEA_OK ||
            fv_archive_info(read.data, read.bytes, name, &info, &error) != FOVEA_OK)
            fail_msg("%s: %s", when, error.text);
        numbers[i] = info.frame_number;
        free(read.data);
    }
}

/* It is there, or two later ones are. */
static bool kept(const uint64_t numbers[KEPT], uint64_t number)
{
    uint64_t later = 0;
    int count = 0;
    for (int i = 0; i < KEPT; i++) {
        if (numbers[i] == number) return true;
        if (numbers[i] > number && numbers[i] != later) count++;
        if (numbers[i] > number) later = numbers[i];
    }
    return count >= KEPT - 1;
}

/* Whatever instant the saving process dies at, every file is whole, there is one at PATH from the
 * first save on, and each of the last three that were saved is there until later ones push it out.
 */
static void kills_lose_no_kept_map(void **state)
{
    (void)state;
    struct shared {
        uint64_t begun, saved[2]; /* numbers: the last save that began, the last two that ended */
    };
    const char *asked = getenv("FOVEA_KILLS");
    const int kills = asked != NULL ? atoi(asked) : 60;
    struct file file = make_file(6);
    struct fv_random random;
    const uint64_t seed = (uint64_t)time(NULL);
    begin_anew();
    fv_random_seed(&random, seed);
    struct shared *shared =
        mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    for (int n = 0; n < kills; n++) {
        char when[80];
        uint64_t numbers[KEPT];
        const pid_t child = fork();
        if (child == 0)
            for (;;) {
                number_it(&file, ++shared->begun);
                save(&file, KEPT, false, false);
                shared->saved[1] = shared->saved[0];
                shared->saved[0] = shared->begun;
            }
        nanosleep(&(struct timespec){.tv_nsec = 200000 + fv_random_below(&random, 20000000)}, NULL);
        int status;
        kill(child, SIGKILL);
        waitpid(child, &status, 0);
        assert_true(WIFSIGNALED(status));
        snprintf(when, sizeof when, "seed %llu, kill %d", (unsigned long long)seed, n);
        read_kept(numbers, when);
        if (shared->saved[0] == 0) continue;
        if (numbers[0] < shared->saved[0] || !kept(numbers, shared->saved[0]) ||
            (shared->saved[1] > 0 && !kept(numbers, shared->saved[1])))
            fail_msg("%s: after %d and %d were saved: found %d, %d, %d", when,
                     (int)shared->saved[1], (int)shared->saved[0], (int)numbers[0], (int)numbers[1],
                     (int)numbers[2]);
    }
    print_message("seed %llu: %d kills in %d saves\n", (unsigned long long)seed, kills,
                  (int)shared->begun);
    munmap(shared, sizeof *shared);
    free(file.data);
}

static int set_up(void **state)
{
    if (fv_test_place_set_up(state) != 0) return -1;
    snprintf(path, sizeof path, "%s/a.map", folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kills),
        cmocka_unit_test(test_errors),
        cmocka_unit_test(the_last_maps_are_kept),
        cmocka_unit_test(a_map_with_under_half_of_the_landmarks_is_saved_beside),
        cmocka_unit_test(a_map_without_the_grid_of_the_other_is_saved_beside),
        cmocka_unit_test(a_damaged_map_counts_as_none),
        cmocka_unit_test(a_name_that_grows_too_long_is_refused_at_once),
        cmocka_unit_test(kills_lose_no_kept_map),
    };
    return cmocka_run_group_tests(tests, set_up, fv_test_place_tear_down);
}
