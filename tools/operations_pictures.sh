#!/bin/sh
# Draw docs/operations.png, features.png and matching.png: frames of the simulated camera, and what each operation, method of features and
# kind of matching makes of them. Needs ImageMagick.
# Usage: tools/operations_pictures.sh BUILD FOLDER
set -eu
fovea=$(realpath "$1/fovea")
out=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

label() { # picture, text: the picture with the text below it
    convert "$1" -background white -gravity center -font DejaVu-Sans -pointsize 12 label:"$2" -append "$1"
}
sheet() { # name, columns, tiles...
    name=$1 columns=$2
    shift 2
    montage "$@" -tile "$columns"x -geometry +3+3 all.png
    convert all.png -strip -dither None -colors 64 -depth 8 -define png:compression-level=9 PNG8:"$name"
    cp "$name" "$out/$name"
}

# ---- operations: a part of a frame with noise, enlarged; the frame in poor light; in warm light; its edges -----------------------------

"$fovea" export --source 'sim:tour?noise=4' --frames 1 --start 60 frames >/dev/null
frame=frames/000000.png
convert "$frame" -seed 1 -attenuate .12 +noise Impulse -colorspace Gray noisy.png
convert "$frame" -evaluate Multiply .55 dark.png
convert "$frame" -colorspace sRGB -type TrueColor -channel G -evaluate Multiply .8 -channel B -evaluate Multiply .5 PNG24:warm.png

part() { # tile, text, picture
    convert "$3" -crop 160x120+310+330 +repage -colorspace sRGB -filter Point -resize 320x240 "$1"
    label "$1" "$2"
}
whole() { # tile, text, picture
    convert "$3" -colorspace sRGB -resize 320x240 "$1"
    label "$1" "$2"
}
image() { # part or whole, from, tile, text, options
    how=$1 from=$2 tile=$3 text=$4
    shift 4
    "$fovea" image "$from" done.png "$@" >/dev/null
    $how "$tile" "$text" done.png
}
edges() { # tile, text, method, options
    tile=$1 text=$2 method=$3
    shift 3
    "$fovea" edges dark.png done.png --method "$method" "$@" >/dev/null
    whole "$tile" "edges of the dark frame: $text" done.png
}
part 01.png 'before: noise (a part)' "$frame"
image part "$frame" 02.png 'denoise: gaussian' --operations denoise --size 5
image part "$frame" 03.png 'denoise: bilateral' --operations denoise --denoise bilateral
image part "$frame" 04.png 'sharpen' --operations sharpen --amount 2
part 05.png 'before: wrong pixels as well' noisy.png
image part noisy.png 06.png 'denoise: median' --operations denoise --denoise median
whole 07.png 'before: dark' dark.png
image whole dark.png 08.png 'normalize: range' --operations normalize
image whole dark.png 09.png 'normalize: deviation' --operations normalize --normalize deviation
image whole dark.png 10.png histogram_equalization --operations histogram_equalization
image whole dark.png 11.png contrast_enhancement --operations contrast_enhancement
image whole dark.png 12.png gamma --operations gamma --gamma .5
whole 13.png 'before: warm light' warm.png
image whole warm.png 14.png white_balance --operations white_balance
image whole warm.png 15.png 'white_balance, then contrast_enhancement' --operations white_balance,contrast_enhancement
edges 16.png sobel sobel --high 60
edges 17.png scharr scharr --high 240
edges 18.png laplacian laplacian --high 25
edges 19.png 'canny, norm l1' canny --low 30 --high 90
edges 20.png 'canny, norm l2' canny --low 30 --high 90 --norm l2
"$fovea" segments dark.png done.png --min-length 15 >/dev/null
whole 21.png 'line segments' done.png
sheet operations.png 3 [0-9][0-9].png
rm [0-9][0-9].png

# ---- features: each method on one frame ------------------------------------------------------------------------------------------------


features() { # tile, text, options
    tile=$1 text=$2
    shift 2
    "$fovea" features "$frame" --max 250 --draw done.png "$@" >/dev/null
    convert done.png -resize 400x300 "$tile"
    label "$tile" "$text"
}
convert "$frame" -colorspace sRGB -resize 400x300 01.png
label 01.png before
features 02.png 'fast' --method fast
features 03.png 'orb: on 8 levels, with directions' --method orb
features 04.png 'harris' --method harris
features 05.png 'harris, 12 pixels apart' --method harris --distance 12
features 06.png 'shi_tomasi, 12 pixels apart' --method shi_tomasi --distance 12
features 07.png 'sift' --method sift
features 08.png 'sift, without doubling' --method sift --no-doubling
if "$fovea" features "$frame" --method surf >/dev/null 2>&1; then
    features 09.png 'surf' --method surf
fi
sheet features.png 3 [0-9][0-9].png
rm [0-9][0-9].png

# ---- matching: two frames of a moving camera, of a turning one, of one that stands -----------------------------------------------------

"$fovea" export --source 'sim:tour?noise=4&lens=pinhole' --frames 1 --start 60 a >/dev/null
"$fovea" export --source 'sim:tour?noise=4&lens=pinhole' --frames 1 --start 78 b >/dev/null
"$fovea" export --source 'sim:rotate?noise=4&lens=pinhole' --frames 1 --start 10 c >/dev/null
"$fovea" export --source 'sim:rotate?noise=4&lens=pinhole' --frames 1 --start 25 d >/dev/null
moved="a/000000.png b/000000.png" turned="c/000000.png d/000000.png" same="a/000000.png a/000000.png"
focal=381.4 # of 640 pixels and 80 degrees

match() { # tile, text, pictures, options
    tile=$1 text=$2 pictures=$3
    shift 3
    # shellcheck disable=SC2086
    said=$("$fovea" match --max 400 "$@" --draw done.png $pictures | head -1 | sed 's/,* searched.*//; s/ of [0-9]* and [0-9]* features//')
    convert done.png -resize 640x240 "$tile"
    label "$tile" "$text: $said"
}
convert a/000000.png b/000000.png +append -colorspace sRGB -resize 640x240 01.png
label 01.png 'before: two frames of a camera that moves'
match 02.png 'orb, not verified' "$moved" --geometry any --ratio 95
match 03.png 'orb, fundamental' "$moved" --max 1000
match 04.png 'fast, fundamental' "$moved" --method fast
match 05.png 'harris, patches, fundamental' "$moved" --method harris --descriptor patch --distance 8
match 06.png 'shi_tomasi, fundamental' "$moved" --method shi_tomasi --distance 8
match 07.png 'sift, fundamental' "$moved" --method sift
if "$fovea" features "$frame" --method surf >/dev/null 2>&1; then
    match 08.png 'surf, fundamental' "$moved" --method surf
fi
match 09.png 'sift, essential' "$moved" --method sift --geometry essential --focal "$focal"
match 10.png 'sift, homography (one plane)' "$moved" --method sift --geometry homography
match 11.png 'sift, fundamental, the camera turned' "$turned" --method sift
match 12.png 'sift, essential, the same frame twice' "$same" --method sift --geometry essential --focal "$focal"
sheet matching.png 2 [0-9][0-9].png
