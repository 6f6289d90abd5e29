/* Map files: whatever the bytes say, reading refuses them or gives a map that is whole. The
 * checksum is put right first, or nothing would get past it. */
#include <stdlib.h>
#include <string.h>

#include "common/small_map.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    static struct small_map small;
    struct fv_archive_info info;
    struct fovea_error error;
    if (small.memory == NULL) small_map_make(&small);
    uint8_t *copy = malloc(bytes + 1);
    memcpy(copy, data, bytes);
    if (bytes >= FV_ARCHIVE_HEADER_BYTES) {
        for (int i = 0; i < 8; i++)
            copy[16 + i] = (uint8_t)((uint64_t)bytes >> (8 * i));
        fv_archive_seal(copy, bytes);
    }
    if (fv_archive_read(copy, bytes, "map", &small.map, &info, &error) != FOVEA_OK &&
        info.grid.side != 0)
        abort();
    for (uint32_t i = 0; i < info.grid.side * info.grid.side; i++) /* all there, and sound */
        if (info.grid_at + i + FV_ARCHIVE_CHECKSUM_BYTES >= bytes ||
            !fv_archive_cell((int8_t)copy[info.grid_at + i]))
            abort();
    if (small_map_trouble(&small.map) != NULL) abort();
    free(copy);
    return 0;
}
