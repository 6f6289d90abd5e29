/* .npy files as inputs of a network. */
#include "app/lab/npy.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    struct fv_npy array;
    struct fovea_error error;
    if (fv_npy_parse("fuzz", data, bytes, &array, &error) != FOVEA_OK) return 0;
    const uint8_t *elements = array.data;
    volatile uint8_t element; /* all of them can be read */
    for (size_t i = 0; i < array.bytes; i++)
        element = elements[i];
    (void)element;
    return 0;
}
