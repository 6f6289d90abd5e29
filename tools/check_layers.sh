#!/bin/sh
# Enforce the layers of src/README.md: a room includes only itself, the rooms below it, and public headers.
# Prints one line per offence and fails if there is any.
set -eu
cd "$(dirname "$0")/.."

allowed() { # rooms that a room may include besides itself
    core="base kernels image geometry nn features odometry scale map detect objects"
    case $1 in
    base)     echo "" ;;
    kernels)  echo "base" ;;
    image)    echo "base kernels" ;;
    geometry) echo "base kernels" ;;
    nn)       echo "base kernels" ;;
    features) echo "base kernels image geometry" ;;
    map)      echo "base kernels image geometry features" ;;
    odometry) echo "base kernels image geometry features map" ;;
    scale)    echo "base kernels geometry map odometry" ;;
    detect)   echo "base kernels nn" ;;
    objects)    echo "base geometry" ;;
    message)  echo "" ;;
    runtime)  echo "$core message" ;;
    support)  echo "base" ;;
    calibrate) echo "base kernels image message support drivers app/network" ;;
    app/network) echo "base message support drivers" ;;
    app/config)  echo "$core runtime message support drivers app/network" ;;
    app/record)  echo "$core runtime message support drivers app/network app/config" ;;
    app/lab)     echo "$core runtime message support drivers app/network app/config app/record" ;;
    app/run)     echo "$core runtime message support drivers app/network app/config app/record app/lab" ;;
    app)         echo "$core runtime message support drivers app/network app/config app/record app/lab app/run" ;;
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
            app/command.h) case $room in app/*) continue ;; esac ;; # the table of commands, for every room of the application
            fovea_*_t.h | bot_core_*_t.h | fovea_fields.h | fovea_types.h | fovea_type_texts.h)
                case $room in message | support | app/*) ;; *) echo "$file:$line: only message/, support/ and app/ see LCM types" ;; esac
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
        fovea/* | support/* | base/elementary.h) ;;
        fovea_*_t.h) case $file in drivers/recorded/*) ;; *) echo "$file:$line: LCM types are for recordings" ;; esac ;;
        *) [ -f "$(dirname "$file")/$header" ] || [ -f "drivers/${header#drivers/}" ] ||
               echo "$file:$line: drivers include only include/fovea/, src/support/ and src/base/elementary.h, found $header" ;;
        esac
    done >>"$offences"

# A static function needs no prefix: fv_ and fovea_ are for those that other files call.
grep -rnE --include='*.c' --include='*.cpp' '^static [^=;]*[ *](fv|fovea)_[a-z0-9_]+\(' src drivers |
    sed -E 's/^([^:]*:[0-9]+):.*[ *]((fv|fovea)_[a-z0-9_]+)\(.*/\1: static function \2 with the prefix of shared ones/' >>"$offences" || true

# fovea_ and FOVEA_ are for what is installed: each word of the code that begins so is one of include/fovea/ (there in full, or as a prefix
# that a list pastes names to), of a message type, an include guard, or one of these: what the plug-ins export, and the sanitizers' builds.
exported='fovea_video_plugin_2|fovea_lettering|FOVEA_SANITIZED'
installed=$(mktemp)
trap 'rm -f "$offences" "$installed"' EXIT
grep -ohE '\b(fovea|FOVEA)_[A-Za-z0-9_]+(##)?' include/fovea/*.h | sort -u >"$installed"
types=$(find include/lcmtypes -name 'fovea_*.lcm' | sed 's|.*/\(.*\)\.lcm|\1##|')
printf '%s\n' "$types" >>"$installed"
printf '%s\n' "$types" | tr a-z A-Z >>"$installed"
find src drivers tools \( -name '*.[ch]' -o -name '*.cpp' -o -name '*.def' \) -exec awk -v exported="^($exported)\$" '
    function known(word,    bytes) {
        if (word in names || word ~ exported || word ~ /^FOVEA_.*_H$/) return 1
        for (bytes = length(word); bytes > 6; bytes--)
            if (substr(word, 1, bytes) in prefixes) return 1
        return 0
    }
    FILENAME == ARGV[1] {
        if (sub(/##$/, "")) prefixes[$0]
        else names[$0]
        next
    }
    FNR == 1 { comment = 0 }
    /^ *# *include/ { next }
    {
        code = ""
        for (rest = $0; rest != "";)
            if (comment) {
                if ((end = index(rest, "*/")) == 0) break
                rest = substr(rest, end + 2)
                comment = 0
            } else if (match(rest, /\/\*|\/\/|"([^"\\]|\\.)*"|\047([^\047\\]|\\.)+\047/)) {
                code = code substr(rest, 1, RSTART - 1) " "
                kind = substr(rest, RSTART, 2)
                comment = kind == "/*"
                rest = kind == "//" ? "" : substr(rest, RSTART + RLENGTH)
            } else {
                code = code rest
                rest = ""
            }
        for (; match(code, /[A-Za-z0-9_]+/); code = substr(code, RSTART + RLENGTH)) {
            word = substr(code, RSTART, RLENGTH)
            if (word ~ /^(fovea|FOVEA)_./ && !known(word))
                printf "%s:%d: %s is not in include/fovea/: names that are not installed begin with fv_ or FV_\n", FILENAME, FNR, word
        }
    }' "$installed" {} + >>"$offences"

if [ -s "$offences" ]; then
    cat "$offences"
    exit 1
fi
echo "layers: ok"
