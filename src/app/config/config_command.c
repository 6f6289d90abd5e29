/* fovea config: print the commented configuration or its reference, or check a file. */
#include <stdbool.h>
#include <stddef.h>

#include "app/config/commands.h"
#include "app/config/settings.h"
#include "app/config/options.h"
#include "app/config/setup.h"
#include "support/say.h"
#include "drivers/table.h"
#include "fovea/source.h"

int fv_command_config(int argc, char **argv)
{
    const char *file = NULL;
    bool markdown = false;
    struct fv_option_list sets = {0};
    const struct fv_option options[] = {
        {"check", "FILE", FV_OPTION_TEXT, &file,
         "check FILE and the files that it names instead of printing"},
        {"set", "KEY=VALUE", FV_OPTION_LIST, &sets, "override a key"},
        {"markdown", NULL, FV_OPTION_FLAG, &markdown,
         "print the reference of all keys as Markdown (docs/configuration.md)"},
        {0},
    };
    int first;
    enum fv_options_result result = fv_options_parse(options, "", 0, 0, argc, argv, &first);
    static struct fv_settings settings;
    struct fovea_error error;
    fv_settings_default(&settings);
    if (result == FV_OPTIONS_HELP && fv_options_man_printed()) fv_settings_man(&settings);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;

    if (file != NULL && fv_settings_read(&settings, file, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    for (int i = 0; i < sets.count; i++)
        if (fv_settings_set(&settings, sets.values[i], &error) != FOVEA_OK)
            return fv_say_wrong("%s", error.text);
    if (fv_settings_check(&settings, &error) != FOVEA_OK) return fv_say_wrong("%s", error.text);
    const struct fovea_source_ops *ops;
    const char *address;
    enum fovea_status status = fv_source_find(settings.source, &ops, &address, &error);
    if (status != FOVEA_OK) {
        fv_settings_blame(&settings, "source", &error);
        return fv_say_wrong("%s", error.text);
    }
    if (file != NULL) status = fv_setup_check_files(&settings, &error);
    if (status != FOVEA_OK) return (fv_say("%s", error.text), fv_setup_exit(status));
    if (file != NULL)
        printf("%s: ok\n", file);
    else if (markdown)
        fv_settings_markdown(stdout, &settings);
    else
        fv_settings_print(stdout, &settings, true);
    return FV_EXIT_OK;
}
