/* The file of counters that survive restarts: what is taken is written as the same bytes. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/history.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    struct fv_history history, again;
    struct fovea_error error;
    char text[4096 + 1], written[4096];
    if (bytes > 4096) return 0;
    memcpy(text, data, bytes);
    text[bytes] = '\0';
    if (fv_history_parse("history", text, &history, &error) != FOVEA_OK) return 0;
    int length = 0;
#define WRITE(name)                                                                                \
    length += snprintf(written + length, sizeof written - (size_t)length, #name ": %" PRIu64 "\n", \
                       history.name);
    FV_HISTORY_COUNTERS(WRITE)
    if (fv_history_parse("history", written, &again, &error) != FOVEA_OK ||
        memcmp(&history, &again, sizeof again) != 0)
        abort();
    return 0;
}
