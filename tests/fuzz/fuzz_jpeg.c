/* JPEG files as frames of a recording. */
#include "decode_one.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    return decode_one(data, bytes);
}
