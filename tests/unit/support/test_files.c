/* Outputs replace and never follow or cut; one program writes a path at a time; what is written is
 * held against what is read by device and inode. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <errno.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/datasets.h"
#include "support/files.h"
#include "support/output.h"

static char folder[FV_TEST_PATH_BYTES];

/* Of the last eight calls. */
static const char *in(const char *name)
{
    static char paths[8][FV_TEST_PATH_BYTES + 64];
    static int next;
    char *path = paths[next++ % 8];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static void put(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void assert_text(const char *path, const char *text)
{
    char found[64] = "";
    FILE *file = fopen(path, "r");
    if (file == NULL) fail_msg("%s is not there", path);
    found[fread(found, 1, sizeof found - 1, file)] = '\0';
    fclose(file);
    assert_string_equal(found, text);
}

static void write_text(const char *path, enum fv_output_kind kind, const char *text)
{
    struct fv_output output;
    struct fovea_error error;
    if (fv_output_open(&output, path, kind, &error) != FOVEA_OK) fail_msg("%s", error.text);
    fputs(text, fv_output_stream(&output));
    assert_int_equal(fv_output_close(&output, &error), FOVEA_OK);
}

static void refused(const char *path, const char *why)
{
    struct fv_output output;
    struct fovea_error error;
    assert_int_equal(fv_output_open(&output, path, FV_OUTPUT_WHOLE, &error), FOVEA_ERROR_INPUT);
    if (strstr(error.text, why) == NULL) fail_msg("'%s' is not in '%s'", why, error.text);
    assert_int_equal(output.file, -1);
}

static void an_output_replaces_and_cuts_nothing(void **state)
{
    (void)state;
    const enum fv_output_kind kinds[] = {FV_OUTPUT_WHOLE, FV_OUTPUT_STREAM};
    for (int i = 0; i < 2; i++) {
        struct stat about;
        put(in("old"), "old");
        assert_int_equal(chmod(in("old"), 0600), 0);
        FILE *reader = fopen(in("old"), "r");
        char text[8] = "";
        write_text(in("old"), kinds[i], "new");
        assert_text(in("old"), "new");
        assert_int_equal(fread(text, 1, 3, reader), 3); /* who had it open reads on */
        assert_string_equal(text, "old");
        fclose(reader);
        assert_int_equal(stat(in("old"), &about), 0);
        assert_int_equal(about.st_mode & 0777, 0600);
        assert_int_equal(access(in("old.part"), F_OK), -1);
    }
}

static void a_whole_output_is_there_at_its_end_or_not_at_all(void **state)
{
    (void)state;
    struct fv_output output;
    put(in("kept"), "kept");
    assert_int_equal(fv_output_open(&output, in("kept"), FV_OUTPUT_WHOLE, NULL), FOVEA_OK);
    fputs("half", fv_output_stream(&output));
    assert_text(in("kept"), "kept");
    fv_output_discard(&output);
    assert_text(in("kept"), "kept");
    assert_int_equal(access(in("kept.part"), F_OK), -1);
}

static void links_are_replaced_and_never_followed(void **state)
{
    (void)state;
    struct stat about;
    put(in("victim"), "victim");
    for (int i = 0; i < 2; i++) {
        const enum fv_output_kind kind = i == 0 ? FV_OUTPUT_WHOLE : FV_OUTPUT_STREAM;
        (void)unlink(in("trap"));
        assert_int_equal(symlink(in("victim"), in("trap")), 0);
        assert_int_equal(symlink(in("victim"), in("trap.part")), 0);
        write_text(in("trap"), kind, "mine");
        assert_text(in("victim"), "victim");
        assert_text(in("trap"), "mine");
        assert_true(lstat(in("trap"), &about) == 0 && S_ISREG(about.st_mode));
        assert_int_equal(lstat(in("trap.part"), &about), -1);
    }
    /* A hard link planted there is removed, not written. */
    assert_int_equal(link(in("victim"), in("trap.part")), 0);
    write_text(in("trap"), FV_OUTPUT_WHOLE, "mine");
    assert_text(in("victim"), "victim");
}

static void devices_and_pipes_are_refused_but_streams_and_sinks_are_not(void **state)
{
    (void)state;
    struct fv_output output;
    struct stat about;
    assert_int_equal(mkfifo(in("fifo"), 0600), 0);
    refused(in("fifo"), "found a device or pipe");
    refused("/dev/zero", "found a device or pipe");
    refused(folder, "Is a directory");
    refused(in("none/file"), "No such file");
    write_text("/dev/null", FV_OUTPUT_WHOLE, "lost");
    assert_true(stat("/dev/null", &about) == 0 && S_ISCHR(about.st_mode));
    assert_int_equal(fv_output_open(&output, "/dev/full", FV_OUTPUT_WHOLE, NULL), FOVEA_OK);
    fputs("lost", fv_output_stream(&output));
    struct fovea_error error;
    assert_int_equal(fv_output_close(&output, &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "No space left"));
    /* A pipe that is open already, as the shell's >(command). */
    int ends[2];
    char name[32], text[8] = "";
    assert_int_equal(pipe(ends), 0);
    snprintf(name, sizeof name, "/dev/fd/%d", ends[1]);
    write_text(name, FV_OUTPUT_WHOLE, "piped");
    assert_int_equal(read(ends[0], text, sizeof text - 1), 5);
    assert_string_equal(text, "piped");
    close(ends[0]);
    close(ends[1]);
    /* Standard output in a file is written on, not replaced. */
    FILE *out = fopen(in("out"), "w");
    fputs("first ", out);
    fflush(out);
    snprintf(name, sizeof name, "/dev/fd/%d", fileno(out));
    write_text(name, FV_OUTPUT_WHOLE, "then");
    fclose(out);
    assert_text(in("out"), "first then");
}

static void a_second_writer_is_refused_and_a_dead_one_is_not(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        const enum fv_output_kind kind = i == 0 ? FV_OUTPUT_WHOLE : FV_OUTPUT_STREAM;
        int ends[2];
        char byte;
        assert_int_equal(pipe(ends), 0);
        const pid_t child = fork();
        if (child == 0) {
            struct fv_output output;
            if (fv_output_open(&output, in("shared"), kind, NULL) != FOVEA_OK) _exit(1);
            (void)!write(ends[1], "x", 1);
            for (;;)
                pause();
        }
        assert_int_equal(read(ends[0], &byte, 1), 1);
        refused(in("shared"), "another program");
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        write_text(in("shared"), kind, "mine");
        assert_text(in("shared"), "mine");
        assert_int_equal(access(in("shared.part"), F_OK), -1);
        close(ends[0]);
        close(ends[1]);
    }
}

/* Whoever gets the name, it is one at a time: each adds one to a number in the file. */
static void many_writers_of_one_path_take_turns(void **state)
{
    (void)state;
    enum { WRITERS = 4, WRITES = 20 };
    put(in("sum"), "0");
    for (int w = 0; w < WRITERS; w++)
        if (fork() == 0) {
            for (int done = 0; done < WRITES;) {
                struct fv_output output;
                int number;
                if (fv_output_open(&output, in("sum"), FV_OUTPUT_WHOLE, NULL) != FOVEA_OK) {
                    usleep(500); /* the one whose turn it is waits for the disk */
                    continue;
                }
                FILE *now = fopen(in("sum"), "r");
                if (now == NULL || fscanf(now, "%d", &number) != 1) _exit(1);
                fclose(now);
                fprintf(fv_output_stream(&output), "%d", number + 1);
                if (fv_output_close(&output, NULL) != FOVEA_OK) _exit(2);
                done++;
            }
            _exit(0);
        }
    for (int w = 0, status; w < WRITERS; w++) {
        wait(&status);
        assert_int_equal(status, 0);
    }
    assert_text(in("sum"), "80");
}

static void a_deleted_output_is_noticed(void **state)
{
    (void)state;
    struct fv_output output;
    assert_int_equal(fv_output_open(&output, in("gone"), FV_OUTPUT_STREAM, NULL), FOVEA_OK);
    assert_true(fv_output_there(&output));
    unlink(in("gone"));
    assert_false(fv_output_there(&output));
    put(in("gone"), "another");
    assert_false(fv_output_there(&output));
    fv_output_discard(&output);
    assert_text(in("gone"), "another");
}

/* ---- what is read ---------------------------------------------------------------------------- */

static bool visited(const char *written, const char *read)
{
    const struct fv_file files[] = {{"--other", NULL}, {"--stats", written}, {0}};
    struct fovea_error error;
    struct fv_files_watch watch;
    fv_files_watch(&watch, files, "--source", &error);
    fv_files_visit(&watch, read);
    if (watch.status == FOVEA_OK) return false;
    assert_int_equal(watch.status, FOVEA_ERROR_INPUT);
    assert_true(strstr(error.text, "--stats") != NULL && strstr(error.text, "--source") != NULL);
    return true;
}

static void what_is_read_is_known_by_inode_folder_and_temporary_name(void **state)
{
    (void)state;
    assert_int_equal(mkdir(in("data"), 0777), 0);
    put(in("data/a"), "a");
    put(in("b"), "b");
    put(in("b.part"), "p");
    assert_int_equal(symlink(in("data"), in("linked")), 0);
    assert_int_equal(link(in("data/a"), in("hard")), 0);
    assert_int_equal(symlink(in("b"), in("soft")), 0);
    assert_true(visited(in("data/a"), in("data/a")));
    assert_true(visited(in("data/../data/./a"), in("linked/a")));
    assert_true(visited(in("hard"), in("data/a")));
    assert_true(visited(in("soft"), in("b")));
    assert_true(visited(in("b"), in("soft")));
    assert_true(visited(in("b"), in("b.part")));
    assert_true(visited(in("data/new"), in("linked/new"))); /* neither is there */
    assert_true(visited(in("data/new"), in("linked/new.part")) == false);
    assert_true(visited(in("data/new"), in("data")));
    assert_true(visited(in("linked/new"), in("data")));
    assert_false(visited(in("new"), in("data")));
    assert_false(visited(in("b"), in("data/a")));
    assert_false(visited(in("data/new"), in("data/a")));
    assert_false(visited(in("data/new"), in("data/other")));
}

static int set_up(void **state)
{
    (void)state;
    fv_test_folder(folder);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    fv_test_folder_remove(folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_output_replaces_and_cuts_nothing),
        cmocka_unit_test(a_whole_output_is_there_at_its_end_or_not_at_all),
        cmocka_unit_test(links_are_replaced_and_never_followed),
        cmocka_unit_test(devices_and_pipes_are_refused_but_streams_and_sinks_are_not),
        cmocka_unit_test(a_second_writer_is_refused_and_a_dead_one_is_not),
        cmocka_unit_test(many_writers_of_one_path_take_turns),
        cmocka_unit_test(a_deleted_output_is_noticed),
        cmocka_unit_test(what_is_read_is_known_by_inode_folder_and_temporary_name),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
