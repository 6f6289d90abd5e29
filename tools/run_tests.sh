#!/bin/sh
# Run every test program of a build and say at the end which failed.
# Usage: tools/run_tests.sh BUILD [EMULATOR...]
set -u
build=$1
shift
: "${FOVEA_DATA:=../shared/data}"
export FOVEA_DATA FOVEA_PLUGINS="$build"
# ThreadSanitizer sees the locks of our code only: what LCM and GLib do among themselves is not ours to judge.
export TSAN_OPTIONS="ignore_noninstrumented_modules=1 ${TSAN_OPTIONS:-}"
# Tests that judge memory of the process, or take minutes when emulated, ask for this.
[ $# -eq 0 ] || export FOVEA_EMULATED=1
# Speed is judged in the ordinary build alone.
[ "$build" != build ] || export FOVEA_TIMED=1
passed=0 failed= log=$build/test.log
: >"$log"
for test in $(find "$build/tests" -type f -perm -u+x -name 'test_*' | sort); do
    if "$@" "$test" >"$build/test.out" 2>&1; then
        passed=$((passed + 1))
    else
        failed="$failed $test"
        echo "FAILED $test"
        tail -n 40 "$build/test.out"
    fi
    grep -h 'SKIPPED' "$build/test.out"
    cat "$build/test.out" >>"$log"
done
count=$(echo "$failed" | wc -w)
[ -z "$failed" ] || echo "failed:$failed"
echo "$passed passed, $count failed"
[ "$count" -eq 0 ] && [ "$passed" -gt 0 ]
