#include "fovea/status.h"

#include <stdarg.h>
#include <stdio.h>

const char *fovea_status_name(enum fovea_status status)
{
    switch (status) {
    case FOVEA_OK:
        return "ok";
    case FOVEA_AGAIN:
        return "again";
    case FOVEA_END:
        return "end";
    case FOVEA_GONE:
        return "gone";
    case FOVEA_ERROR_ARGUMENT:
        return "argument out of range";
    case FOVEA_ERROR_INPUT:
        return "malformed input";
    case FOVEA_ERROR_MEMORY:
        return "memory block too small";
    case FOVEA_ERROR_SYSTEM:
        return "refused by the system";
    case FOVEA_ERROR_UNSUPPORTED:
        return "not supported";
    }
    return "unknown status";
}

enum fovea_status fovea_error_set(struct fovea_error *error, enum fovea_status status,
                                  const char *format, ...)
{
    if (error != NULL) {
        va_list arguments;
        va_start(arguments, format);
        error->status = status;
        vsnprintf(error->text, sizeof error->text, format, arguments);
        va_end(arguments);
    }
    return status;
}
