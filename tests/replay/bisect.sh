#!/bin/sh
# tools/bisect_replay.sh in a small repository that is made here: its program says what each commit is to say. The commit that changed
# a frame is found beside one that does not build and one that changed something else before; ends that are not so are refused. So with
# recordings of build/fovea where it is built: one of a simulated camera, whose clock starts at 0, and one that the command `record` began.
set -eu
cd "$(dirname "$0")/../.."
built=$PWD/build
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/repository/tools"
cp tools/bisect_replay.sh "$folder/repository/tools/"
cd "$folder/repository"
export GIT_AUTHOR_NAME=test GIT_AUTHOR_EMAIL=test@example.org GIT_COMMITTER_NAME=test GIT_COMMITTER_EMAIL=test@example.org
git init --quiet -b main .
printf '$(BUILD)/fovea: program\n\t@mkdir -p $(@D) && cp program $@ && chmod +x $@\n' >Makefile
commit() { # commit SUBJECT EXIT LINE: what a replay says from here on; the commits are a day apart
    printf '#!/bin/sh\n# %s\n[ "$1 $3" = "replay --verify" ] || exit 3\necho "%s"\nexit %s\n' "$1" "$3" "$2" >program
    day=$((${day:-0} + 1))
    git add . && GIT_AUTHOR_DATE="2026-01-0${day}T12:00:00Z" GIT_COMMITTER_DATE="2026-01-0${day}T12:00:00Z" git commit --quiet -m "$1"
}
pose='run.lcm: frame 57 (stamp 1900000000 ns): FOVEA_POSE: position[0]: found 1, expected 2'
map='run.lcm: frame 12 (stamp 400000000 ns): FOVEA_MAP: landmarks: found 3, expected 4'
commit 'Begin' 0 'equal'
commit 'Tidy' 0 'equal'
commit 'Tidy again' 0 'equal'
mv Makefile kept && commit 'Lose the makefile' 0 'equal' && mv kept Makefile
commit 'Find the makefile' 0 'equal'
commit 'Break the pose' 1 "$pose"
commit 'Tidy the broken pose' 1 "$pose"
commit 'End' 1 "$pose"
end=$(git rev-parse HEAD)
# A log whose first event is of 2026-01-02T13:00:00Z: after the second commit.
printf '\355\241\332\001\0\0\0\0\0\0\0\0' >../run.lcm
printf '%016x' $((1767358800 * 1000000)) | sed 's/../\\x&/g' | xargs -0 printf '%b' >>../run.lcm
status=$(git status --porcelain)
expect() { # expect STATUS TEXT ARGUMENT...
    wanted=$1 text=$2
    shift 2
    found=0
    tools/bisect_replay.sh "$@" >../out 2>&1 || found=$?
    [ $found -eq "$wanted" ] && grep -q "$text" ../out || { cat ../out; echo "tests/replay/bisect.sh: found exit status $found, expected $wanted and '$text': $*"; exit 1; }
}
expect 0 '^    Break the pose$' ../run.lcm POSE
expect 0 'frame 57 ' ../run.lcm 'frame 57 .*POSE' HEAD~7
expect 2 'Tidy the broken pose: found .*expected no difference' ../run.lcm POSE HEAD~1
expect 2 'expected a difference with .GRID' ../run.lcm GRID
expect 2 'no such file' ../absent.lcm POSE
git revert --no-edit HEAD~2 >/dev/null 2>&1 || git revert --abort
commit 'Change the map' 1 "$map"
expect 2 'Change the map: found .*FOVEA_MAP' ../run.lcm POSE
expect 1 'could be any of' ../run.lcm MAP

# A clock that starts at 0 says no date. Without a tag of the version GOOD is asked for.
if [ -x "$built/fovea" ]; then
    "$built/fovea" run --source 'sim:corridor?width=160&height=120&frames=10&rate=10' --quiet --picture none --set lcm_url= --record ../sim.lcm
    version=$("$built/fovea" --version | awk '{ print $2 }')
else
    echo "SKIPPED recordings of build/fovea: not built"
    version=0.9
    # Its hash and format are left out of account.
    printf '\355\241\332\001\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\011\0\0\0\024RECORDING\0\0\0\0\0\0\0\0\0\0\0\004\0\0\0\0040.9\0' >../sim.lcm
fi
git reset --quiet --hard "$end"
expect 2 "its clock does not say when it began, and found no tag v$version .*: expected GOOD as third argument" ../sim.lcm POSE
git tag "v$version" HEAD~6
expect 0 '^    Break the pose$' ../sim.lcm POSE
git tag -d "v$version" >/dev/null
expect 0 '^    Break the pose$' ../sim.lcm POSE HEAD~6

# A recording that began in the middle of its run is refused unless its state is trusted: each commit runs the real program on it.
record_in_mid_run() {
    prefix=BISECT$$
    "$built/fovea" run --source 'sim:corridor?width=160&height=120&frames=3000&rate=10' --rate real --quiet --picture none \
        --set channel_prefix=$prefix --set record_folder="$folder/records" &
    run=$!
    trap 'kill $run 2>/dev/null; rm -rf "$folder"' EXIT
    answered=1
    for wait in 1 2 4 8 16 32 64; do # until it hears; a second `record` would be refused
        "$built/command" --prefix $prefix --wait $wait resume >/dev/null && answered=0 && break
    done
    [ $answered -eq 0 ] && "$built/command" --prefix $prefix --wait 60 record >/dev/null && sleep 2 && "$built/command" --prefix $prefix --wait 60 record-stop >/dev/null || answered=1
    kill -INT $run
    wait $run || true
    trap 'rm -rf "$folder"' EXIT
    return $answered
}
mkdir -p "$folder/records"
if [ -x "$built/fovea" ] && [ -x "$built/command" ] && record_in_mid_run; then
    cp "$folder"/records/*.lcm ../mid.lcm
    real() { # real SUBJECT LINE: what a replay that takes the state says from here on; none: what build/fovea says
        printf '#!/bin/sh\n# %s\ncase " $* " in *" --trust-state "*) [ -z "%s" ] || { echo "%s"; exit 1; } ;; esac\nexec "%s" "$@"\n' "$1" "$2" "$2" "$built/fovea" >program
        git add . && git commit --quiet -m "$1"
    }
    real 'Replay in earnest' ''
    first=$(git rev-parse HEAD)
    real 'Tidy in earnest' ''
    real 'Break the pose in earnest' "$pose"
    real 'End in earnest' "$pose"
    expect 2 'End in earnest: found .*expected --trust-state.*expected a difference' ../mid.lcm POSE "$first"
    expect 0 '^    Break the pose in earnest$' --trust-state ../mid.lcm POSE "$first"
else
    echo "SKIPPED a recording begun by the command record: build/fovea or build/command is not built, or heard no command"
fi
[ "$(git status --porcelain)" = "$status" ] && [ "$(git worktree list | wc -l)" -eq 1 ] || { echo "tests/replay/bisect.sh: the repository was changed"; exit 1; }
echo "bisect: ok"
