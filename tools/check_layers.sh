#!/bin/sh
# Enforce the layers of src/README.md: a room includes only itself, the rooms below it, and public headers.
# Prints one line per offence and fails if there is any.
set -eu
cd "$(dirname "$0")/.."

allowed() { # rooms that a room may include besides itself
    core="base kernels image geometry nn features stereo inertial odometry scale map detect objects grid"
    case $1 in
    base)     echo "" ;;
    kernels)  echo "base" ;;
    image)    echo "base kernels" ;;
    geometry) echo "base kernels" ;;
    nn)       echo "base kernels" ;;
    features) echo "base kernels image geometry" ;;
    stereo)   echo "base kernels image geometry features" ;;
    inertial) echo "base kernels geometry" ;;
    map)      echo "base kernels image geometry features" ;;
    odometry) echo "base kernels image geometry features map" ;;
    scale)    echo "base kernels geometry inertial map odometry" ;;
    detect)   echo "base kernels nn" ;;
    objects)    echo "base geometry" ;;
    grid)     echo "base geometry" ;;
    message)  echo "" ;;
    runtime)  echo "$core message" ;;
    support)  echo "base" ;;
    calibrate) echo "base kernels image message support drivers app/network web" ;;
    web)      echo "base message support drivers app/network app/config app/watch" ;;
    app/network) echo "base message support drivers" ;;
    app/config)  echo "$core runtime message support drivers app/network" ;;
    app/watch)   echo "base message support drivers app/network app/config" ;;
    app/record)  echo "$core runtime message support drivers app/network app/config" ;;
    app/lab)     echo "$core runtime message support drivers app/network app/config app/record" ;;
    app/run)     echo "$core runtime message support drivers app/network app/config app/record app/lab" ;;
    app)         echo "$core runtime message support drivers app/network app/config app/watch app/record app/lab app/run" ;;
    *)        echo "unknown" ;;
    esac
}

# The room of a path below src/: its first folder; of the application, whose rooms are folders too, the first two.
room_of() {
    case $1 in
    app/*/*) echo "$1" | cut -d/ -f1,2 ;;
    */*) echo "${1%%/*}" ;;
    esac
}

offences=$(mktemp)
trap 'rm -f "$offences"' EXIT

check_room() { # ROOM DEPTH
    room=$1
    may=$(allowed "$room")
    if [ "$may" = unknown ]; then
        echo "src/$room: a room that the plan does not name" >>"$offences"
        return
    fi
    # shellcheck disable=SC2086
    find "src/$room" $2 -type f \( -name '*.[ch]' -o -name '*.cpp' -o -name '*.def' \) -print0 |
        xargs -0 -r grep -HnoE '^ *# *include "[^"]+"' |
        sed -E 's/ *# *include "([^"]+)"/\1/' |
        while IFS=: read -r file line header; do
            case $header in
            fovea/*) continue ;;
            source_hash.h)
                case $room in app/*) ;; *) echo "$file:$line: only app/ sees the hash of the sources" ;; esac
                continue ;;
            fovea_*_t.h | bot_core_*_t.h | fovea_fields.h | fovea_types.h | fovea_type_texts.h)
                case $room in message | support | app/* | calibrate | web) ;; *) echo "$file:$line: only message/, support/, app/, calibrate/ and web/ see LCM types" ;; esac
                continue ;;
            esac
            case $header in
            */*)
                below=$(room_of "$header")
                [ "$below" = "$room" ] && continue
                case " $may " in
                *" $below "*) ;;
                *) echo "$file:$line: $room must not include $header" ;;
                esac ;;
            *) [ -f "$(dirname "$file")/$header" ] || echo "$file:$line: $header is not a path from src/" ;;
            esac
        done >>"$offences"
}

for room in src/*/; do
    room=$(basename "$room")
    [ "$room" = app ] || check_room "$room" ""
done
check_room app "-maxdepth 1"
for room in src/app/*/; do
    check_room "app/$(basename "$room")" ""
done

grep -rnoE --include='*.[ch]' --include='*.cpp' '^ *# *include "[^"]+"' drivers |
    sed -E 's/ *# *include "([^"]+)"/\1/' |
    while IFS=: read -r file line header; do
        case $header in
        fovea/* | support/* | base/elementary.h | geometry/radtan.h) ;;
        fovea_*_t.h) case $file in drivers/recorded/*) ;; *) echo "$file:$line: LCM types are for recordings" ;; esac ;;
        *) [ -f "$(dirname "$file")/$header" ] || [ -f "drivers/${header#drivers/}" ] ||
               echo "$file:$line: drivers include only include/fovea/, src/support/, src/base/elementary.h and src/geometry/radtan.h, found $header" ;;
        esac
    done >>"$offences"

if [ -s "$offences" ]; then
    cat "$offences"
    exit 1
fi
echo "layers: ok"
