/* Lines to people: one each, and none of them on the line of the status. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "support/say.h"

static char text[4096];

/* What `say` puts on standard error. */
static const char *said(void (*say)(void))
{
    FILE *file = tmpfile();
    assert_non_null(file);
    fflush(stderr);
    const int kept = dup(STDERR_FILENO);
    dup2(fileno(file), STDERR_FILENO);
    say();
    fflush(stderr);
    dup2(kept, STDERR_FILENO);
    close(kept);
    rewind(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    return text;
}

static void lines(void)
{
    fv_say("a %d", 1);
    assert_int_equal(fv_say_wrong("b\nc\x1b[2J"), FV_EXIT_WRONG);
    assert_int_equal(fv_say_failed("%s", "d"), FV_EXIT_FAILED);
    fv_say("M\u00fcller \u65e5"); /* as typed */
    fv_say("\xc2\x9b"
           "31m \u202e \xff"); /* CSI in one character, right to left, no UTF-8 */
}

static void test_lines(void **state)
{
    (void)state;
    assert_string_equal(said(lines), "a 1\nb?c?[2J\nd\nM\u00fcller \u65e5\n??31m ??? ?\n");
}

static void over_status(void)
{
    fv_say_status("frame %d", 7);
    fv_say_status("frame %d", 8);
    fv_say("x.png: not there");
    fv_say("y.png: not there");
    fv_say_status("frame %d", 9);
    fv_say_status("%s", "");
    fv_say("end");
}

static void test_no_line_on_the_status(void **state)
{
    (void)state;
    assert_string_equal(said(over_status),
                        "\r\033[Kframe 7\r\033[Kframe 8\r\033[Kx.png: not there\ny.png: not there\n"
                        "\r\033[Kframe 9\r\033[Kend\n");
}

static void long_status(void)
{
    char word[2000];
    memset(word, 'w', sizeof word - 1);
    word[sizeof word - 1] = '\0';
    fv_say_status("%s", word);
}

/* Narrower than the terminal, which would begin a new line; where there is none, 80 columns. */
static void test_status_is_cut(void **state)
{
    (void)state;
    assert_int_equal(strlen(said(long_status)), strlen("\r\033[K") + 79);
}

static void no_status(void)
{
    fv_say_status("%s", "");
}

static void words(void)
{
    assert_true(fv_say_word(FV_SAY_GREEN, "tracking", " from frame %d on", 7));
    fv_say_status_word(FV_SAY_RED, "lost", "  %s", "frame 8");
}

static void test_a_word_has_no_colour_where_there_is_no_terminal(void **state)
{
    (void)state;
    (void)said(no_status);
    assert_string_equal(said(words), "tracking from frame 7 on\n\r\033[Klost  frame 8");
}

/* Nobody reads, and the pipe is full: the line is left out, and who says it is not held up. */
static void test_a_word_that_nobody_takes_is_refused(void **state)
{
    (void)state;
    int ends[2];
    char full[4096] = "";
    assert_int_equal(pipe2(ends, O_NONBLOCK), 0);
    while (write(ends[1], full, sizeof full) > 0) {
    }
    fflush(stderr);
    const int kept = dup(STDERR_FILENO);
    dup2(ends[1], STDERR_FILENO);
    const bool taken = fv_say_word(FV_SAY_PLAIN, "lost", " from frame %d on", 9);
    dup2(kept, STDERR_FILENO);
    close(kept);
    close(ends[0]);
    close(ends[1]);
    assert_false(taken);
}

static void of_levels(void)
{
    fv_say("a camera is gone");
    fv_say_note("a recording was closed");
    (void)fv_say_wrong("a key is wrong");
    (void)fv_say_failed("a disk is full");
    fv_say_word(FV_SAY_RED, "lost", " from frame %d on", 7);
    fv_say_word(FV_SAY_YELLOW, "weak", " from frame %d on", 8);
    fv_say_word(FV_SAY_GREEN, "tracking", " from frame %d on", 9);
}

/* JOURNAL_STREAM names standard error. */
static void to_the_journal(void)
{
    char stream[64];
    struct stat about;
    assert_int_equal(fstat(STDERR_FILENO, &about), 0);
    snprintf(stream, sizeof stream, "%llu:%llu", (unsigned long long)about.st_dev,
             (unsigned long long)about.st_ino);
    setenv("JOURNAL_STREAM", stream, 1);
    of_levels();
}

static void to_another_file(void)
{
    setenv("JOURNAL_STREAM", "1:1", 1);
    of_levels();
}

static void test_the_journal_is_told_the_level(void **state)
{
    (void)state;
    (void)said(no_status);
    assert_string_equal(said(to_the_journal),
                        "<4>a camera is gone\n<6>a recording was closed\n<3>a key is wrong\n"
                        "<3>a disk is full\n<3>lost from frame 7 on\n<4>weak from frame 8 on\n"
                        "<6>tracking from frame 9 on\n");
    assert_string_equal(said(to_another_file),
                        "a camera is gone\na recording was closed\na key is wrong\n"
                        "a disk is full\nlost from frame 7 on\nweak from frame 8 on\n"
                        "tracking from frame 9 on\n");
    unsetenv("JOURNAL_STREAM");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines),
        cmocka_unit_test(test_no_line_on_the_status),
        cmocka_unit_test(test_status_is_cut),
        cmocka_unit_test(test_a_word_has_no_colour_where_there_is_no_terminal),
        cmocka_unit_test(test_a_word_that_nobody_takes_is_refused),
        cmocka_unit_test(test_the_journal_is_told_the_level),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
