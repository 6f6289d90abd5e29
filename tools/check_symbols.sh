#!/bin/sh
# What the runtime library may ask of the world: no libm (results would differ between machines), no qsort, no heap, no printing, no
# clock. LCM's generated code is the only part that names more.
# And what the shared libraries offer: the symbols of tools/LIBRARY.symbols, which are the functions that their public headers declare.
# A change of that list is a change of the interface: it is committed with its reason.
# Usage: tools/check_symbols.sh BUILD [NM]
set -eu
cd "$(dirname "$0")/.."
build=$1
nm=${2:-nm}

allowed='^(memcpy|memset|memmove|memcmp|memchr|strlen|strcat|strcpy|strncpy|strcmp|strncmp|strchr|snprintf|vsnprintf|getauxval|getenv|abort'
# What _FORTIFY_SOURCE makes of these where it knows the room there is: the same functions, which abort instead of writing beyond it.
allowed="$allowed|__(memcpy|memmove|memset|strcpy|strncpy|strcat|snprintf|vsnprintf)_chk"
allowed="$allowed|__assert_fail|__stack_chk_fail|__stack_chk_guard|_GLOBAL_OFFSET_TABLE_|__cpu_model|__popcountdi2"
allowed="$allowed|__(asan|ubsan|tsan|sanitizer)_.*|fv_.*|fovea_.*|__fovea_.*|(__)?bot_core_.*)$"

bad=0
for object in $(find "$build/obj/src" -name '*.o' ! -path '*/app/*' ! -path '*/calibrate/*' ! -path '*/web/*' ! -path '*/support/*' | sort) ; do
    symbols=$($nm --undefined-only "$object" | awk '{print $NF}' | grep -vE "$allowed" || true)
    if [ -n "$symbols" ]; then
        echo "$object: $(echo "$symbols" | tr '\n' ' ')"
        bad=1
    fi
done
# vsnprintf and getenv are for set-up only.

offered=$(mktemp)
trap 'rm -f "$offered" "$offered.headers"' EXIT

# Usage: compare LIBRARY HEADER...: its list, what it offers, and what the headers declare are the same.
compare() {
    library=$build/$1.so
    list=tools/$1.symbols
    shift
    $nm -D --defined-only "$library" | awk '{ print $NF }' | LC_ALL=C sort >"$offered"
    # What is inline is in no library; comments name functions of other places.
    sed 's|/\*.*\*/||; /static inline/d; /^ *\*/d; /^ *\/\*/d' "$@" | grep -oE '\bfovea_[a-z0-9_]+\(' | tr -d '(' |
        LC_ALL=C sort -u >"$offered.headers"
    for name in $(LC_ALL=C comm -13 "$list" "$offered.headers"); do
        echo "$name: declared in include/fovea/, not in $list"
        bad=1
    done
    for name in $(LC_ALL=C comm -23 "$list" "$offered.headers"); do
        echo "$name: in $list, not declared in include/fovea/"
        bad=1
    done
    for name in $(LC_ALL=C comm -23 "$list" "$offered"); do
        echo "$name: in $list, not defined in $library"
        bad=1
    done
    for name in $(LC_ALL=C comm -13 "$list" "$offered"); do
        echo "$name: in $library, not in $list"
        bad=1
    done
}
# shellcheck disable=SC2046
compare libfovea $(ls include/fovea/*.h | grep -v /fields.h)
compare libfovea-messages include/fovea/fields.h
[ $bad -eq 0 ] && echo "symbols: ok"
exit $bad
