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

# Every command has its manual page.
"$place/bin/fovea" help | awk '/^  [a-z]/ && $1 != "help" { print $1 }' | while read -r command; do
    grep -q '^.TH FOVEA' "$place/share/man/man1/fovea-$command.1" || { echo "fovea $command has no manual page"; exit 1; }
done
grep -q '^.TH FOVEA 1' "$place/share/man/man1/fovea.1"

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
# Messages as JSON, by the library that needs nothing of the runtime.
cat >"$place/json.c" <<'C'
#include <stdio.h>
#include <string.h>
#include <fovea/messages.h>

int main(void)
{
    uint8_t data[8 + 26] = {0};
    char text[256];
    size_t length;
    struct fovea_error error;
    if (fovea_message_json(data, sizeof data, text, sizeof text, &length, &error) != FOVEA_ERROR_INPUT) return 1;
    if (fovea_message_type(data, sizeof data) != NULL) return 1;
    return strstr(error.text, "no known type") != NULL ? 0 : 1;
}
C
# shellcheck disable=SC2046
${CC:-cc} -Wall -Wextra -Werror -o "$place/json" "$place/json.c" $(pkg-config --cflags --libs fovea-messages)
LD_LIBRARY_PATH="$place/lib" "$place/json"
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
