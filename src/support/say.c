#include "support/say.h"

#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "support/stall.h"
#include "support/text.h"
#include "support/utf8.h"

static atomic_bool status_shown;

/* Makes the status's line empty where there is one. */
static const char *clear(bool shown_after)
{
    return atomic_exchange(&status_shown, shown_after) || shown_after ? "\r\033[K" : "";
}

void fv_say_clean(char *text)
{
    while (*text != '\0') {
        uint32_t code;
        const int length = fv_utf8_decode(text, &code);
        const int bytes = length > 0 ? length : 1;
        if (length == 0 || !fv_text_shown(code))
            for (int i = 0; i < bytes; i++)
                text[i] = '?';
        text += bytes;
    }
}

/* A stopped terminal, or a pipe that nobody reads, must not hold what says something: files are
 * still to be written. False: stderr took nothing for `wait_ms`; the line is left out. */
static bool takes_lines(int wait_ms)
{
    struct pollfd out = {.fd = STDERR_FILENO, .events = POLLOUT};
    return poll(&out, 1, wait_ms) != 0;
}

enum { LINE_BYTES = 1024 };

static bool coloured(void)
{
    const char *no = getenv("NO_COLOR"), *term = getenv("TERM");
    return fv_say_terminal() && (no == NULL || no[0] == '\0') && term != NULL && term[0] != '\0' &&
           strcmp(term, "dumb") != 0;
}

/* What switches a colour on, "" for none. */
static const char *escape(enum fv_say_colour colour)
{
    static const char *const escapes[] = {
        [FV_SAY_PLAIN] = "",
        [FV_SAY_GREEN] = "\033[32m",
        [FV_SAY_YELLOW] = "\033[33m",
        [FV_SAY_RED] = "\033[31m",
    };
    return colour != FV_SAY_PLAIN && coloured() ? escapes[colour] : "";
}

enum level { ERROR = 3, WARNING = 4, NOTE = 6 }; /* of syslog(3) */

/* What the journal reads of a line's level, where stderr is the journal's (systemd.exec(5),
 * JOURNAL_STREAM). */
static const char *prefix(enum level level)
{
    static const char *const prefixes[] = {[ERROR] = "<3>", [WARNING] = "<4>", [NOTE] = "<6>"};
    const char *stream = getenv("JOURNAL_STREAM");
    char own[64];
    struct stat about;
    if (stream == NULL || fstat(STDERR_FILENO, &about) != 0) return "";
    snprintf(own, sizeof own, "%llu:%llu", (unsigned long long)about.st_dev,
             (unsigned long long)about.st_ino);
    return strcmp(own, stream) == 0 ? prefixes[level] : "";
}

/* Write a line whose first `word_bytes` bytes are in colour. */
static void put(const char *before, enum fv_say_colour colour, int word_bytes, const char *line,
                const char *after)
{
    const char *on = escape(colour);
    const int call = fv_stall_enter("standard error");
    fprintf(stderr, "%s%s%.*s%s%s%s", before, on, word_bytes, line, on[0] != '\0' ? "\033[0m" : "",
            line + word_bytes, after);
    fv_stall_leave(call);
}

/* False: stderr took nothing, and the line is left out. */
static bool say(enum level level, enum fv_say_colour colour, const char *word, const char *format,
                va_list arguments)
{
    enum { WAIT_MS = 200 };
    char line[LINE_BYTES];
    int bytes = snprintf(line, sizeof line, "%.100s", word);
    vsnprintf(line + bytes, sizeof line - (size_t)bytes, format, arguments);
    fv_say_clean(line);
    if (!takes_lines(WAIT_MS)) return false;
    const char *before = clear(false);
    put(before[0] != '\0' ? before : prefix(level), colour, bytes, line, "\n");
    return true;
}

/* Leave out the fields that do not fit before the last column; a first one that does not is cut. */
static void fit(char *line)
{
    struct winsize size;
    const size_t columns =
        ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
    if (strlen(line) < columns) return;
    line[columns - 1] = '\0';
    const size_t margin = strspn(line, " ");
    for (size_t i = strlen(line); i-- > margin + 1;)
        if (line[i] == ' ' && line[i - 1] == ' ') {
            line[i - 1] = '\0';
            return;
        }
}

static void status(enum fv_say_colour colour, const char *word, const char *format,
                   va_list arguments)
{
    char line[LINE_BYTES];
    int bytes = snprintf(line, sizeof line, "%.100s", word);
    vsnprintf(line + bytes, sizeof line - (size_t)bytes, format, arguments);
    fv_say_clean(line);
    fit(line);
    if ((size_t)bytes > strlen(line)) bytes = (int)strlen(line);
    if (takes_lines(0)) put(clear(line[0] != '\0'), colour, bytes, line, "");
}

bool fv_say_terminal(void)
{
    return isatty(STDERR_FILENO) == 1;
}

void fv_say_status(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    status(FV_SAY_PLAIN, "", format, arguments);
    va_end(arguments);
}

void fv_say_status_word(enum fv_say_colour colour, const char *word, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    status(colour, word, format, arguments);
    va_end(arguments);
}

bool fv_say_word(enum fv_say_colour colour, const char *word, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    static const enum level levels[] = {[FV_SAY_PLAIN] = NOTE,
                                        [FV_SAY_GREEN] = NOTE,
                                        [FV_SAY_YELLOW] = WARNING,
                                        [FV_SAY_RED] = ERROR};
    const bool taken = say(levels[colour], colour, word, format, arguments);
    va_end(arguments);
    return taken;
}

void fv_say(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)say(WARNING, FV_SAY_PLAIN, "", format, arguments);
    va_end(arguments);
}

void fv_say_note(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)say(NOTE, FV_SAY_PLAIN, "", format, arguments);
    va_end(arguments);
}

enum fv_exit fv_say_wrong(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)say(ERROR, FV_SAY_PLAIN, "", format, arguments);
    va_end(arguments);
    return FV_EXIT_WRONG;
}

enum fv_exit fv_say_failed(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)say(ERROR, FV_SAY_PLAIN, "", format, arguments);
    va_end(arguments);
    return FV_EXIT_FAILED;
}

enum fv_exit fv_say_unwritten(void)
{
    errno = EIO; /* where an earlier write failed, its reason is gone */
    const int call = fv_stall_enter("standard output");
    const bool written = fflush(stdout) == 0 && !ferror(stdout);
    const int reason = errno;
    fv_stall_leave(call);
    if (written) return FV_EXIT_OK;
    errno = reason;
    return fv_say_failed("standard output: cannot be written: %s", strerror(errno));
}
