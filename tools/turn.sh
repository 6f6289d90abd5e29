#!/bin/sh
# Print a part of a list of names, for what takes too long in every run of CI: every PARTS-th, beginning one name later with each
# commit, and those that changed in the last 40 commits, where the clone has them. The number left out goes to standard error.
# Usage: tools/turn.sh PARTS <NAMES     names of sources, one a line, as git has them
set -eu
parts=$1
commits=$(git rev-list --count HEAD 2>/dev/null) || commits=0
changed=$(git diff --name-only 'HEAD~40' 2>/dev/null) || changed=
export changed
awk -v parts="$parts" -v turn="$((commits % parts))" '
    BEGIN { n = split(ENVIRON["changed"], files, "\n"); for (i = 1; i <= n; i++) is_new[files[i]] = 1 }
    {
        if (NR % parts == turn || $0 in is_new) print
        else left++
    }
    END { if (left) printf "%d of %d are not in turn at this commit\n", left, NR >"/dev/stderr" }'
