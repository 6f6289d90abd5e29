/* Model files: opened, and run for some units where the checks let them pass. Size and checksum are
 * mended first. */
#include "common/nn_mutant.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    void *copy = NULL;
    if (bytes == 0 || posix_memalign(&copy, 64, bytes) != 0) return 0;
    memcpy(copy, data, bytes);
    nn_mutant_seal(copy, bytes);
    nn_mutant_run(copy, bytes);
    free(copy);
    return 0;
}
