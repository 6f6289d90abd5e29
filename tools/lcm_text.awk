# Turn .lcm type definitions into a C table of their names and texts (see src/app/record/recording_types.c), on standard output.
# Usage: awk -f tools/lcm_text.awk include/lcmtypes/*.lcm

function end_type() { if (open_type) print "     },"; }

BEGIN { print "static const struct {\n    const char *name, *text;\n} fv_type_texts[] = {" }
FNR == 1 {
    end_type(); open_type = 1
    type = FILENAME; sub(/.*\//, "", type); sub(/\.lcm$/, "", type)
    # Files are PACKAGE_NAME_t.lcm, and every package of ours is fovea but bot_core.
    package = type ~ /^bot_core_/ ? "bot_core" : "fovea"
    printf "    {\"%s.%s\",\n", package, substr(type, length(package) + 2)
}
{
    line = $0
    gsub(/\\/, "\\\\", line); gsub(/"/, "\\\"", line)
    printf "     \"%s\\n\"\n", line
}
END { end_type(); print "};" }
