#!/bin/sh
# Kidnapping in simulation, over seeds: after 14 s of `sim:kidnap` the camera is in a room never seen, at 17 s it is back.
# A seed holds when the camera is posed again within 15 frames of its return, in the right place: the error over the
# whole run, each map aligned by itself, below 0.1 m. Fails when fewer than 95 of 100 hold.
# Usage: tools/evaluate/kidnap.sh [SEEDS [FIRST]]
set -eu
cd "$(dirname "$0")/../.."
seeds=${1:-100}
first=${2:-1}
build=${BUILD:-build}
folder=$build/kidnap
mkdir -p "$folder"
held=0
for seed in $(seq "$first" $((first + seeds - 1))); do
    "$build/fovea" run --source "sim:kidnap?seed=$seed&frames=540" --rate max --trajectory "$folder/$seed.tum" \
        --timings none --path none --set lcm_url= >"$folder/$seed.log" 2>&1 || { cat "$folder/$seed.log"; exit 1; }
    again=$(awk '{ f = int($1 * 30 + 0.5); if (f >= 510 && !n) { n = 1; print f - 510 } }' "$folder/$seed.tum")
    error=$(sed -n 's/.*RMS error \([0-9.e+-]*\) m.*/\1/p' "$folder/$seed.log")
    if awk -v a="${again:-999}" -v e="${error:-999}" 'BEGIN { exit !(a <= 15 && e < 0.1) }'; then
        held=$((held + 1))
    else
        echo "seed $seed: posed again after ${again:-more than 30} frames, error ${error:-unknown} m"
    fi
done
echo "kidnap: $held of $seeds seeds relocalised within 15 frames"
[ $((held * 100)) -ge $((seeds * 95)) ]
