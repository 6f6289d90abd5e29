#!/bin/sh
# lcm-spy with Fovea's types: the channels that are heard, their rates, and each field of a message, live. Debian 12's
# own /usr/bin/lcm-spy does not start: it asks Java for a collector (-Xincgc) that newer ones do not have.
# Usage: tools/subscribers/lcm_spy.sh [--print] [OPTION of lcm-spy]...
# Needs a display, and default-jre liblcm-java libjchart2d-java (tools/install.sh spy); `make jar` makes build/fovea-types.jar. Jars are looked
# for in $LCM_JARS (a folder), then where Debian, a build of LCM from source and Homebrew put them. --print: the command alone.
set -eu
here=$(cd "$(dirname "$0")/../.." && pwd)

find_jar() { # find_jar NAME PACKAGE: its path, or a line and the end
    for folder in ${LCM_JARS:+"$LCM_JARS"} /usr/share/java /usr/local/share/java /opt/homebrew/share/java; do
        [ -f "$folder/$1" ] && echo "$folder/$1" && return
    done
    echo "lcm_spy.sh: found no $1, expected that of the package $2 (apt install $2), or its folder in LCM_JARS" >&2
    exit 2
}

types=$here/build/fovea-types.jar
[ -f "$types" ] || { echo "lcm_spy.sh: found no $types, expected the types: make jar" >&2; exit 2; }
command -v java >/dev/null || { echo "lcm_spy.sh: found no java, expected that of the package default-jre" >&2; exit 2; }
lcm=$(find_jar lcm.jar liblcm-java)
charts=$(find_jar jchart2d.jar libjchart2d-java)
set_of_jars=$types:$lcm:$charts
[ "${1:-}" = --print ] && { echo "java -cp $set_of_jars lcm.spy.Spy"; exit 0; }
exec java -Djava.net.preferIPv4Stack=true -Xmx256m -cp "$set_of_jars" lcm.spy.Spy "$@"
