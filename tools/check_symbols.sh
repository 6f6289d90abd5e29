#!/bin/sh
# What the runtime library may ask of the world: no libm (results would differ between machines), no qsort, no heap, no printing, no
# clock. LCM's generated code is the only part that names more.
# Usage: tools/check_symbols.sh BUILD [NM]
set -eu
build=$1
nm=${2:-nm}

allowed='^(memcpy|memset|memmove|memcmp|memchr|strlen|strcat|strcpy|strncpy|strcmp|strncmp|strchr|snprintf|vsnprintf|getauxval|getenv|abort'
# What _FORTIFY_SOURCE makes of these where it knows the room there is: the same functions, which abort instead of writing beyond it.
allowed="$allowed|__(memcpy|memmove|memset|strcpy|strncpy|strcat|snprintf|vsnprintf)_chk"
allowed="$allowed|__assert_fail|__stack_chk_fail|__stack_chk_guard|_GLOBAL_OFFSET_TABLE_|__cpu_model|__popcountdi2"
allowed="$allowed|__(asan|ubsan|tsan|sanitizer)_.*|fv_.*|fovea_.*|__fovea_.*|(__)?bot_core_.*)$"

bad=0
for object in $(find "$build/obj/src" -name '*.o' ! -path '*/app/*' ! -path '*/support/*' | sort) ; do
    symbols=$($nm --undefined-only "$object" | awk '{print $NF}' | grep -vE "$allowed" || true)
    if [ -n "$symbols" ]; then
        echo "$object: $(echo "$symbols" | tr '\n' ' ')"
        bad=1
    fi
done
# vsnprintf and getenv are for set-up only.
[ $bad -eq 0 ] && echo "symbols: ok"
exit $bad
