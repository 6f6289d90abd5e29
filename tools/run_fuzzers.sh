#!/bin/sh
# Run every fuzz target of a build for a while, from its committed corpus; a crashing input is kept and fails the run.
# Usage: tools/run_fuzzers.sh BUILD SECONDS
set -eu
build=$1
seconds=$2
failed=
for fuzzer in "$build"/fuzz/fuzz_*; do
    [ -x "$fuzzer" ] || continue
    case $fuzzer in *.*) continue ;; esac
    name=$(basename "$fuzzer")
    corpus=$build/corpus/$name
    mkdir -p "$corpus"
    [ -d "tests/fuzz/corpus/$name" ] && cp -n "tests/fuzz/corpus/$name"/* "$corpus" 2>/dev/null
    if "$fuzzer" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -close_fd_mask=3 \
            -artifact_prefix="$build/crash-$name-" "$corpus" 2>"$build/$name.log"; then
        echo "$name: ok, $(grep -c . "$build/$name.log") lines of log, $(find "$corpus" -type f | wc -l) inputs"
    else
        tail -n 30 "$build/$name.log"
        failed="$failed $name"
    fi
done
[ -z "$failed" ] || { echo "fuzzing found faults:$failed"; exit 1; }
