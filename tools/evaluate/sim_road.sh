#!/bin/bash
# How far maps of drives can be trusted: runs of sim:road over seeds, and of the KITTI recordings over start frames, into one page.
# A run that is in the record is not repeated; the record is of one build of the program, by its hash.
# Usage: tools/evaluate/sim_road.sh [SEEDS [FRAMES [OUTPUT]]]     FOVEA_DATA: folder of kitti00_a, kitti01_a and kitti06_a
set -eu
cd "$(dirname "$0")/../.."
seeds=${1:-100} frames=${2:-60} output=${3:-tools/evaluate/sim_road.md}
data=${FOVEA_DATA:?set it to the folder of the recordings}
program=build/tests/campaign/road
make -s $program
record=build/road-$(sha256sum $program | cut -c 1-12)-$frames.txt
touch "$record"

# run URI START...: those that the record lacks
run() {
    local uri=$1 start list=
    shift
    for start; do grep -qF "$uri $start " "$record" || list=$list,$start; done
    [ -z "$list" ] || $program "$frames" "${list#,}" "$uri" >>"$record"
}
export -f run
export program frames record
seq "$seeds" | xargs -P 2 -I N bash -c 'run "sim:road?seed=N" 0'
bad() { awk '$1 ~ /^sim:road\?seed=[0-9]+$/ && $3 > 3 {print substr($1, 15)}' "$record" | awk -v n="$seeds" '$1 <= n' | sort -n; }
bad | xargs -P 2 -I N bash -c 'run "sim:road?seed=N&objects=0" 0'
for name in kitti00_a kitti01_a kitti06_a; do
    last=$(($(wc -l <"$data/$name/times.txt") - 21))
    run "kitti:$data/$name" $(seq 0 $((last < 30 ? last : 30)))
done

# Medians over the runs that had poses: row NAME PATTERN
row() {
    grep -E "$2" "$record" | awk -v name="$1" '
        function middle(k,   n, i, j, v, a) {
            n = 0
            for (i = 1; i <= runs; i++) a[++n] = value[i, k]
            for (i = 2; i <= n; i++) { v = a[i]; for (j = i - 1; j > 0 && a[j] > v; j--) a[j + 1] = a[j]; a[j + 1] = v }
            return a[int((n + 1) / 2)]
        }
        { all++; wrong += $3 > 3 }
        $12 > 0 { runs++; for (k = 8; k <= 14; k++) value[runs, k] = $k }
        END {
            printf "| %s | %d | %d | %d, %d, %d | %.0f, %.0f, %.0f | %.1f |\n", name, all, wrong, middle(8), middle(9), middle(10),
                middle(11), middle(12), middle(13), middle(14)
        }'
}

{
    wrong=$(bad | wc -l)
    still=$(for n in $(bad); do grep -F "sim:road?seed=$n&objects=0 " "$record"; done | awk '$3 > 3' | wc -l)
    echo '# Maps on the simulated road'
    echo
    echo "Made by \`tools/evaluate/sim_road.sh $seeds $frames\`, which runs \`tests/campaign/road.c\` with the default configuration."
    echo
    echo "Wrong: a map of which at least 10 frames were published as \`tracking\` and whose scale changes more than threefold: over windows of 10 steps,"
    echo "the length of the estimated path over that of the true one, the largest over the least."
    echo
    echo "**On $wrong of $seeds seeds of \`sim:road\` ($frames frames each) a wrong map is published.** Without moving cars (\`objects=0\`) $still of these $wrong are wrong."
    echo "\`kitti01_a\` showed the fault beside a single far car, in version 0.1."
    echo
    echo '| source | runs | with a wrong map | inliers: 10th percentile, median, 90th | depth of inliers, m: the same | parallax of the median depth, degrees per frame |'
    echo '| --- | --- | --- | --- | --- | --- |'
    row "sim:road, seeds 1 to $seeds" '^sim:road\?seed=[0-9]+ '
    for name in kitti00_a kitti01_a kitti06_a; do row "$name, start frames 0 to 30, where 20 frames are left" "/$name "; done
    echo
    echo 'Medians over the runs that had poses. The depth is that of the landmarks that a frame found, in metres by the true length of the last ten steps:'
    echo 'where the map is wrong, so is this.'
    echo
    echo '| run | scale, largest over least | frames tracking | weak | lost | maps |'
    echo '| --- | --- | --- | --- | --- | --- |'
    grep -E '^(sim:road\?seed=[0-9]+|kitti:.*) ' "$record" | awk '$3 > 3' | sed 's/^kitti:[^ ]*\//kitti:/' | sort -V |
        awk '{start = $1 ~ /kitti/ ? ", start frame " $2 : ""; print "| " $1 start " | " $3 " | " $4 " | " $5 " | " $6 " | " $7 " |"}'
} >"$output"
echo "$output"
