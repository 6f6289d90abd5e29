/* Keys that Fovea 0.1 had under another name. None of them works: an error names the key of now.
 * Init-only. */
#ifndef FOVEA_APP_CONFIG_SETTINGS_RENAMED_H
#define FOVEA_APP_CONFIG_SETTINGS_RENAMED_H

/* The name now of the key or section `name` of 0.1; NULL: 0.1 had no such name, or has it still. */
const char *fv_settings_renamed(const char *name);

/* The same of the value `value` of the key `key`. */
const char *fv_settings_renamed_value(const char *key, const char *value);

#endif
