/* One line to a person on stderr. Whatever the text quotes from files or arguments, it stays one
 * line: control bytes are shown as '?' and the line is cut at 1023 bytes. Off the loop thread.
 *
 * Where stderr is systemd's journal (JOURNAL_STREAM), the line gets its level: that of fv_say and
 * of words in yellow is a warning, of fv_say_wrong, fv_say_failed and words in red an error, of all
 * others information. */
#ifndef FOVEA_SUPPORT_SAY_H
#define FOVEA_SUPPORT_SAY_H

#include <stdbool.h>

/* Exit statuses of every command. */
enum fv_exit {
    FV_EXIT_OK = 0,
    FV_EXIT_FAILED = 1, /* failed while running: the machine, a full disk, a difference found */
    FV_EXIT_WRONG = 2   /* wrong input: arguments, configuration, calibration, recording */
};

#if defined(__GNUC__)
#define FV_SAY_FORMAT_AT(text, first) __attribute__((format(printf, text, first)))
#else
#define FV_SAY_FORMAT_AT(text, first)
#endif
#define FV_SAY_FORMAT FV_SAY_FORMAT_AT(1, 2)

void fv_say(const char *format, ...) FV_SAY_FORMAT;      /* something is not as it should be */
void fv_say_note(const char *format, ...) FV_SAY_FORMAT; /* all is well */
/* The same, returning the exit status to leave with. */
enum fv_exit fv_say_wrong(const char *format, ...) FV_SAY_FORMAT;  /* FV_EXIT_WRONG */
enum fv_exit fv_say_failed(const char *format, ...) FV_SAY_FORMAT; /* FV_EXIT_FAILED */

/* Whether stderr is a terminal: only there a status is shown. */
bool fv_say_terminal(void);
/* What a terminal shows while a command works: overwritten by the next one, and removed when a line
 * is said or the text is empty. Fields are separated by two spaces; those that do not fit into the
 * terminal's width are left out. */
void fv_say_status(const char *format, ...) FV_SAY_FORMAT;

/* The same line and status behind a word in colour. Colours are shown on a terminal only, and not
 * when the environment has NO_COLOR (https://no-color.org) or TERM is "dumb" or missing.
 * fv_say_word returns false when stderr took nothing for a while, as a stopped terminal does: the
 * line is left out. */
enum fv_say_colour { FV_SAY_PLAIN, FV_SAY_GREEN, FV_SAY_YELLOW, FV_SAY_RED };
bool fv_say_word(enum fv_say_colour colour, const char *word, const char *format, ...)
    FV_SAY_FORMAT_AT(3, 4);
void fv_say_status_word(enum fv_say_colour colour, const char *word, const char *format, ...)
    FV_SAY_FORMAT_AT(3, 4);
/* Show control bytes of a text from elsewhere as '?', so that printing it cannot steer the
 * terminal. */
void fv_say_clean(char *text);
/* For the end of a command: FV_EXIT_OK when all that it printed on stdout could be written, else a
 * line that says so, and FV_EXIT_FAILED. */
enum fv_exit fv_say_unwritten(void);

#endif
