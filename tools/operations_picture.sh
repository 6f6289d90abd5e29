#!/bin/sh
# Draw docs/operations.png: a frame of the simulated camera, made darker, and what each operation makes of it. Needs ImageMagick.
# Usage: tools/operations_picture.sh BUILD OUT.png
set -eu
fovea=$1/fovea
out=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$fovea" export --source 'sim:tour?noise=4' --frames 1 --start 60 "$work/frames" >/dev/null
frame=$work/frames/000000.png
convert "$frame" -evaluate Multiply .55 "$work/dark.png"
convert "$frame" -colorspace sRGB -type TrueColor -channel G -evaluate Multiply .8 -channel B -evaluate Multiply .5 PNG24:"$work/warm.png"

tile() { # name of the file, label
    convert "$work/$1.png" -colorspace sRGB -resize 320x240 -background white -gravity center -font DejaVu-Sans -pointsize 12 label:"$2" -append "$work/tile-$1.png"
}
image() { # file, label, options
    file=$1 label=$2
    shift 2
    "$fovea" image "$work/dark.png" "$work/$file.png" "$@" >/dev/null
    tile "$file" "$label"
}
edges() { # method, options
    method=$1
    shift
    "$fovea" edges "$work/dark.png" "$work/$method.png" --method "$method" "$@" >/dev/null
    tile "$method" "edges ($method)"
}
tile dark before
image gaussian 'denoise (gaussian)' --operations denoise --size 7
image median 'denoise (median)' --operations denoise --denoise median
image bilateral 'denoise (bilateral)' --operations denoise --denoise bilateral
image normalize 'normalize (range)' --operations normalize
image deviation 'normalize (deviation)' --operations normalize --normalize deviation
image sharpen sharpen --operations sharpen
image equalization histogram_equalization --operations histogram_equalization
image contrast contrast_enhancement --operations contrast_enhancement
image gamma gamma --operations gamma --gamma .5
tile warm 'before, in warm light'
"$fovea" image "$work/warm.png" "$work/balanced.png" --operations white_balance >/dev/null
tile balanced 'white balance'
edges sobel --high 60
edges scharr --high 240
edges laplacian --high 25
edges canny --low 30 --high 90
"$fovea" segments "$work/dark.png" "$work/segments.png" --min-length 15 >/dev/null
tile segments 'line segments'
"$fovea" features "$work/dark.png" --method sift --max 200 --draw "$work/features.png" >/dev/null
tile features 'features (sift)'
cd "$work"
montage tile-dark.png tile-gaussian.png tile-median.png tile-bilateral.png tile-normalize.png tile-deviation.png tile-sharpen.png tile-equalization.png tile-contrast.png \
    tile-gamma.png tile-warm.png tile-balanced.png tile-sobel.png tile-scharr.png tile-laplacian.png tile-canny.png tile-segments.png tile-features.png \
    -tile 3x -geometry +3+3 all.png
convert all.png -strip -dither None -colors 128 -depth 8 -define png:compression-level=9 PNG8:operations.png
cd - >/dev/null
cp "$work/operations.png" "$out"
