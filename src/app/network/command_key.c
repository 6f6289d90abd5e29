#include "app/network/command_gate.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAKE "(umask 077; od -An -N16 -tx1 /dev/urandom | tr -d ' \\n' > %s)"

enum { DIGITS = 2 * FV_SIPHASH_KEY_BYTES };

static int digit(char letter)
{
    const char *digits = "0123456789abcdef";
    const char *at = letter != '\0' ? strchr(digits, tolower((unsigned char)letter)) : NULL;
    return at != NULL ? (int)(at - digits) : -1;
}

/* 32 digits, and white space behind them. */
static bool parse(const char *text, size_t bytes, uint8_t key[FV_SIPHASH_KEY_BYTES])
{
    for (size_t i = 0; i < bytes; i++)
        if (i < DIGITS ? digit(text[i]) < 0 : !isspace((unsigned char)text[i])) return false;
    for (size_t i = 0; i < FV_SIPHASH_KEY_BYTES && bytes >= DIGITS; i++)
        key[i] = (uint8_t)(digit(text[2 * i]) << 4 | digit(text[2 * i + 1]));
    return bytes >= DIGITS;
}

enum fovea_status fv_command_key_read(const char *path, uint8_t key[FV_SIPHASH_KEY_BYTES],
                                      struct fovea_error *error)
{
    char text[DIGITS + 8];
    struct stat file;
    ssize_t bytes = -1;
    const char *found = NULL;
    const int descriptor = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    const bool looked = descriptor >= 0 && fstat(descriptor, &file) == 0;
    if (!looked)
        found = strerror(errno);
    else if (!S_ISREG(file.st_mode))
        found = "no ordinary file";
    else if (file.st_mode & 077)
        found = "a file that others than its owner may use (chmod 600 remedies that)";
    else if (file.st_uid != 0 && file.st_uid != geteuid())
        found = "a file of another user";
    if (found == NULL && (bytes = read(descriptor, text, sizeof text)) < 0) found = strerror(errno);
    if (found == NULL && !parse(text, (size_t)bytes, key)) found = "something else";
    if (descriptor >= 0) close(descriptor);
    if (found == NULL) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "command_key: %.300s: found %s, expected 32 hexadecimal digits; to make "
                           "a key: " MAKE,
                           path, found, path);
}
