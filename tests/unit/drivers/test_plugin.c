/* A plug-in is loaded only where nobody but root and the user can change it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "../drivers/plugin.h"
#include "common/datasets.h"

static char folder[] = "/tmp/fovea_plugin_XXXXXX"; /* in a sticky folder */
static char parent[64], inner[80], file[96];

static int set_up(void **state)
{
    (void)state;
    snprintf(parent, sizeof parent, "%s/parent", folder);
    snprintf(inner, sizeof inner, "%s/inner", parent);
    snprintf(file, sizeof file, "%s/plugin.so", inner);
    if (mkdir(parent, 0755) != 0 || mkdir(inner, 0755) != 0) return -1;
    fv_test_write_text(file, "no library");
    return chmod(file, 0644);
}

static int tear_down(void **state)
{
    (void)state;
    fv_test_folder_remove(parent);
    return 0;
}

static enum fovea_status trusted(const char *path, struct fovea_error *error)
{
    char found[FV_PLUGIN_PATH_BYTES];
    snprintf(found, sizeof found, "%s", path);
    const enum fovea_status status = fv_plugin_trusted(found, error);
    if (status == FOVEA_OK) assert_string_equal(found, file); /* not the link that leads there */
    return status;
}

static void refused(const char *path, const char *words)
{
    struct fovea_error error = {.text = ""};
    assert_int_equal(trusted(path, &error), FOVEA_ERROR_UNSUPPORTED);
    if (strstr(error.text, words) == NULL)
        fail_msg("found \"%s\", expected \"%s\"", error.text, words);
}

static void test_what_others_can_write_is_not_loaded(void **state)
{
    const struct {
        const char *path;
        mode_t mode, refused;
    } rows[] = {{file, 0644, 0666},  {file, 0644, 0664},   {inner, 0755, 0777},
                {inner, 0755, 0775}, {parent, 0755, 0757}, {folder, 0700, 0777}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char words[160];
        assert_int_equal(trusted(file, NULL), FOVEA_OK);
        chmod(rows[i].path, rows[i].refused);
        snprintf(words, sizeof words, "%s: found mode %03o", rows[i].path,
                 (unsigned)rows[i].refused);
        refused(file, words);
        chmod(rows[i].path, rows[i].mode);
    }
    chmod(inner, 01777); /* sticky: nobody replaces what others own */
    assert_int_equal(trusted(file, NULL), FOVEA_OK);
    refused("/tmp/fovea_plugin_none.so", "cannot be looked at");
}

static void test_links_are_followed_to_where_they_lead(void **state)
{
    char link[64];
    (void)state;
    snprintf(link, sizeof link, "%s/link.so", folder);
    assert_int_equal(symlink(file, link), 0);
    assert_int_equal(trusted(link, NULL), FOVEA_OK);
    chmod(inner, 0777);
    refused(link, "found mode 777");
    chmod(inner, 0755);
    chmod(folder, 0777); /* others may lead the link elsewhere */
    refused(link, "found mode 777");
    chmod(folder, 0700);
    unlink(link);
}

static void test_the_owner_is_root_or_the_user(void **state)
{
    (void)state;
    if (geteuid() != 0) {
        print_message("SKIPPED files of other owners: not root\n");
        skip();
    }
    assert_int_equal(chown(inner, 12345, 12345), 0);
    refused(file, "found the owner 12345, expected root or the user 0");
}

static void test_such_a_plugin_is_not_opened(void **state)
{
    const struct fv_plugin_name name = {.scheme = "trial", .file = "plugin.so", .symbol = "none"};
    const void *table;
    struct fovea_error error = {.text = ""};
    (void)state;
    setenv("FOVEA_PLUGINS", inner, 1);
    chmod(inner, 0777);
    assert_int_equal(fv_plugin_load(&name, &table, &error), FOVEA_ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "found mode 777"));
    chmod(inner, 0755);
    assert_int_equal(fv_plugin_load(&name, &table, &error), FOVEA_ERROR_UNSUPPORTED);
    assert_null(strstr(error.text, "found mode"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_what_others_can_write_is_not_loaded, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(test_links_are_followed_to_where_they_lead, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(test_the_owner_is_root_or_the_user, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_such_a_plugin_is_not_opened, set_up, tear_down),
    };
    if (mkdtemp(folder) == NULL) return 1;
    const int failed = cmocka_run_group_tests_name("unit/drivers/test_plugin", tests, NULL, NULL);
    rmdir(folder);
    return failed;
}
