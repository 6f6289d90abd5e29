#include "support/say.h"

#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
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
 * still to be written. False: stderr has taken nothing for so long; the line is left out. */
static bool takes_lines(int wait_ms)
{
    struct pollfd out = {.fd = STDERR_FILENO, .events = POLLOUT};
    return poll(&out, 1, wait_ms) != 0;
}

static void say(const char *format, va_list arguments)
{
    enum { WAIT_MS = 200 };
    char line[1024];
    vsnprintf(line, sizeof line, format, arguments);
    fv_say_clean(line);
    if (!takes_lines(WAIT_MS)) return;
    const int call = fv_stall_enter("standard error");
    fprintf(stderr, "%s%s\n", clear(false), line);
    fv_stall_leave(call);
}

void fv_say_status(const char *format, ...)
{
    char line[1024];
    struct winsize size;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    size_t columns =
        ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
    if (strlen(line) >= columns && columns < sizeof line) line[columns - 1] = '\0';
    if (!takes_lines(0)) return;
    const int call = fv_stall_enter("standard error");
    fprintf(stderr, "%s%s", clear(line[0] != '\0'), line);
    fv_stall_leave(call);
}

void fv_say(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(format, arguments);
    va_end(arguments);
}

enum fv_exit fv_say_wrong(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(format, arguments);
    va_end(arguments);
    return FV_EXIT_WRONG;
}

enum fv_exit fv_say_failed(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say(format, arguments);
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
