#!/bin/sh
# The C and C++ sources are as clang-format of Debian 12 leaves them (`make fmt`); names the files that are not.
set -eu
cd "$(dirname "$0")/.."
bad=$(git ls-files '*.c' '*.h' '*.cpp' | xargs -P 2 -n 40 clang-format --dry-run --Werror 2>&1 |
    sed -n 's/^\([^:]*\):[0-9]*:[0-9]*: error:.*/\1/p' | sort -u)
[ -z "$bad" ] && { echo "format: ok"; exit 0; }
printf 'format: run `make fmt`; not formatted:\n%s\n' "$bad" >&2
exit 1
