/* Status codes, and the one-line error that says why something was refused.
 *
 * Zero is success, negative values are errors, positive values are normal outcomes that the caller
 * must tell apart. Functions that check input from outside (configuration, calibration, models,
 * recordings) also fill a struct fovea_error: one line that names the file, the key or byte, what
 * was found and what was expected. Outputs are untouched on error unless a function says otherwise.
 */
#ifndef FOVEA_STATUS_H
#define FOVEA_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_status {
    FOVEA_OK = 0,

    /* Normal outcomes. */
    FOVEA_AGAIN = 2, /* nothing yet: deadline passed, or a job has units left */
    FOVEA_END = 3,   /* a recording has no more frames */
    FOVEA_GONE = 4,  /* the camera is not there at present */

    /* Errors. */
    FOVEA_ERROR_ARGUMENT = -1,    /* a value is out of its documented range */
    FOVEA_ERROR_INPUT = -2,       /* a file, message or stream is malformed or does not fit */
    FOVEA_ERROR_MEMORY = -3,      /* the caller's block is too small or misaligned */
    FOVEA_ERROR_SYSTEM = -4,      /* the operating system refused; the error text says what */
    FOVEA_ERROR_UNSUPPORTED = -5, /* well-formed, but not something this build can do */
};

enum { FOVEA_ERROR_TEXT_BYTES = 512 };

/* One line of text for a person, without a trailing newline. Owned by the caller. */
struct fovea_error {
    enum fovea_status status;
    char text[FOVEA_ERROR_TEXT_BYTES];
};

/* Short English name of a status, for logs and messages. Any thread; never NULL. */
const char *fovea_status_name(enum fovea_status status);

/* Fill `error` (which may be NULL) with a printf-style line, cut to fit, and return `status`, so
 * that a check reads `return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s:%d: ...", ...)`.
 * Init-only: never from a step. */
enum fovea_status fovea_error_set(struct fovea_error *error, enum fovea_status status,
                                  const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 3, 4)))
#endif
    ;

#ifdef __cplusplus
}
#endif
#endif
