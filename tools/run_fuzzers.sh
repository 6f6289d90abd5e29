#!/bin/sh
# Run every fuzz target of a build for a while, as many at a time as there are processors, from its committed corpus; a
# crashing input is kept and fails the run.
# Usage: tools/run_fuzzers.sh BUILD SECONDS
set -u

if [ "$1" = --one ]; then # --one BUILD SECONDS FUZZER
    build=$2 name=$(basename "$4") corpus=$2/corpus/$(basename "$4") seconds=$3
    # What any host can send is fuzzed for a minute at least.
    [ "$name" != fuzz_receiver ] || [ "$seconds" -ge 60 ] || seconds=60
    mkdir -p "$corpus"
    [ -d "tests/fuzz/corpus/$name" ] && cp "tests/fuzz/corpus/$name"/* "$corpus"
    if "$4" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -close_fd_mask=3 \
            -artifact_prefix="$build/crash-$name-" "$corpus" 2>"$build/$name.log"; then
        runs=$(sed -n 's/^Done \([0-9]*\) runs.*/\1/p' "$build/$name.log")
        [ "${runs:-0}" -gt 0 ] && echo "$name: ok, $runs runs, $(find "$corpus" -type f | wc -l) inputs" && exit 0
    fi
    tail -n 30 "$build/$name.log"
    echo "$name: FAILED"
    exit 1
fi

# The longest first, so that all processors have work to the end.
find "$1/fuzz" -type f -perm -u+x -name 'fuzz_*' | sort | awk '/fuzz_receiver$/ { print } !/fuzz_receiver$/ { rest = rest $0 "\n" } END { printf "%s", rest }' | xargs -P "$(nproc)" -n 1 "$0" --one "$1" "$2" ||
    { echo "fuzzing found faults"; exit 1; }
