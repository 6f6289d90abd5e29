#!/bin/sh
# CPU time of step and work with everything on, against cv::ORB::detectAndCompute on the same images with as many features: mean
# and 99th percentile of a frame over the mean of ORB, which is measured before and after each run since machines drift.
# Usage: tools/evaluate/cpu.sh [ROUNDS]
set -eu
cd "$(dirname "$0")/../.."
data=${FOVEA_DATA:-../shared/data}
build=${BUILD:-build}
rounds=${1:-3}
folder=$build/cpu
mkdir -p "$folder"
if [ ! -x "$folder/orb_time" ] || [ tools/evaluate/orb_time.cpp -nt "$folder/orb_time" ]; then
    ${CXX:-g++} -O2 -std=c++17 -isystem /usr/include/opencv4 tools/evaluate/orb_time.cpp -o "$folder/orb_time" \
        -lopencv_features2d -lopencv_imgcodecs -lopencv_core
fi
value() { sed -n "s/.*\"frame\": {[^}]*\"$1\": \([0-9]*\).*/\1/p" "$folder/stats.json"; }
compare() { # compare URI FEATURES IMAGE...
    uri=$1 features=$2
    shift 2
    [ -d "${uri#*:}" ] || { echo "SKIPPED ${uri#*:}: not there"; return; }
    : >"$folder/rows"
    before=$("$folder/orb_time" "$features" "$@")
    for round in $(seq "$rounds"); do
        "$build/fovea" run --source "$uri" --rate max --picture none --set lcm_url= --set "features.count_max=$features" \
            --stats "$folder/stats.json" --quiet
        after=$("$folder/orb_time" "$features" "$@")
        echo "$before $after $(value mean_ns) $(value p99_ns)" >>"$folder/rows"
        before=$after
    done
    awk -v name="$(basename "${uri#*:}"), $features features" '
        { orb = ($1 + $2) / 2; mean += $3 / 1e6 / orb; p99 += $4 / 1e6 / orb; sum += orb }
        END { printf "%s: mean %.2f, p99 %.2f of ORB, which takes %.2f ms\n", name, mean / NR, p99 / NR, sum / NR }' "$folder/rows"
}
compare "euroc:$data/euroc_mh05_a" 1000 $(ls "$data"/euroc_mh05_a/mav0/cam0/data/*.png | awk 'NR % 20 == 1')
compare "kitti:$data/kitti00_a" 2000 $(find "$data/kitti00_a" -name '*.png' | sort | awk 'NR % 8 == 1')
