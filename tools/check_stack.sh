#!/bin/sh
# Threads have 256 KiB of stack: hold every function of the library to a bound, from the compiler's own report.
# Usage: tools/check_stack.sh BUILD
set -eu
bound=32768
set -- $(find "$1/obj/src" -name '*.su' ! -path '*/app/*' ! -path '*/calibrate/*' ! -path '*/web/*' ! -path '*/support/*')
awk -F'\t' -v bound="$bound" '
    $3 ~ /dynamic/ && $3 !~ /bounded/ { print $1 ": stack of unknown size"; bad = 1 }
    $2 > bound { print $1 ": " $2 " bytes of stack, expected at most " bound; bad = 1 }
    $2 > max { max = $2; where = $1 }
    END { if (bad) exit 1; print "stack: ok, largest frame " max " bytes in " where }' "$@"
