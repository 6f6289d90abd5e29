/* The folder of public recordings and pictures: $FOVEA_DATA. */
#ifndef FOVEA_TESTS_COMMON_DATA_FOLDER_H
#define FOVEA_TESTS_COMMON_DATA_FOLDER_H

#include <stdlib.h>

static inline const char *fv_data_folder(void)
{
    const char *folder = getenv("FOVEA_DATA");
    return folder != NULL && folder[0] != '\0' ? folder : "../shared/data";
}

#endif
