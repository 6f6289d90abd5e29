#!/bin/sh
# Feed mutated files to every parser of files, under asan+ubsan: COUNT inputs in all (default 1,000,000), shared out evenly, with
# fewer for the targets that replay or play what they are given. A finding is kept in build-fuzz/ and fails the run. Packets are
# fuzz_receiver's, which is run on its own.
# Usage: tools/fuzz_million.sh [COUNT]     needs: make BUILD=build-fuzz SAN=fuzz CC=clang CXX=clang++ fuzzers
set -u
cd "$(dirname "$0")/.."
build=build-fuzz

if [ "${1:-}" = --one ]; then # --one TARGET RUNS
    name=$2 runs=$3
    corpus=$build/million/$name
    mkdir -p "$corpus"
    [ -d "tests/fuzz/corpus/$name" ] && cp "tests/fuzz/corpus/$name"/* "$corpus"
    "$build/fuzz/$name" -runs="$runs" -seed=16 -timeout=30 -rss_limit_mb=2048 -close_fd_mask=3 \
        -artifact_prefix="$build/crash-$name-" "$corpus" 2>"$build/million/$name.log"
    ended=$?
    done=$(sed -n 's/^Done \([0-9]*\) runs.*/\1/p' "$build/million/$name.log")
    echo "$name ${done:-0} $ended" | tee -a "$build/million/verdicts"
    [ $ended -eq 0 ] || tail -n 20 "$build/million/$name.log"
    exit 0
fi

count=${1:-1000000}
rm -rf $build/million && mkdir -p $build/million
slow='fuzz_log fuzz_lcmlog fuzz_listing fuzz_model'
targets=$(find tests/fuzz -name 'fuzz_*.c' ! -name fuzz_receiver.c -exec basename {} .c \; | sort)
few=$((count / 100))
quick=0
for target in $targets; do case " $slow " in *" $target "*) count=$((count - few)) ;; *) quick=$((quick + 1)) ;; esac; done
for target in $targets; do
    case " $slow " in *" $target "*) echo "$target $few" ;; *) echo "$target $((count / quick + 1))" ;; esac
done | xargs -P "$(nproc)" -L 1 "$0" --one
awk -v wanted="$(echo "$targets" | wc -l)" '{ all += $2; bad += $3 != 0 || $2 == 0 } END {
    printf "%d mutated files on %d parsers, %d of them with a finding\n", all, NR, bad; exit bad || NR != wanted }' $build/million/verdicts
