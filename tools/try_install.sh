#!/bin/sh
# Install into a folder of the build, and use what is there as a stranger's program would: shared and static library by
# pkg-config, headers, the command.
# Usage: tools/try_install.sh [BUILD]
set -eu
cd "$(dirname "$0")/.."
build=${1:-build}
place=$PWD/$build/installed
rm -rf "$place" && mkdir -p "$place"
make --no-print-directory BUILD="$build" PREFIX="$place" install >/dev/null
# A package is made the same way, with DESTDIR before the prefix.
make --no-print-directory BUILD="$build" PREFIX=/usr DESTDIR="$place/package" install >/dev/null
[ -x "$place/package/usr/bin/fovea" ]
grep -qx 'prefix=/usr' "$place/package/usr/lib/pkgconfig/fovea.pc"
rm -rf "$place/package"

cat >"$place/user.c" <<'C'
#include <fovea/fovea.h>
#include <stdio.h>
#include <stdlib.h>

int main(void)
{
    struct fovea_config config;
    struct fovea_error error;
    struct fovea_inputs inputs = {0};
    struct fovea_outputs outputs;
    struct fovea *rt;
    size_t bytes;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){.width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 320, .cy = 240};
    if (fovea_camera_prepare(&config.rig.cameras[0].camera, &error) != FOVEA_OK) return 1;
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) return 1;
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    if (fovea_init(memory, bytes, &config, &rt, &error) != FOVEA_OK) return 1;
    if (fovea_step(rt, &inputs, &outputs) != FOVEA_AGAIN) return 1;
    printf("%zu bytes, kernels %s\n", bytes, fovea_cpu_name(rt));
    free(memory);
    return 0;
}
C
# Exactly the functions of the headers that are installed are in the library (check_symbols.sh), which has one version everywhere.
version=$(sed -n 's/^#define FOVEA_VERSION "\(.*\)"/\1/p' "$place/include/fovea/fovea.h")
soname=$(readelf -d "$place/lib/libfovea.so" | sed -n 's/.*SONAME.*\[\(.*\)\]/\1/p')
[ -f "$place/lib/libfovea.so.$version" ] || { echo "no libfovea.so.$version is installed"; exit 1; }
[ "$(readlink -f "$place/lib/$soname")" = "$(readlink -f "$place/lib/libfovea.so.$version")" ] || {
    echo "the soname $soname does not lead to libfovea.so.$version"; exit 1; }
[ "$("$place/bin/fovea" --version)" = "fovea $version" ] || { echo "fovea --version is not $version"; exit 1; }
grep -qx "Version: $version" "$place/lib/pkgconfig/fovea.pc" || { echo "fovea.pc is not of version $version"; exit 1; }
grep -m 1 '^## ' CHANGELOG.md | grep -q "^## $version" || { echo "CHANGELOG.md does not begin with version $version"; exit 1; }

# Every program and command has its manual page.
for program in fovea fovea-calibrate; do
    [ -x "$place/bin/$program" ] || continue
    { echo; "$place/bin/$program" help | awk '/^  [a-z]/ && $1 != "help" { print "-" $1 }'; } | while read -r command; do
        grep -q '^.TH FOVEA' "$place/share/man/man1/$program$command.1" || { echo "$program$command has no manual page"; exit 1; }
    done
done

export PKG_CONFIG_PATH="$place/lib/pkgconfig"
# shellcheck disable=SC2046
${CC:-cc} -Wall -Wextra -Werror -o "$place/shared" "$place/user.c" $(pkg-config --cflags --libs fovea)
LD_LIBRARY_PATH="$place/lib" "$place/shared"
cat >"$place/user.cpp" <<'C'
#include <fovea/fovea.h>

int main()
{
    fovea_config config;
    fovea_error error;
    size_t bytes;
    fovea_config_default(&config);
    return fovea_size(&config, &bytes, &error) == FOVEA_ERROR_ARGUMENT ? 0 : 1; /* it has no camera */
}
C
# shellcheck disable=SC2046
${CXX:-c++} -Wall -Wextra -Werror -o "$place/from-c++" "$place/user.cpp" $(pkg-config --cflags --libs fovea)
LD_LIBRARY_PATH="$place/lib" "$place/from-c++"
# Any message as JSON and field by field, by the library that needs nothing of the runtime: all those of a recording.
cat >"$place/json.c" <<'C'
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <fovea/fields.h>

static size_t number(const uint8_t *at)
{
    return (size_t)at[0] << 24 | (size_t)at[1] << 16 | (size_t)at[2] << 8 | at[3];
}

/* One message: its channel, its JSON, and the fields that hold a stamp's time. */
static int print(const char *channel, const uint8_t *data, size_t bytes)
{
    struct fovea_error error;
    struct fovea_fields fields;
    struct fovea_field field;
    size_t length = 0;
    if (fovea_message_json(data, bytes, NULL, 0, &length, &error) != FOVEA_OK)
        return fprintf(stderr, "%s: %s\n", channel, error.text), 1;
    char *text = malloc(length + 1);
    if (text == NULL || fovea_message_json(data, bytes, text, length + 1, &length, &error) != FOVEA_OK) return 1;
    printf("{\"channel\": \"%s\", \"message\": %s", channel, text);
    free(text);
    if (fovea_fields_begin(&fields, data, bytes) != FOVEA_OK) return 1;
    enum fovea_status status;
    while ((status = fovea_fields_next(&fields, &field)) == FOVEA_OK)
        if (strcmp(field.path, "stamp.time_ns") == 0)
            printf(", \"time_ns\": %lld, \"time_s\": %.9g", (long long)fovea_field_integer(&field, 0),
                   1e-9 * fovea_field_number(&field, 0));
    puts("}");
    return status == FOVEA_END ? 0 : 1;
}

int main(int count, char **arguments)
{
    FILE *log = fopen(arguments[count - 1], "rb");
    uint8_t head[28];
    char channel[64];
    while (log != NULL && fread(head, sizeof head, 1, log) == 1) {
        const size_t channel_bytes = number(head + 20), bytes = number(head + 24);
        uint8_t *data = malloc(bytes);
        if (data == NULL || channel_bytes >= sizeof channel || fread(channel, channel_bytes, 1, log) != 1) return 1;
        channel[channel_bytes] = '\0';
        if (fread(data, bytes, 1, log) != 1 || print(channel, data, bytes) != 0) return 1;
        data[0] ^= 1; /* of no known type any more */
        struct fovea_error error;
        size_t length;
        if (fovea_message_json(data, bytes, NULL, 0, &length, &error) != FOVEA_ERROR_INPUT) return 1;
        if (fovea_message_type(data, bytes) != NULL) return 1;
        free(data);
    }
    return log != NULL ? 0 : 1;
}
C
# shellcheck disable=SC2046
${CC:-cc} -Wall -Wextra -Werror -o "$place/json" "$place/json.c" $(pkg-config --cflags --libs fovea-messages)
"$place/bin/fovea" run --quiet --source 'sim:orbit?imu=200' --frames 6 --set lcm_url= --record "$place/run.lcm" --picture none
LD_LIBRARY_PATH="$place/lib" "$place/json" "$place/run.lcm" >"$place/run.json"
python3 - "$place/run.json" <<'PYTHON'
import json, sys
found = {}
for line in open(sys.argv[1]):
    event = json.loads(line)
    found[event["channel"]] = event["message"]["type"]
    if "stamp" in event["message"]:
        assert event["time_ns"] == event["message"]["stamp"]["time_ns"], event
        assert abs(event["time_s"] - 1e-9 * event["time_ns"]) < 1e-6, event
for channel, expected in (("RECORDING", "recording_t"), ("FRAME", "frame_t"), ("IMU", "imu_t"), ("POSE", "pose_t"),
                          ("STATISTICS", "statistics_t"), ("RECORDING_END", "recording_end_t")):
    if found.get("FOVEA_" + channel) != "fovea." + expected:
        sys.exit("FOVEA_%s: found %s, expected fovea.%s" % (channel, found.get("FOVEA_" + channel), expected))
PYTHON
LD_LIBRARY_PATH="$place/lib" ldd "$place/json" | grep -q 'libfovea\.so' && { echo "libfovea-messages needs libfovea"; exit 1; }
mkdir "$place/static-only" && cp "$place/lib/libfovea.a" "$place/static-only"
# shellcheck disable=SC2046
${CC:-cc} -Wall -Wextra -Werror -o "$place/static" "$place/user.c" -L"$place/static-only" \
    $(pkg-config --static --cflags --libs fovea | sed "s|-L$place/lib||")
"$place/static"
ldd "$place/static" | grep -q libfovea && { echo "the static trial is linked with the shared library"; exit 1; }
"$place/bin/fovea" config >"$place/fovea.yaml"
"$place/bin/fovea" config --check "$place/fovea.yaml"
[ -f "$place/share/fovea/lcmtypes/fovea_pose_t.lcm" ]
echo "install: ok"
