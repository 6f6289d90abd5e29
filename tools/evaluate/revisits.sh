#!/bin/sh
# Revisits on the recordings of $FOVEA_DATA (default ../shared/data):
#  - forward on even frames, then backward on odd ones: at least 95 % of the way back is posed, in one and the same map;
#  - two different drives, one after the other: the second gets a map of its own, and none of it is placed in the first;
#  - a map saved from the even frames localises the odd ones, from the first even frame that was posed to the last, with at most
#    1.2 times the error, posed as many as on the even ones or 95 % of it.
# Usage: tools/evaluate/revisits.sh
set -eu
cd "$(dirname "$0")/../.."
data=${FOVEA_DATA:-../shared/data}
build=${BUILD:-build}
folder=$build/revisits
mkdir -p "$folder"
failed=

posed() { sed -n 's/.*posed \([0-9]*\) of .*/\1/p' "$1"; }
error() { sed -n 's/.*RMS error \([0-9.e+-]*\) m.*/\1/p' "$1"; }
count_maps() { "$build/fovea" map info "$1" | grep -c '^  map '; }
run() { # run LOG ARGUMENT...
    log=$1
    shift
    "$build/fovea" run "$@" --rate max --picture none --set lcm_url= >"$log" 2>&1 || { cat "$log"; exit 1; }
}
verdict() { # verdict LINE CONDITION
    if awk "BEGIN { exit !($2) }"; then echo "ok      $1"; else echo "FAILED  $1"; failed=1; fi
}

for uri in "euroc:$data/euroc_mh05_a" "kitti:$data/kitti00_a" "kitti:$data/kitti06_a" "tum:$data/handheld_7scenes_a"; do
    name=$(basename "${uri#*:}")
    [ -d "${uri#*:}" ] || { echo "SKIPPED $name: not there"; continue; }
    run "$folder/even.log" --source "$uri" --step 2 --save-map "$folder/$name.map" --trajectory "$folder/even.tum"
    even=$(sed -n 's/.* \([0-9]*\) frames in .*/\1/p' "$folder/even.log")
    run "$folder/both.log" --source "sequence:$uri[step=2] then $uri[start=1,step=2,reverse]" --save-map "$folder/both.map"
    all=$(sed -n 's/.* \([0-9]*\) frames in .*/\1/p' "$folder/both.log")
    back=$(($(posed "$folder/both.log") - $(posed "$folder/even.log")))
    maps=$(count_maps "$folder/both.map")
    verdict "$name: $back of $((all - even)) frames posed on the way back, $maps map" "$back >= 0.95 * $((all - even)) && $maps == 1"
    lead=$((even - $(posed "$folder/even.log"))) # even frames before the first posed one, where none was lost later
    run "$folder/odd.log" --source "$uri" --start $((2 * lead + 1)) --step 2 --map "$folder/$name.map" \
        --set map.localise_only=true
    verdict "$name: odd frames in the map of the even ones: $(posed "$folder/odd.log") posed, error $(error "$folder/odd.log") m, even $(posed "$folder/even.log") posed, error $(error "$folder/even.log") m" \
        "$(posed "$folder/odd.log") >= 0.95 * $(posed "$folder/even.log") && 0$(error "$folder/odd.log") <= 1.2 * $(error "$folder/even.log")"
done
if [ -d "$data/kitti00_a" ] && [ -d "$data/kitti06_a" ]; then
    run "$folder/chain.log" --source "sequence:kitti:$data/kitti00_a then kitti:$data/kitti06_a" --save-map "$folder/chain.map"
    maps=$(count_maps "$folder/chain.map")
    verdict "kitti00_a then kitti06_a: $maps maps, $(posed "$folder/chain.log") of 131 frames posed, each map's error together $(error "$folder/chain.log") m" \
        "$maps == 2 && $(error "$folder/chain.log") < 0.3"
fi
[ -z "$failed" ]
