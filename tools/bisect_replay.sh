#!/bin/sh
# Find the commit that changed what a replay of a recording gives, by `git bisect run` in a worktree of its own; yours stays as it is.
# A commit is bad when `fovea replay LOG --verify` ends with a line of difference in which MESSAGE stands: a channel (POSE), a frame
# ("frame 57 "), or both as a regular expression ("frame 57 .*POSE"). It is good when all is equal, and skipped when it does not
# build, refuses the recording, or differs elsewhere first: what comes after the first difference is not known.
# Usage: tools/bisect_replay.sh [--trust-state] LOG MESSAGE [GOOD [BAD]]
#   GOOD   default: the last commit before the recording began or, where its clock does not say when that was (a simulated camera), the
#          tag of the version that made it
#   BAD    default: HEAD
#   --trust-state   LOG began in the middle of its run (command record), and is of your own robot: a replay takes the state in it as it
#                   is, which can make the program do anything. Commits that lay out the state otherwise are skipped.
set -eu
trust=
[ "${1:-}" = --trust-state ] && trust=$1 && shift
case ${1:-} in -*) set -- ;; esac
[ $# -ge 2 ] && [ $# -le 4 ] || { sed -n '2,13s/^# //p' "$0" >&2; exit 2; }
fail() { echo "tools/bisect_replay.sh: $*" >&2; exit 2; }
[ -f "$1" ] || fail "$1: found no such file, expected a recording"
[ "$(od -An -tx1 -N 4 "$1" | tr -d ' ')" = eda1da01 ] || fail "$1: byte 0: found no event of an LCM log, expected a recording"
log=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
message=$2
cd "$(dirname "$0")/.."
[ -d /usr/lib/ccache ] && PATH=/usr/lib/ccache:$PATH && export PATH CCACHE_NOHASHDIR=1 CCACHE_COMPILERCHECK=content

number() { # number AT BYTES: of the log, big-endian
    od -An -v -tu1 -j "$1" -N "$2" "$log" | awk '{ for (i = 1; i <= NF; i++) n = n * 256 + $i } END { printf "%.0f", n }'
}
# Of the first event, after 4 bytes of sync, 8 of its number, 8 of its time and 8 of its lengths: the channel, and in recording_t, after
# the type's hash and the format, the version as a string with its length before it.
version_of_log() {
    at=$((28 + $(number 20 4) + 8 + 4))
    length=$(number $at 4)
    [ "$length" -gt 1 ] && [ "$length" -le 32 ] && tail -c +$((at + 5)) "$log" | head -c $((length - 1)) | tr -cd '0-9A-Za-z.+-'
}

good=${3:-}
if [ -z "$good" ]; then
    seconds=$(($(number 12 8) / 1000000)) # since 1970
    if [ "$seconds" -ge 315532800 ]; then # before 1980 it is no date, and git takes it for another one
        good=$(git rev-list -1 --before="@$seconds" "${4:-HEAD}")
        [ -n "$good" ] || fail "found no commit before the recording began, expected GOOD as third argument"
    else
        version=$(version_of_log) || version=
        version=${version%%+*} # without the hash of its sources
        for tag in "v$version" "$version"; do
            [ -n "$version" ] && [ -z "$good" ] && good=$(git rev-parse --verify --quiet "refs/tags/$tag^{commit}") || true
        done
        [ -n "$good" ] || fail "$1: its clock does not say when it began, and found no tag v${version:-VERSION} of the version that made it: expected GOOD as third argument, a commit that replays it without a difference"
    fi
fi
good=$(git rev-parse --verify "$good^{commit}") && bad=$(git rev-parse --verify "${4:-HEAD}^{commit}") || fail "found no such commit"
work=$(mktemp -d)
trap 'git worktree remove --force "$work/tree" 2>/dev/null; rm -rf "$work"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP
git worktree add --quiet --detach "$work/tree" "$bad"

cat >"$work/judge" <<'JUDGE'
#!/bin/sh
# 0 good, 1 bad, 125 not known
make -j"$(nproc)" BUILD=build build/fovea >"$FOVEA_WORK/build" 2>&1 || { echo "does not build"; exit 125; }
# shellcheck disable=SC2086 # nothing, or one option
build/fovea replay "$FOVEA_LOG" --verify $FOVEA_TRUST >"$FOVEA_WORK/replay" 2>&1
case $? in
0) echo "equal"; exit 0 ;;
1) line=$(grep -oE 'frame [-0-9]+ .*found .*, expected .*' "$FOVEA_WORK/replay" | head -n 1) # without the path
   # A robot that lost its power leaves a log without an end: what is there counts.
   [ -z "$line" ] && grep -q 'found no end of the recording' "$FOVEA_WORK/replay" && { echo "equal, as far as it goes"; exit 0; }
   echo "${line:-differs}"
   echo "$line" | grep -qE "$FOVEA_MESSAGE" && exit 1
   exit 125 ;;
*) grep -q 'the event is cut off' "$FOVEA_WORK/replay" && { echo "equal, as far as it goes"; exit 0; }
   tail -n 1 "$FOVEA_WORK/replay"; exit 125 ;;
esac
JUDGE
chmod +x "$work/judge"
export FOVEA_WORK="$work" FOVEA_LOG="$log" FOVEA_MESSAGE="$message" FOVEA_TRUST="$trust" CCACHE_BASEDIR="$work/tree"
cd "$work/tree"

# A search between two ends that are not so would find some commit all the same.
judged() { git checkout --quiet --detach "$1" && said=$("$work/judge") && verdict=0 || verdict=$?; }
judged "$bad"
[ $verdict -eq 1 ] || fail "at $(git log -1 --format='%h %s'): found \"$said\", expected a difference with '$message'"
judged "$good"
[ $verdict -eq 0 ] || fail "at $(git log -1 --format='%h %s'): found \"$said\", expected no difference"
git bisect start "$bad" "$good" >/dev/null
git bisect run "$work/judge" >"$work/run" 2>&1 || true
first=$(sed -n 's/^\([0-9a-f]*\) is the first bad commit$/\1/p' "$work/run")
if [ -z "$first" ]; then
    echo "not found: the commits that were skipped are among those that may be the first:" >&2
    sed -n '/^The first bad commit could be any of/,$p' "$work/run" >&2
    git bisect reset >/dev/null 2>&1
    exit 1
fi
git bisect reset >/dev/null 2>&1
judged "$first"
git log -1 --format='%H%n%an, %ad%n    %s' "$first"
echo "$said"
