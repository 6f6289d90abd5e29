/* Configuration files: whatever the bytes are, reading them ends in settings that print and read
 * back to the same values, or in one line that names the file. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/settings.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void expect(int holds)
{
    if (!holds) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    static struct fv_settings settings, back;
    struct fovea_error error;
    fv_settings_default(&settings);
    enum fovea_status status =
        fv_settings_parse(&settings, "fuzz.yaml", (const char *)data, bytes, &error);
    if (status == FOVEA_OK) status = fv_settings_check(&settings, &error);
    if (status != FOVEA_OK) {
        expect(strchr(error.text, '\n') == NULL);
        expect(strstr(error.text, "fuzz.yaml") != NULL);
        return 0;
    }
    char *text = NULL, *again = NULL;
    size_t text_bytes = 0, again_bytes = 0;
    FILE *file = open_memstream(&text, &text_bytes);
    fv_settings_print(file, &settings, true);
    fclose(file);
    fv_settings_default(&back);
    expect(fv_settings_parse(&back, "printed", text, text_bytes, &error) == FOVEA_OK);
    file = open_memstream(&again, &again_bytes);
    fv_settings_print(file, &back, true);
    fclose(file);
    expect(text_bytes == again_bytes && memcmp(text, again, text_bytes) == 0);
    expect(memcmp(settings.runtime.rig.cameras[0].T_body_cam,
                  back.runtime.rig.cameras[0].T_body_cam,
                  sizeof back.runtime.rig.cameras[0].T_body_cam) == 0);
    free(text);
    free(again);
    return 0;
}
