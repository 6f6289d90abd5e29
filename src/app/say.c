#include "app/say.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static void say(const char *format, va_list arguments)
{
    char line[1024];
    vsnprintf(line, sizeof line, format, arguments);
    for (char *byte = line; *byte != '\0'; byte++)
        if ((unsigned char)*byte < 0x20 || *byte == 0x7f) *byte = '?';
    fprintf(stderr, "%s\n", line);
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
