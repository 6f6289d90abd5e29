/* One line to a person on stderr. Whatever the text quotes from files or arguments, it stays one
 * line: control bytes are shown as '?' and the line is cut at 1023 bytes. Off the loop thread. */
#ifndef FOVEA_SUPPORT_SAY_H
#define FOVEA_SUPPORT_SAY_H

/* Exit statuses of every command. */
enum fv_exit {
    FV_EXIT_OK = 0,
    FV_EXIT_FAILED = 1, /* failed while running: the machine, a full disk, a difference found */
    FV_EXIT_WRONG = 2   /* wrong input: arguments, configuration, calibration, recording */
};

#if defined(__GNUC__)
#define FV_SAY_FORMAT __attribute__((format(printf, 1, 2)))
#else
#define FV_SAY_FORMAT
#endif

void fv_say(const char *format, ...) FV_SAY_FORMAT;
/* The same, returning the exit status to leave with. */
enum fv_exit fv_say_wrong(const char *format, ...) FV_SAY_FORMAT;  /* FV_EXIT_WRONG */
enum fv_exit fv_say_failed(const char *format, ...) FV_SAY_FORMAT; /* FV_EXIT_FAILED */
/* What a terminal shows while a command works: written over by the next one, and gone when a line
 * is said or the text is empty. Cut to the terminal's width. */
void fv_say_status(const char *format, ...) FV_SAY_FORMAT;
/* Show control bytes of a text from elsewhere as '?', so that printing it cannot steer the
 * terminal. */
void fv_say_clean(char *text);
/* For the end of a command: FV_EXIT_OK when all that it printed on stdout could be written, else
 * told and FV_EXIT_FAILED. */
enum fv_exit fv_say_unwritten(void);

#endif
