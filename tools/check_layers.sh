#!/bin/sh
# Enforce the layers of src/README.md: a room includes only itself, the rooms below it, and public headers.
# Prints one line per offence and fails if there is any.
set -eu
cd "$(dirname "$0")/.."

allowed() { # rooms that a room may include besides itself
    case $1 in
    base)     echo "" ;;
    kernels)  echo "base" ;;
    image)    echo "base kernels" ;;
    geometry) echo "base kernels" ;;
    nn)       echo "base kernels" ;;
    features) echo "base kernels image geometry" ;;
    map)      echo "base kernels image geometry features" ;;
    odometry) echo "base kernels image geometry features map" ;;
    detect)   echo "base kernels nn" ;;
    track)    echo "base geometry" ;;
    message)  echo "" ;;
    runtime)  echo "base kernels image geometry nn features odometry map detect track message" ;;
    app)      echo "base kernels image geometry nn features odometry map detect track message runtime drivers" ;;
    *)        echo "unknown" ;;
    esac
}

offences=$(mktemp)
trap 'rm -f "$offences"' EXIT

for room in src/*/; do
    room=$(basename "$room")
    may=$(allowed "$room")
    if [ "$may" = unknown ]; then
        echo "src/$room: a room that the plan does not name" >>"$offences"
        continue
    fi
    grep -rnoE --include='*.[ch]' --include='*.cpp' --include='*.def' '^ *# *include "[^"]+"' "src/$room" |
        sed -E 's/ *# *include "([^"]+)"/\1/' |
        while IFS=: read -r file line header; do
            case $header in
            fovea/*) continue ;;
            fovea_*_t.h | bot_core_*_t.h | fovea_fields.h) [ "$room" = message ] || [ "$room" = app ] || echo "$file:$line: only message/ and app/ see LCM types" ;;
            */*)
                below=${header%%/*}
                [ "$below" = "$room" ] && continue
                case " $may " in
                *" $below "*) ;;
                *) echo "$file:$line: $room must not include $header" ;;
                esac ;;
            *) [ -f "$(dirname "$file")/$header" ] || echo "$file:$line: $header is not a path from src/" ;;
            esac
        done >>"$offences"
done

grep -rnoE --include='*.[ch]' --include='*.cpp' '^ *# *include "[^"]+"' drivers |
    sed -E 's/ *# *include "([^"]+)"/\1/' |
    while IFS=: read -r file line header; do
        case $header in
        fovea/*) ;;
        fovea_*_t.h) case $file in drivers/recorded/*) ;; *) echo "$file:$line: LCM types are for recordings" ;; esac ;;
        *) [ -f "$(dirname "$file")/$header" ] || [ -f "drivers/${header#drivers/}" ] ||
               echo "$file:$line: drivers include only include/fovea/, found $header" ;;
        esac
    done >>"$offences"

if [ -s "$offences" ]; then
    cat "$offences"
    exit 1
fi
echo "layers: ok"
