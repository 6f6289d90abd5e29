#include "app/say.h"

#include <errno.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

static atomic_bool status_shown;

/* Makes the status's line empty where there is one. */
static const char *clear(bool shown_after)
{
    return atomic_exchange(&status_shown, shown_after) || shown_after ? "\r\033[K" : "";
}

void fv_say_clean(char *text)
{
    for (; *text != '\0'; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f) *text = '?';
}

static void say(const char *format, va_list arguments)
{
    char line[1024];
    vsnprintf(line, sizeof line, format, arguments);
    fv_say_clean(line);
    fprintf(stderr, "%s%s\n", clear(false), line);
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
    fprintf(stderr, "%s%s", clear(line[0] != '\0'), line);
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
    if (fflush(stdout) == 0 && !ferror(stdout)) return FV_EXIT_OK;
    return fv_say_failed("standard output: cannot be written: %s", strerror(errno));
}
