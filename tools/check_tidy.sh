#!/bin/sh
# clang-tidy over our sources with the checks of .clang-tidy; any finding fails. One file at a time: with several,
# clang-tidy 14 takes every va_list after the first file for uninitialised. Files that were clean before and whose
# preprocessed text is the same are not looked at again (build/tidy). Needs the generated headers of a build.
# Usage: tools/check_tidy.sh [FILE...]     FOVEA_TURN=N: every Nth of all sources, other ones with each commit (tools/turn.sh)
set -eu
flags="-std=c11 -D_GNU_SOURCE -Iinclude -Isrc -Ibuild/generated -Itests -fsigned-char -I. -isystem /usr/include/freetype2"
mkdir -p build/tidy

if [ $# -eq 1 ]; then
    # shellcheck disable=SC2086
    clean=build/tidy/$({ clang -E $flags "$1" && cat .clang-tidy; } | sha1sum | cut -c 1-40)
    [ -f "$clean" ] && exit 0
    # shellcheck disable=SC2086
    clang-tidy --quiet --warnings-as-errors='*' "$1" -- $flags 2>build/tidy/err.$$ || {
        grep -v 'warnings generated' build/tidy/err.$$ >&2
        rm build/tidy/err.$$
        exit 1
    }
    rm build/tidy/err.$$
    touch "$clean"
    exit 0
fi
[ $# -gt 0 ] || set -- $(git ls-files 'src/*.c' 'drivers/*.c' | grep -vE '/(neon|x86)/' | if [ -n "${FOVEA_TURN:-}" ]; then tools/turn.sh "$FOVEA_TURN"; else cat; fi)
printf '%s\n' "$@" | xargs -P "$(nproc)" -n 1 "$0" || { echo "tidy: findings above"; exit 1; }
echo "tidy: ok"
