/* The manual of the configuration, of the table of keys: docs/configuration.md and a section of
 * fovea-config(1). */
#include <stdlib.h>
#include <string.h>

#include "support/man.h"
#include "app/config/settings.h"

static const char head[] =
    "# Configuration\n"
    "\n"
    "Made from `src/runtime/config.def` by `make docs`: edit that file, not this one.\n"
    "\n"
    "`fovea run` and `fovea check` read one YAML file, given as `--config FILE`. Any key may be left out. A value comes from the\n"
    "last of these that names the key: the default, the file, `parameters.file`, an option of the command such as `--source`, `--set key=value`.\n"
    "`fovea config` prints a file with every key, its default and its explanation; `fovea config --check FILE` checks a file and\n"
    "those that it names. A wrong value is refused in one line with the file, the line, the key, the value and what was expected.\n"
    "Programs that use the library set members of the same names in `struct fovea_config` (`include/fovea/fovea.h`), which\n"
    "`fovea_size` and `fovea_init` check against the same ranges; keys of files, messages and the loop belong to the command alone.\n"
    "The file is read before the first frame, and again on a service's reload. Keys marked (live) are parameters that can change during the run: by a\n"
    "message (`parameter_t`, see messages.md; `tools/subscribers/command.py features.threshold=30` sends one,\n"
    "`features.threshold=` asks for the value; the page of `fovea-web` does both), or with the inputs of\n"
    "the C call `fovea_step`. A change holds from the next step on, is answered, and recordings keep it. A value for which the run was started without memory is refused: more features or\n"
    "detections than at the start, a job that was off, operations where there were none.\n";

/* A bar would end the cell of the table. */
static void cell(FILE *file, const char *text)
{
    for (; *text != '\0'; text++) {
        if (*text == '|') fputc('\\', file);
        fputc(*text, file);
    }
}

static void row(FILE *file, const struct fv_settings *settings, const struct fv_settings_key *key)
{
    char range[FV_SETTINGS_RANGE_BYTES], *value = fv_settings_value_text(settings, key);
    fv_settings_range_print(key, range, sizeof range);
    fprintf(file, "| `%s`%s | ", key->name, key->live ? " (live)" : "");
    cell(file, range);
    fprintf(file, " | `");
    cell(file, value != NULL ? value : "");
    fprintf(file, "` | ");
    cell(file, key->help);
    if (key->cost != NULL) {
        fprintf(file, ". Cost: ");
        cell(file, key->cost);
    }
    fprintf(file, " |\n");
    free(value);
}

void fv_settings_markdown(FILE *file, const struct fv_settings *settings)
{
    const char *section = NULL;
    size_t section_length = 0;
    fputs(head, file);
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        const char *dot = strchr(key->name, '.');
        const size_t length = dot != NULL ? (size_t)(dot - key->name) : 0;
        if (section == NULL || length != section_length ||
            strncmp(section, key->name, length) != 0) {
            if (length == 0)
                fprintf(file, "\n## Source, messages and recording\n\n");
            else
                fprintf(file, "\n## %.*s\n\n", (int)length, key->name);
            fprintf(file, "| key | values | default | meaning |\n| --- | --- | --- | --- |\n");
        }
        section = key->name;
        section_length = length;
        row(file, settings, key);
    }
}

void fv_settings_man(const struct fv_settings *settings)
{
    fv_man_section("KEYS");
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        char range[FV_SETTINGS_RANGE_BYTES];
        fv_settings_range_print(key, range, sizeof range);
        fv_man_item(key->name, range, key->help);
        if (key->cost != NULL) fv_man_line("Cost: ", key->cost);
        if (key->kind == FV_CONFIG_TRANSFORM) continue; /* a line of brackets says nothing here */
        char *value = fv_settings_value_text(settings, key);
        fv_man_line("Default: ", value != NULL ? value : "");
        free(value);
    }
}
