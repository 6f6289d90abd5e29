#!/bin/sh
# Run the test programs of a build: two more at a time than there are processors, since many wait; beside them those of networks that may
# share one network, one after the other; in the end those that judge speed, alone. Say which failed, what was skipped and which took most
# processor time.
# Usage: tools/run_tests.sh BUILD [EMULATOR...]     FOVEA_TESTS="unit/base/test_ring ..." runs only these, FOVEA_TESTS_WITHOUT="..." all but these;
# FOVEA_TEST_JOBS=N: so many beside each other
set -u

if [ "$1" = --one ]; then # --one BUILD TEST [EMULATOR...]
    build=$2 test=$3
    shift 3
    name=$(echo "${test#"$build"/tests/}" | tr / -)
    "$@" "$test" >"$build/test-log/$name.out" 2>&1 && verdict=passed || verdict=failed
    times >"$build/test-log/$name.times" # its second line: user and system time of the test, as 0m1.23s
    seconds=$(awk -F'[ms ]+' 'NR == 2 { print $1 * 60 + $2 + $3 * 60 + $4 }' "$build/test-log/$name.times")
    echo "$verdict $test $name $seconds" >>"$build/test-log/verdicts"
    exit 0
fi

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

if [ -n "${FOVEA_TESTS:-}" ]; then
    tests=$(for name in $FOVEA_TESTS; do echo "$build/tests/$name"; done)
else
    tests=$(find "$build/tests" -type f -perm -u+x -name 'test_*' | sort)
fi
for name in ${FOVEA_TESTS_WITHOUT:-}; do tests=$(echo "$tests" | grep -vxF "$build/tests/$name"); done
alone=$(for test in $tests; do
    name=${test#"$build"/}
    [ -n "${FOVEA_TIMED:-}" ] && grep -qs FOVEA_TIMED "$name.c" "$name.cpp" && echo "$test"
done)
# Of the tests of networks, those that enter one of their own disturb no other, where networks can be made.
own=
if unshare --net true 2>/dev/null || unshare --user --net true 2>/dev/null; then own='own_network_enter|watched_possible|two_hosts_enter'; fi
networked=$(for test in $(echo "$tests" | grep -E '/(transport/[^/]*|app/run/test_loop)$'); do
    name=${test#"$build"/}
    [ -n "$own" ] && grep -qsE "$own" "$name.c" || echo "$test"
done)
together=$(echo "$tests" | grep -vxF "${alone:-none}" | grep -vxF "${networked:-none}")

rm -rf "$build/test-log"
mkdir -p "$build/test-log"
for test in $networked; do "$0" --one "$build" "$test" "$@"; done &
printf '%s\n' $together | xargs -P "${FOVEA_TEST_JOBS:-$(($(nproc) + 2))}" -I '{}' "$0" --one "$build" '{}' "$@"
wait
for test in $alone; do "$0" --one "$build" "$test" "$@"; done

sort -k 2 "$build/test-log/verdicts" | while read -r verdict test name _; do
    out=$build/test-log/$name.out
    if [ "$verdict" = failed ]; then # what failed first is the cause, and may be far from the end
        echo "FAILED $test"
        grep -nE -A 1 '^\[  (ERROR|FAILED)' "$out" | head -n 20
        tail -n 40 "$out"
    fi
    grep -h 'SKIPPED' "$out"
done
echo "seconds of processor time: $(sort -k 4 -n -r "$build/test-log/verdicts" |
    awk '{ all += $4 } NR < 6 { most = most " " $3 " " $4 ";" } END { print all ";" most }')"
passed=$(grep -c '^passed' "$build/test-log/verdicts")
failed=$(sed -n 's/^failed \([^ ]*\) .*/\1/p' "$build/test-log/verdicts")
[ -z "$failed" ] || echo "failed:" $failed
echo "$passed passed, $(echo "$failed" | wc -w) failed"
[ -z "$failed" ] && [ "$passed" -eq "$(echo "$tests" | wc -l)" ]
