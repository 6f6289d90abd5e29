#include "app/lab/lettering.h"

#include <stdbool.h>
#include <stddef.h>

#include "drivers/plugin.h"
#include "support/lettering.h"

void fv_lettering_open(void)
{
    static const struct fv_plugin_name name = {"text", "fovea-text.so", "libfreetype-dev",
                                               "fovea_lettering", FV_LETTERING_VERSION};
    static bool tried;
    const void *table;
    struct fovea_error error;
    if (tried) return;
    tried = true;
    if (fv_plugin_load(&name, &table, &error) != FOVEA_OK) return;
    const struct fv_lettering *lettering = table;
    if (lettering->open()) fv_canvas_use_lettering(lettering);
}
