#!/bin/sh
# Print docs/messages.md with its last part, the types, made anew from include/lcmtypes/.
# Usage: tools/messages_md.sh >build/messages.md
set -eu
cd "$(dirname "$0")/.."
sed '/^## Every type/q' docs/messages.md
echo
echo "From \`include/lcmtypes/\`, by \`make docs\`. A comment that goes on beside the next fields is about all of them."
for file in include/lcmtypes/*.lcm; do
    name=$(sed -n 's/^package \([a-z_]*\);.*/\1/p' "$file").$(sed -n 's/^struct \([a-z0-9_]*\) .*/\1/p' "$file")
    printf '\n### %s\n\n```c\n' "$name"
    sed -e '/^package /d' -e '/./,$!d' "$file"
    echo '```'
done
