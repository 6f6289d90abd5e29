#!/bin/sh
# Static estimate of the ARM inner loops of the int8 matrix product: llvm-mca for a Cortex-A76.
# Usage: tools/arm_estimate.sh        (needs aarch64-linux-gnu-gcc and llvm-mca)
set -eu
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for isa in dotprod i8mm; do
    march=armv8.2-a+dotprod
    [ $isa = i8mm ] && march=armv8.2-a+dotprod+i8mm
    aarch64-linux-gnu-gcc -std=c11 -O3 -ffp-contract=off -Iinclude -Isrc -march=$march -S \
        src/kernels/neon/nn_gemm_$isa.c -o "$work/$isa.s"
    # the innermost loop with the most products
    awk '
        /^\.L[0-9]+:/ { label = $1; sub(":", "", label); start[label] = NR; body[label] = ""; open = label; count = 0; next }
        { line[NR] = $0 }
        open != "" && /^\t[a-z]/ { body[open] = body[open] $0 "\n"; if ($1 ~ /^(sdot|usmmla)$/) count++
            if ($1 ~ /^(b[a-z.]+|cbnz)$/ && $NF == open) { if (count > most) { most = count; best = body[open] } } }
        END { printf "%s", best }' "$work/$isa.s" >"$work/loop.s"
    products=$(grep -cE 'sdot|usmmla' "$work/loop.s" || true)
    each=16
    peak=32
    [ $isa = i8mm ] && each=32 && peak=64
    llvm-mca -mtriple=aarch64 -mcpu=cortex-a76 -mattr=+dotprod,+i8mm -iterations=100 "$work/loop.s" >"$work/report" 2>"$work/errors" || {
        head -n 3 "$work/errors"
        continue
    }
    awk -v isa=$isa -v products="$products" -v each=$each -v peak=$peak '/Total Cycles:/ {
        cycles = $3 / 100; rate = products * each / cycles
        printf "%s: %d products in %.1f cycles per turn, %.1f MAC/cycle, %.0f %% of the %d that two pipes give\n", isa, products, cycles, rate,
            100 * rate / peak, peak }' "$work/report"
done
