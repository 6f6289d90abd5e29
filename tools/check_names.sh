#!/bin/sh
# Names of functions, types and constants: fovea_ and FOVEA_ for what is installed, fv_ and FV_ for what files share, no prefix for what
# is static; and each function that a header declares is there for the product, not for its tests alone.
# Prints one line per offence and fails if there is any.
set -eu
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# words FOLDER...: the names in the code, as tools/words.awk prints them.
words() {
    find "$@" \( -name '*.[ch]' -o -name '*.cpp' -o -name '*.def' \) -exec awk -f tools/words.awk {} +
}
words src drivers tools >"$work/product"
words tests >"$work/tests"

# A static function needs no prefix.
grep -rnE --include='*.c' --include='*.cpp' '^static [^=;]*[ *](fv|fovea)_[a-z0-9_]+\(' src drivers |
    sed -E 's/^([^:]*:[0-9]+):.*[ *]((fv|fovea)_[a-z0-9_]+)\(.*/\1: static function \2 with the prefix of shared ones/' >"$work/offences" || true

# What begins with fovea_ or FOVEA_ stands in include/fovea/ (in full, or as a prefix that a list pastes names to), is of a message
# type or an include guard, or is one of these: what the plug-ins export, and the sanitizers' builds.
exported='fovea_video_plugin_2|fovea_lettering|FOVEA_SANITIZED'
types=$(find include/lcmtypes -name 'fovea_*.lcm' | sed 's|.*/\(.*\)\.lcm|\1##|')
{
    grep -ohE '\b(fovea|FOVEA)_[A-Za-z0-9_]+(##)?' include/fovea/*.h
    printf '%s\n' "$types"
    printf '%s\n' "$types" | tr '[:lower:]' '[:upper:]'
} >"$work/installed"
awk -v exported="^($exported)\$" '
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
    $2 ~ /^(fovea|FOVEA)_./ && !known($2) {
        print $1 ": " $2 " is not in include/fovea/: names that are not installed begin with fv_ or FV_"
    }' "$work/installed" "$work/product" >>"$work/offences"

# A function that a header of src/ or drivers/ declares is called in the product: its name stands there besides in declaration and
# definition. And somebody else uses it: another file, a macro of the header, or a test.
grep -rhE --include='*.h' '\bfv_[A-Za-z0-9_]+\(' src drivers | grep -vE '^ *\*|/\*.*fv_|typedef|inline|INLINE' |
    grep -oE '^[a-z][^()]*\bfv_[A-Za-z0-9_]+\(' | sed -E 's/.*\b(fv_[A-Za-z0-9_]+)\(/\1/' | sort -u >"$work/declared"
awk '
    FILENAME == ARGV[1] { declared[$1]; next }
    FILENAME == ARGV[2] { tested[$2]; next }
    $2 in declared {
        count[$2]++
        file = $1
        sub(/:.*/, "", file)
        if (file ~ /\.h$/) { headers[$2]++; if (!($2 in where)) where[$2] = $1 }
        else if (user[$2] != "" && user[$2] != file) shared[$2]
        else user[$2] = file
    }
    END {
        for (name in declared)
            if (count[name] < 3) print where[name] ": nothing in src/, drivers/ or tools/ uses " name
            else if (headers[name] == 1 && !(name in shared) && !(name in tested))
                print where[name] ": only " user[name] " uses " name ", which can be static there"
    }' "$work/declared" "$work/tests" "$work/product" | sort >>"$work/offences"

if [ -s "$work/offences" ]; then
    cat "$work/offences"
    exit 1
fi
echo "names: ok"
