#!/bin/sh
# Renew the tables of src/kernels/ARM.md: instructions counted under qemu, and llvm-mca's estimates. Minutes.
# Needs make all and make cross. Usage: tools/arm_report.sh
set -eu
cd "$(dirname "$0")/.."
page=src/kernels/ARM.md
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tools/count_instructions.sh >"$work/count"
tools/mca.py >"$work/mca"
awk -v folder="$work" '
    /^<!-- [a-z]+:begin -->$/ { print; table = folder "/" substr($2, 1, index($2, ":") - 1)
                                while ((getline row <table) > 0) print row; inside = 1 }
    /^<!-- [a-z]+:end -->$/   { inside = 0 }
    !inside' $page >"$work/page"
cp "$work/page" $page
