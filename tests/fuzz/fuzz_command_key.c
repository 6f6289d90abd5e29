/* The file of a key for commands. One that is taken is 32 digits, and the key is those. */
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/network/command_gate.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static char path[] = "/tmp/fovea_fuzz_key_XXXXXX";

static void clean_up(void)
{
    unlink(path);
}

static void write_file(const uint8_t *data, size_t bytes)
{
    static int file = -1;
    if (file < 0) {
        file = mkstemp(path); /* for its owner alone */
        if (file < 0) abort();
        atexit(clean_up);
    }
    if (ftruncate(file, 0) != 0 || pwrite(file, data, bytes, 0) != (ssize_t)bytes) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    uint8_t key[FV_SIPHASH_KEY_BYTES];
    struct fovea_error error = {.text = ""};
    write_file(data, bytes);
    if (fv_command_key_read(path, key, &error) != FOVEA_OK) {
        if (error.text[0] == '\0' || strchr(error.text, '\n') != NULL) abort();
        return 0;
    }
    for (size_t i = 0; i < FV_SIPHASH_KEY_BYTES; i++) {
        const char digits[] = {(char)data[2 * i], (char)data[2 * i + 1], '\0'};
        char *end;
        if (strtoul(digits, &end, 16) != key[i] || *end != '\0') abort();
    }
    return 0;
}
