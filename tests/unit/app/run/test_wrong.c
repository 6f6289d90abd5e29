/* Wrong input of every kind: arguments, configurations, calibrations, folders; made by hand and by
 * mutation. Each must end with status 2 and exactly one line on stderr, which names the file or
 * option and the key. Every case runs in a process of its own, so that under sanitizers a finding
 * shows as another status. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/datasets.h"
#include "app/config/settings.h"
#include "fovea/elementary.h"

enum { TEXT_MAX = 1 << 15, ARGUMENTS_MAX = 24, SECONDS_MAX = 60 };

static char folder[] = "/tmp/fovea_wrong_XXXXXX";
static int cases;

/* ---- running one case ------------------------------------------------------------------------ */

static size_t read_all(int fd, char *text)
{
    size_t used = 0;
    ssize_t got;
    while ((got = read(fd, text + used, TEXT_MAX - 1 - used)) > 0)
        used += (size_t)got;
    text[used] = '\0';
    return used;
}

/* Run the program in a child process; its stderr goes to `text`. Returns the wait status. */
static int run(int argc, char **argv, char *text)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        alarm(SECONDS_MAX);
        dup2(ends[1], STDERR_FILENO);
        close(ends[0]);
        close(ends[1]);
        if (freopen("/dev/null", "w", stdout) == NULL) _exit(99);
        exit(fv_dispatch(argc, argv));
    }
    close(ends[1]);
    read_all(ends[0], text);
    close(ends[0]);
    int status = -1;
    waitpid(child, &status, 0);
    return status;
}

static void replace_folder(const char *from, char *to, size_t bytes)
{
    size_t used = 0;
    for (; *from != '\0' && used + 1 < bytes; from++) {
        if (*from == '@')
            used += (size_t)snprintf(to + used, bytes - used, "%s", folder);
        else
            to[used++] = *from;
    }
    to[used < bytes ? used : bytes - 1] = '\0';
}

/* Words are separated by blanks; '@' is the folder. */
static int words(const char *command, char *line, size_t bytes, char **argv)
{
    int argc = 0;
    replace_folder(command, line, bytes);
    for (char *word = strtok(line, " "); word != NULL && argc < ARGUMENTS_MAX;
         word = strtok(NULL, " "))
        argv[argc++] = word;
    argv[argc] = NULL;
    return argc;
}

static void assert_one_line(const char *what, const char *text)
{
    const char *end = strchr(text, '\n');
    if (end == NULL || end == text || end[1] != '\0')
        fail_msg("%s: not one line: [%s]", what, text);
}

/* `names`: what the line must contain, separated by '|'. */
static void assert_refused(const char *command, const char *names)
{
    static char text[TEXT_MAX];
    char line[4096], wanted[512], *argv[ARGUMENTS_MAX + 1];
    int argc = words(command, line, sizeof line, argv);
    int status = run(argc, argv, text);
    cases++;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != FV_EXIT_WRONG)
        fail_msg("%s: wait status %x: [%s]", command, status, text);
    assert_one_line(command, text);
    replace_folder(names, wanted, sizeof wanted);
    for (char *name = strtok(wanted, "|"); name != NULL; name = strtok(NULL, "|"))
        if (strstr(text, name) == NULL) fail_msg("%s: '%s' is not in [%s]", command, name, text);
}

static void file_write(const char *name, const char *text, size_t bytes)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fwrite(text, 1, bytes, file);
    fclose(file);
}

/* ---- arguments ------------------------------------------------------------------------------- */

static const char *const wrong_arguments[][2] = {
    {"fovea", "no command"},
    {"fovea rnu", "'rnu'|'run'"},
    {"fovea confg", "'confg'|'config'"},
    {"fovea --verion", "--verion"},
    {"fovea help nothing", "nothing"},
    {"fovea run --sorce sim:", "--sorce|--source"},
    {"fovea run --frames", "--frames|value missing"},
    {"fovea run --frames -1", "--frames|'-1'"},
    {"fovea run --frames 0", "--frames|'0'|from 1"},
    {"fovea export --frames 0 @/none", "--frames|'0'|from 1"},
    {"fovea run --source siim:\xc3\xa4", "source|'siim:\xc3\xa4'"},
    {"fovea run --frames ten", "--frames|'ten'"},
    {"fovea run --frames 1e3", "--frames|'1e3'"},
    {"fovea run --frames 99999999999999999999", "--frames|'99999999999999999999'"},
    {"fovea run --start 1.5", "--start|'1.5'"},
    {"fovea run --step 0", "--step|'0'|from 1"},
    {"fovea run --step -2", "--step|'-2'|from 1"},
    {"fovea run --step x", "--step|'x'"},
    {"fovea run --reverse=yes", "--reverse|no value"},
    {"fovea run -z", "'-z'"},
    {"fovea run -frames 5", "'-frames'|nearest is '--frames'"},
    {"fovea run --quiet -zz --frames 3", "'-zz'"},
    {"fovea run --quiet -z --frames 3", "'-z'"},
    {"fovea run sim:", "'sim:'|nothing"},
    {"fovea run --rate fast", "rate|'fast'|auto, max, real"},
    {"fovea run --rate=", "rate|''"},
    {"fovea run --config @/none.yaml", "@/none.yaml"},
    {"fovea run --config @", "@"},
    {"fovea run --stats @/none/stats.json", "--stats|@/none/stats.json"},
    {"fovea run --picture @/none/t.png", "--picture|@/none/t.png"},
    {"fovea run --record @/none/run.log --frames 1 --picture none --set lcm_url=",
     "@/none/run.log"},
    {"fovea run --record @/text.yaml --source lcmlog:@/text.yaml", "--record|@/text.yaml|--source"},
    {"fovea run --set record=@/./text.yaml --config @/text.yaml",
     "--record|@/./text.yaml|--config"},
    {"fovea run --stats @/text.yaml --config @/text.yaml", "--stats|@/text.yaml|--config"},
    {"fovea run --stats @/one --trajectory @/one", "--stats|@/one|--trajectory"},
    {"fovea run --camera @/none.yaml", "@/none.yaml"},
    {"fovea run --camera @/cam0.yaml", "@/cam0.yaml:2: cam0: |'5'|a mapping"},
    {"fovea export --frames 1 @/none/frames", "@/none/frames"},
    {"fovea export --frames 1 @/text.yaml/frames", "@/text.yaml/frames"},
    {"fovea replay @", "@: found a directory"},
    {"fovea run --config @/camera.yaml", "@/camera.yaml:2: camera: |/none/cam.yaml"},
    {"fovea run --config @/record.yaml --frames 1 --picture none",
     "@/record.yaml:1: record: |/none/run.lcm"},
    {"fovea run --set", "--set|value missing"},
    {"fovea run --set seed", "--set|seed"},
    {"fovea run --set sed=1", "--set|sed|'seed'"},
    {"fovea run --set seed=-1", "--set|seed|'-1'"},
    {"fovea run --set features.count_max=9e9", "--set|features.count_max"},
    {"fovea run --set preview.level=7 --set features.pyramid_levels=3", "preview.level|--set"},
    {"fovea run --set lcm_url=http://here --picture none", "lcm_url|http://here"},
    {"fovea run --set lcm_url=udpm://1.2.3.4:7667 --picture none", "lcm_url|1.2.3.4"},
    {"fovea run --set lcm_url=file://@/x.log --picture none", "lcm_url|@/x.log|mode=w"},
    {"fovea run --set lcm_url=udpm://239.255.76.67:7667?ttl=x --picture none",
     "lcm_url|ttl=0 to 255"},
    {"fovea run --set lcm_url=udpm://239.255.76.67:7667?lot=1 --picture none",
     "lcm_url|lot=1|recv_buf_size"},
    {"fovea check --set lcm_url=udpm://:7667", "lcm_url|udpm://:7667"},
    {"fovea run --set lcm_ttl=\"0\"", "lcm_ttl|the text '0'"},
    {"fovea run --set mask=@/none.png --picture none", "mask|@/none.png"},
    {"fovea run --set mask=@/text.yaml --picture none", "mask|@/text.yaml"},
    {"fovea run --source", "--source|value missing"},
    {"fovea run --source nothing", "source|'nothing'"},
    {"fovea run --source :", "source|':'"},
    {"fovea run --source siim:", "source|'siim:'|sim"},
    {"fovea run --source sim:orbt", "orbt|orbit"},
    {"fovea run --source sim:orbit?sed=7", "sed|seed"},
    {"fovea run --source sim:orbit?seed=x", "seed|'x'"},
    {"fovea run --source sim:orbit?width=10", "width|10"},
    {"fovea run --source sim:orbit?width", "width"},
    {"fovea run --source sim:?seed=1&width=320&seed=2", "seed|second time"},
    {"fovea run --source sim:?seed=-1", "seed|[0, 9007199254740992]"},
    {"fovea run --source euroc:", "mav0"},
    {"fovea run --source euroc:@/none", "@/none"},
    {"fovea run --source euroc:@", "@"},
    {"fovea run --source tum:@/none", "@/none"},
    {"fovea run --source tum:@", "@"},
    {"fovea run --source kitti:@/none", "@/none"},
    {"fovea run --source kitti:@", "@"},
    {"fovea run --source images:@/none/*.png", "@/none"},
    {"fovea run --source lcmlog:@/none.log", "@/none.log"},
    {"fovea run --source lcmlog:@/text.yaml", "@/text.yaml"},
    {"fovea check --bnech", "--bnech|--bench"},
    {"fovea check --config @/none.yaml", "@/none.yaml"},
    {"fovea check --source tum:@/none", "@/none"},
    {"fovea check extra", "'extra'"},
    {"fovea config --check", "--check|value missing"},
    {"fovea config --check @/none.yaml", "@/none.yaml"},
    {"fovea config extra", "'extra'"},
    {"fovea config --set lcm_url=udpm://1.2.3.4:7667", "lcm_url|1.2.3.4"},
    {"fovea config --check @/source.yaml", "@/source.yaml:2: source: |'nothing'|sim:"},
    {"fovea run --config @/save.yaml", "@/save.yaml:2: map.save: |/none/run.map"},
    {"fovea run --config @/only.yaml --picture none",
     "@/only.yaml:2: map.localise_only: |map.load"},
    {"fovea config --set T_base_cam=[1,2]", "T_base_cam|12 numbers"},
    {"fovea run --source sim: --set odometry.enabled=false --save-map @/no.map",
     "map.save|@/no.map|odometry.enabled"},
    {"fovea run --source sim: --set odometry.enabled=false --map @/no.map",
     "map.load|@/no.map|odometry.enabled"},
    {"fovea run --source sim: --set odometry.enabled=false --trajectory @/no.tum",
     "--trajectory|odometry.enabled"},
    {"fovea run --source sim: --set odometry.enabled=false --trajectory-final @/no.tum",
     "--trajectory-final|odometry.enabled"},
    {"fovea run --source sim: --map @/no.map --stats @/no.map", "--stats|the file of --map"},
    {"fovea run --source sim: --map @/no.map --save-map @/no.map --picture @/no.map",
     "--picture|@/no.map|--save-map"},
    {"fovea run --source sim: --map @/no.map --trajectory-final @/no.map",
     "--trajectory-final|the file of --map"},
    {"fovea run --stats @/two --trajectory @/./two", "--stats|@/two|--trajectory"},
    {"fovea run --record @/two --set lcm_url=file://@/./two?mode=w", "--record|@/two|lcm_url"},
    {"fovea run --config @/text.yaml --set lcm_url=file://@/text.yaml?mode=a",
     "lcm_url|@/text.yaml|--config"},
    {"fovea run --source lcmlog:@/text.yaml --set lcm_url=file://@/text.yaml?mode=w",
     "lcm_url|@/text.yaml|--source"},
    {"fovea replay @/text.yaml --lcm-url file://@/text.yaml?mode=w",
     "--lcm-url|@/text.yaml|the recording"},
    {"fovea run --config=", "--config|''"},
};

/* Where a file is read: none of these is opened, so none can hang. */
static const char *const readers[][2] = {
    {"fovea run --config %s", "%s"},
    {"fovea config --check %s", "%s"},
    {"fovea run --camera %s", "%s"},
    {"fovea run --map %s", "%s"},
    {"fovea run --model %s", "%s"},
    {"fovea run --set mask=%s", "%s: mask"},
    {"fovea run --source lcmlog:%s", "%s"},
    {"fovea run --source video:%s", "%s|expected a video"},
    {"fovea run --source images:%s", "%s"},
    {"fovea replay %s", "%s"},
    {"fovea features %s", "%s"},
    {"fovea detect --model src/detect/shipped.fvm %s", "%s"},
    {"fovea map info %s", "%s"},
    {"fovea model info %s", "%s"},
};

static void test_pipes_and_devices_as_files(void **state)
{
    static const char *const files[][2] = {{"@/sub/pipe", "a pipe"}, {"/dev/zero", "a device"}};
    char pipe[256];
    (void)state;
    snprintf(pipe, sizeof pipe, "%s/sub", folder);
    assert_int_equal(mkdir(pipe, 0700), 0);
    snprintf(pipe, sizeof pipe, "%s/sub/pipe", folder);
    assert_int_equal(mkfifo(pipe, 0600), 0);
    for (size_t i = 0; i < sizeof readers / sizeof readers[0]; i++)
        for (int k = 0; k < 2; k++) {
            char command[256], names[256];
            const bool video = strstr(readers[i][0], "video") != NULL;
            snprintf(command, sizeof command, readers[i][0], files[k][0]);
            size_t used = (size_t)snprintf(names, sizeof names, readers[i][1], files[k][0]);
            if (!video) snprintf(names + used, sizeof names - used, "|found %s", files[k][1]);
            assert_refused(command, names);
        }
    unlink(pipe);
    *strrchr(pipe, '/') = '\0';
    rmdir(pipe);
}

/* An option's error names that option, not the key's. */
static void test_paths_that_are_too_long(void **state)
{
    static const char *const options[] = {"--save-map", "--map", "--model", "--record", "--camera"};
    char command[2048], names[64];
    (void)state;
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
        size_t used = (size_t)snprintf(command, sizeof command, "fovea run %s /", options[i]);
        memset(command + used, 'a', 1200);
        command[used + 1200] = '\0';
        snprintf(names, sizeof names, "%s: found 1201 bytes, expected at most 1023", options[i]);
        assert_refused(command, names);
    }
    assert_refused("fovea run --rate fast", "--rate: found");
}

/* What the path looks like is named. */
static void test_a_data_set_of_another_kind(void **state)
{
    static const char *const commands[][2] = {
        {"fovea run --source tum:@/set", "; this looks like euroc:@/set"},
        {"fovea export --source kitti:@/set @/out", "; this looks like euroc:@/set"},
        {"fovea run --source lcmlog:@/set", "; this looks like euroc:@/set"},
        {"fovea run --source euroc:@/set/log", "; this looks like lcmlog:@/set/log"},
        {"fovea run --source images:@/set", "; this looks like euroc:@/set"},
        {"fovea run --source images:@/set/log", "; this looks like lcmlog:@/set/log"},
        {"fovea run --source video:@/set", "; this looks like euroc:@/set"},
        {"fovea run --source tum:@/set/mav0/cam0/data",
         "; this looks like images:@/set/mav0/cam0/data"},
    };
    char path[256];
    (void)state;
    static const char *const folders[] = {"set", "set/mav0", "set/mav0/cam0", "set/mav0/cam0/data"};
    for (int i = 0; i < 4; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, folders[i]);
        assert_int_equal(mkdir(path, 0700), 0);
    }
    file_write("set/mav0/cam0/data.csv", "#\n", 2);
    file_write("set/mav0/cam0/data/1.PNG", "", 0);
    file_write("set/log", "\xED\xA1\xDA\x01", 4);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
        assert_refused(commands[i][0], commands[i][1]);
    snprintf(path, sizeof path, "%s/set", folder);
    fv_test_folder_remove(path);
}

/* `config --check` opens what a configuration names. */
static void test_the_files_of_a_configuration(void **state)
{
    static const char *const files[][2] = {
        {"camera: /none.yaml\n", "@/files.yaml:1: camera: /none.yaml"},
        {"mask: /none.png\n", "@/files.yaml:1: mask: /none.png"},
        {"map: {load: /none.map}\n", "@/files.yaml:1: map.load: /none.map"},
        {"map: {load: tests/golden/decoders.txt}\n", "@/files.yaml:1: map.load:"},
        {"detect: {model: /none.fvm}\n", "@/files.yaml:1: detect.model: /none.fvm"},
        {"source: 'tum:/none'\n", "@/files.yaml:1: source: /none"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        file_write("files.yaml", files[i][0], strlen(files[i][0]));
        assert_refused("fovea config --check @/files.yaml", files[i][1]);
    }
    file_write("lite.tflite", "\x1c\0\0\0TFL3....", 12);
    assert_refused("fovea run --model @/lite.tflite",
                   "@/lite.tflite: found a TensorFlow Lite model|tools/import @/lite.tflite");
}

/* A file that is too large is refused before it is read. */
static void test_files_over_their_limit(void **state)
{
    static const char *const commands[] = {
        "fovea run --config @/large", "fovea run --camera @/large",   "fovea run --map @/large",
        "fovea run --model @/large",  "fovea run --set mask=@/large", "fovea features @/large"};
    char path[256];
    (void)state;
    snprintf(path, sizeof path, "%s/large", folder);
    file_write("large", "", 0);
    assert_int_equal(truncate(path, (off_t)1 << 40), 0);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++)
        assert_refused(commands[i], "@/large|found 1099511627776 bytes, expected at most");
    unlink(path);
}

static void test_arguments(void **state)
{
    (void)state;
    static const char camera[] = "seed: 1\ncamera: /none/cam.yaml\n",
                      record[] = "record: /none/run.lcm\nlcm_url: ''\n",
                      source[] = "seed: 1\nsource: nothing\n",
                      save[] = "map:\n  save: /none/run.map\n",
                      only[] = "map:\n  localise_only: true\n";
    file_write("text.yaml", "seed: 1\n", 8);
    file_write("camera.yaml", camera, sizeof camera - 1);
    file_write("record.yaml", record, sizeof record - 1);
    file_write("cam0.yaml", "# one\ncam0: 5\n", 14);
    file_write("source.yaml", source, sizeof source - 1);
    file_write("save.yaml", save, sizeof save - 1);
    file_write("only.yaml", only, sizeof only - 1);
    for (size_t i = 0; i < sizeof wrong_arguments / sizeof wrong_arguments[0]; i++)
        assert_refused(wrong_arguments[i][0], wrong_arguments[i][1]);
}

/* ---- configurations -------------------------------------------------------------------------- */

static const char *const wrong_values[] = {"",          "~",     "[1, 2]", "{a: 1}",
                                           "\"\\x01\"", "1e400", "0x10",   "12 apples"};

/* Every key with every value that is wrong for its kind. */
static void test_wrong_values(void **state)
{
    (void)state;
    for (size_t k = 0; k < fv_settings_key_count; k++) {
        const struct fv_settings_key *key = &fv_settings_keys[k];
        const char *dot = strchr(key->name, '.');
        for (size_t v = 0; v < sizeof wrong_values / sizeof wrong_values[0]; v++) {
            char text[512], names[256];
            if (key->kind == FV_CONFIG_TEXT && (v < 2 ? v == 99 : v > 3))
                continue; /* other scalars are texts */
            int bytes = dot != NULL
                            ? snprintf(text, sizeof text, "# a comment\n%.*s:\n  %s: %s\n",
                                       (int)(dot - key->name), key->name, dot + 1, wrong_values[v])
                            : snprintf(text, sizeof text, "# a comment\n%s: %s\n", key->name,
                                       wrong_values[v]);
            file_write("value.yaml", text, (size_t)bytes);
            snprintf(names, sizeof names, "@/value.yaml:%d:|%s", dot != NULL ? 3 : 2, key->name);
            assert_refused("fovea config --check @/value.yaml", names);
        }
    }
}

/* Every key misspelt by a swap of neighbours, and given twice. */
static void test_wrong_keys(void **state)
{
    (void)state;
    for (size_t k = 0; k < fv_settings_key_count; k++) {
        const struct fv_settings_key *key = &fv_settings_keys[k];
        const char *dot = strchr(key->name, '.'), *leaf = dot != NULL ? dot + 1 : key->name;
        char section[64] = "", swapped[64], text[512], names[256];
        const char *indent = dot != NULL ? "  " : "";
        if (dot != NULL)
            snprintf(section, sizeof section, "%.*s:\n", (int)(dot - key->name), key->name);
        snprintf(swapped, sizeof swapped, "%s", leaf);
        size_t at = leaf[0] == leaf[1] ? 1 : 0;
        swapped[at] = leaf[at + 1];
        swapped[at + 1] = leaf[at];
        int bytes = snprintf(text, sizeof text, "%s%s%s: 1\n", section, indent, swapped);
        file_write("key.yaml", text, (size_t)bytes);
        snprintf(names, sizeof names, "@/key.yaml:%d:|%s|'%s'", dot != NULL ? 2 : 1, swapped,
                 key->name);
        assert_refused("fovea config --check @/key.yaml", names);
        bytes = snprintf(text, sizeof text, "%s%s%s: 1\n%s%s: 1\n", section, indent, leaf, indent,
                         leaf);
        file_write("key.yaml", text, (size_t)bytes);
        snprintf(names, sizeof names, "@/key.yaml:%d:|%s|each key once", dot != NULL ? 3 : 2, leaf);
        assert_refused("fovea config --check @/key.yaml", names);
    }
}

/* A valid file with bytes changed, removed or doubled: fine or refused in one line that names the
 * file, never else. */
static void mutate(struct fovea_random *random, char *text, size_t *bytes)
{
    uint32_t changes = 1 + fovea_random_below(random, 4);
    for (uint32_t i = 0; i<changes && * bytes> 2; i++) {
        size_t at = fovea_random_below(random, (uint32_t)*bytes - 1);
        uint32_t kind = fovea_random_below(random, 4);
        if (kind == 0) {
            text[at] = (char)fovea_random_below(random, 256);
        } else if (kind == 1) {
            memmove(text + at, text + at + 1, *bytes - at - 1);
            (*bytes)--;
        } else if (kind == 2) {
            text[at] = ":#-[]{}\"'&*!|>%@`,\n\t 0.9"[fovea_random_below(random, 24)];
        } else {
            *bytes = at + 1;
        }
    }
}

static void assert_fine_or_refused(const char *command, const char *name, int turn)
{
    static char text[TEXT_MAX];
    char line[1024], wanted[256], *argv[ARGUMENTS_MAX + 1];
    int argc = words(command, line, sizeof line, argv);
    int status = run(argc, argv, text);
    cases++;
    replace_folder(name, wanted, sizeof wanted);
    if (WIFEXITED(status) && WEXITSTATUS(status) == FV_EXIT_OK) return;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != FV_EXIT_WRONG)
        fail_msg("turn %d of %s: wait status %x: [%s]", turn, command, status, text);
    assert_one_line(command, text);
    if (strstr(text, wanted) == NULL)
        fail_msg("turn %d of %s: '%s' is not in [%s]", turn, command, wanted, text);
}

static void test_mutated_configurations(void **state)
{
    (void)state;
    enum { TURNS = 120 };
    static struct fv_settings settings;
    char *valid = NULL;
    size_t valid_bytes = 0;
    fv_settings_default(&settings);
    FILE *file = open_memstream(&valid, &valid_bytes);
    fv_settings_print(file, &settings, false);
    fclose(file);
    struct fovea_random random;
    fovea_random_seed(&random, 11);
    for (int turn = 0; turn < TURNS; turn++) {
        char *text = malloc(valid_bytes);
        size_t bytes = valid_bytes;
        memcpy(text, valid, bytes);
        mutate(&random, text, &bytes);
        file_write("mutated.yaml", text, bytes);
        free(text);
        assert_fine_or_refused("fovea config --check @/mutated.yaml", "@/mutated.yaml", turn);
    }
    free(valid);
}

/* ---- calibrations ---------------------------------------------------------------------------- */

static const char calibration[] = "image_width: 640\n"
                                  "image_height: 480\n"
                                  "camera_name: cam\n"
                                  "camera_matrix:\n"
                                  "  rows: 3\n"
                                  "  cols: 3\n"
                                  "  data: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0]\n"
                                  "distortion_model: plumb_bob\n"
                                  "distortion_coefficients:\n"
                                  "  rows: 1\n"
                                  "  cols: 5\n"
                                  "  data: [-0.28, 0.07, 0.0002, 0.00002, 0.0]\n";

static const char *const wrong_calibrations[][3] = {
    /* what stands in the file, what is put there, what the line must name */
    {"image_width: 640", "image_width: 641", "cam.yaml|641"},
    {"image_width: 640", "image_width: wide", "cam.yaml:1:|image_width|'wide'"},
    {"image_width: 640", "image_width: -640", "cam.yaml:1:|image_width|'-640'"},
    {"image_height: 480", "image_height: 0", "cam.yaml:2:|image_height"},
    {"[500.0, 0.0, 320.0", "[-500.0, 0.0, 320.0", "cam.yaml"},
    {"[500.0, 0.0, 320.0", "[0.0, 0.0, 320.0", "cam.yaml"},
    {"[500.0, 0.0, 320.0", "[500.0, 0.0, 32000.0", "cam.yaml"},
    {"[500.0, 0.0, 320.0", "[.nan, 0.0, 320.0", "cam.yaml:7:|camera_matrix.data[0]|'.nan'"},
    {"[500.0, 0.0, 320.0", "[500.0, 320.0", "cam.yaml:7:|camera_matrix.data|9"},
    {"camera_matrix:", "camera_matrx:", "cam.yaml|camera_matrix"},
    {"plumb_bob", "thin_prism", "cam.yaml:8:|distortion_model|'thin_prism'"},
    {"-0.28, 0.07", "-0.28, many", "cam.yaml:12:|distortion_coefficients.data[1]|'many'"},
    {"-0.28, 0.07, ", "-0.28, ", "cam.yaml:12:|distortion_coefficients"},
    {"-0.28, 0.07", "-0.28, 1e999", "cam.yaml:12:|distortion_coefficients.data[1]"},
    {"image_height", "image_width", "cam.yaml:2:|image_width|each key once"},
};

static void test_calibrations(void **state)
{
    (void)state;
    const char *command =
        "fovea run --camera @/cam.yaml --frames 1 --picture none --set lcm_url= --set loop.priority=0";
    static char text[TEXT_MAX];
    char line[1024], *argv[ARGUMENTS_MAX + 1];
    file_write("cam.yaml", calibration, sizeof calibration - 1);
    int argc = words(command, line, sizeof line, argv);
    int status = run(argc, argv, text);
    if (status != 0) fail_msg("the valid calibration: wait status %x: [%s]", status, text);
    for (size_t i = 0; i < sizeof wrong_calibrations / sizeof wrong_calibrations[0]; i++) {
        char changed[2048];
        const char *at = strstr(calibration, wrong_calibrations[i][0]);
        assert_non_null(at);
        int bytes =
            snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - calibration), calibration,
                     wrong_calibrations[i][1], at + strlen(wrong_calibrations[i][0]));
        file_write("cam.yaml", changed, (size_t)bytes);
        assert_refused(command, wrong_calibrations[i][2]);
    }
    struct fovea_random random;
    fovea_random_seed(&random, 5);
    for (int turn = 0; turn < 60; turn++) {
        char changed[sizeof calibration];
        size_t bytes = sizeof calibration - 1;
        memcpy(changed, calibration, sizeof calibration);
        mutate(&random, changed, &bytes);
        file_write("cam.yaml", changed, bytes);
        assert_fine_or_refused(command, "@/cam.yaml", turn);
    }
}

/* ---- what an earlier run has left ------------------------------------------------------------ */

static void assert_kept(const char *name)
{
    char path[256], found[16] = "";
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    const size_t bytes = fread(found, 1, sizeof found - 1, file);
    fclose(file);
    if (bytes != 4 || strcmp(found, "kept") != 0)
        fail_msg("%s: found [%s], expected what stood there", name, found);
}

/* One wrong word costs nobody the results of yesterday, and leaves no empty file behind. */
static void test_results_are_kept(void **state)
{
    static const char *const results[] = {"record", "trajectory", "trajectory-final", "detections",
                                          "tracks", "stats",      "picture"};
    static const char *const wrong[][2] = {
        {"--trajectory @/none/x", "@/none/x"},
        {"--trajectory-final @/none/x", "@/none/x"},
        {"--tracks @/none/x", "@/none/x"},
        {"--record @/none/x", "@/none/x"},
        {"--set lcm_url=udpm://239.255.76.67:0", "lcm_url"},
        {"--set lcm_url=file://@/none/x?mode=w", "lcm_url|@/none/x"},
        {"--trajectory=", "--trajectory|''"},
        {"--trajectory-final=", "--trajectory-final|''"},
        {"--tracks=", "--tracks|''"},
        {"--stats=", "--stats|''"},
    };
    static const char small[] =
        "image_width: 96\nimage_height: 64\nK: [80, 0, 48, 0, 81, 32, 0, 0, 1]\nD: [0, 0, 0, 0]\n";
    (void)state;
    char linked_to[256], link[256];
    const char *images = fv_test_images(folder); /* quicker to open than a simulated world */
    file_write("cam.yaml", small, sizeof small - 1);
    file_write("kept", "kept", 4);
    snprintf(linked_to, sizeof linked_to, "%s/linked", folder);
    snprintf(link, sizeof link, "%s/link", folder);
    assert_int_equal(symlink("linked", link), 0);
    for (size_t i = 0; i < sizeof results / sizeof results[0]; i++)
        for (size_t j = 0; j < sizeof wrong / sizeof wrong[0]; j++) {
            char command[512], unmade[256];
            if (strncmp(wrong[j][0] + 2, results[i], strcspn(wrong[j][0], " =") - 2) == 0) continue;
            static const char *const names[] = {"unmade", "kept", "link"};
            for (int k = 0; k < 3; k++) {
                snprintf(
                    command, sizeof command,
                    "fovea run --source images:@/images --camera @/cam.yaml --frames 1 --model src/detect/shipped.fvm --picture none --%s @/%s %s",
                    results[i], names[k], wrong[j][0]);
                assert_refused(command, wrong[j][1]);
            }
            assert_kept("kept");
            if (access(linked_to, F_OK) == 0) fail_msg("%s: made the file of a link", command);
            snprintf(unmade, sizeof unmade, "%s/unmade", folder);
            if (access(unmade, F_OK) == 0) fail_msg("%s: left an empty file", command);
        }
    fv_test_folder_remove(images);
}

/* `fovea check` asks whether the log of LCM can be written and leaves it as it is, or unmade. */
static void test_check_keeps_the_log(void **state)
{
    static const char *const commands[] = {
        "fovea check --set lcm_url=file://@/kept?mode=w",
        "fovea check --memory-only --set lcm_url=file://@/kept?mode=w",
        "fovea check --bench --source sim:still?frames=31 --set lcm_url=file://@/unmade?mode=w",
        "fovea check --set lcm_url=file://@/unmade?mode=a"};
    static char text[TEXT_MAX];
    char line[1024], unmade[256], *argv[ARGUMENTS_MAX + 1];
    (void)state;
    file_write("kept", "kept", 4);
    snprintf(unmade, sizeof unmade, "%s/unmade", folder);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        const int argc = words(commands[i], line, sizeof line, argv),
                  status = run(argc, argv, text);
        if (status != 0) fail_msg("%s: wait status %x: [%s]", commands[i], status, text);
        assert_kept("kept");
        if (access(unmade, F_OK) == 0) fail_msg("%s: made the file", commands[i]);
    }
}

static void test_there_were_enough(void **state)
{
    (void)state;
    print_message("%d wrong inputs\n", cases);
    assert_true(cases >= 200);
}

static int folder_make(void **state)
{
    (void)state;
    return mkdtemp(folder) == NULL;
}

static int folder_remove(void **state)
{
    (void)state;
    fv_test_folder_remove(folder);
    return access(folder, F_OK) == 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_arguments),
        cmocka_unit_test(test_pipes_and_devices_as_files),
        cmocka_unit_test(test_files_over_their_limit),
        cmocka_unit_test(test_paths_that_are_too_long),
        cmocka_unit_test(test_a_data_set_of_another_kind),
        cmocka_unit_test(test_the_files_of_a_configuration),
        cmocka_unit_test(test_wrong_values),
        cmocka_unit_test(test_wrong_keys),
        cmocka_unit_test(test_mutated_configurations),
        cmocka_unit_test(test_calibrations),
        cmocka_unit_test(test_results_are_kept),
        cmocka_unit_test(test_check_keeps_the_log),
        cmocka_unit_test(test_there_were_enough),
    };
    return cmocka_run_group_tests(tests, folder_make, folder_remove);
}
