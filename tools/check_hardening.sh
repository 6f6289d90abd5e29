#!/bin/sh
# Hold the program, its plug-ins and the shared library to what the Makefile's HARDEN and HARDLINK ask for: position-independent
# code, full RELRO, no executable stack, no segment that is both writable and executable, no relocation of text, stack protector,
# fortified functions. First it proves itself on small programs that each lack one of these.
# Usage: tools/check_hardening.sh BUILD [READELF]
set -eu
build=$1
readelf=${2:-readelf}

lacking() { # FILE: what it lacks, one word each
    headers=$($readelf -hlW "$1")
    dynamic=$($readelf -dW "$1")
    symbols=$($readelf --dyn-syms -W "$1")
    echo "$headers" | grep -qE 'Type: +DYN' || echo position-independent-code
    case $1 in *.so) ;; *) echo "$dynamic" | grep -q 'FLAGS_1.*PIE' || echo PIE ;; esac
    echo "$headers" | grep -q GNU_RELRO || echo RELRO
    echo "$dynamic" | grep -qE 'BIND_NOW|FLAGS_1.* NOW' || echo immediate-binding
    echo "$headers" | grep 'GNU_STACK' | grep -q ' RW  *0x' || echo stack-that-is-not-executable
    if echo "$headers" | grep LOAD | grep -q ' RWE '; then echo segments-not-writable-and-executable; fi
    if echo "$dynamic" | grep -q TEXTREL; then echo text-without-relocations; fi
    echo "$symbols" | grep -q __stack_chk_fail || echo stack-protector
    echo "$symbols" | grep -qE '__[a-z]+_chk(@|$)' || echo fortified-functions
}

# ---- the check itself: a program with everything passes, one without any of it is found -------------------------
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cat >"$work/small.c" <<'C'
#include <stdio.h>
#include <string.h>
int main(int argc, char **argv)
{
    char text[64];
    snprintf(text, sizeof text, "%s", argv[0]);
    memcpy(text, argv[0], (size_t)argc);
    return puts(text) < 0;
}
C
all='-O2 -fstack-protector-strong -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=2 -fPIE -pie -Wl,-z,relro,-z,now,-z,noexecstack'
trial() { # WORD FLAG...: the program lacks WORD (nothing: "") with these flags after the others
    word=$1
    shift
    # shellcheck disable=SC2086
    cc $all "$@" -o "$work/small" "$work/small.c" 2>"$work/words" || { cat "$work/words"; exit 1; }
    found=$(readelf=readelf; lacking "$work/small" | tr '\n' ' ')
    case "$word: $found" in
    ": ") ;;
    ": "*) echo "check_hardening.sh: a hardened program is said to lack: $found" && exit 1 ;;
    *": "*"$word"*) ;;
    *) echo "check_hardening.sh: a program built with $* is not seen to lack $word" && exit 1 ;;
    esac
}
trial ""
trial PIE -no-pie -fno-pie
trial RELRO -Wl,-z,norelro
trial immediate-binding -Wl,-z,lazy
trial stack-that-is-not-executable -Wl,-z,execstack
trial stack-protector -fno-stack-protector
trial fortified-functions -U_FORTIFY_SOURCE

# ---- what was built ------------------------------------------------------------------------------------------------
bad=0
held=
for file in fovea libfovea.so libfovea-messages.so fovea-video.so fovea-libcamera fovea-calibrate fovea-web; do
    [ -e "$build/$file" ] || continue
    held="$held $file"
    found=$(lacking "$build/$file" | tr '\n' ' ')
    [ -z "$found" ] || { echo "$build/$file: found no $found"; bad=1; }
done
case $held in *" fovea libfovea.so libfovea-messages.so"*) ;; *) echo "$build: found no program and library to check" && bad=1 ;; esac
[ $bad -eq 0 ] && echo "hardening: ok:$held"
exit $bad
