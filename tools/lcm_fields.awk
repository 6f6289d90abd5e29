# Turn .lcm type definitions into a C table of their fields (see src/message/fields.h), on standard output.
# Usage: awk -f tools/lcm_fields.awk include/lcmtypes/*.lcm
# Understands what our types use: one struct per file, scalars, arrays, arrays of rows of constant length (p[count][3]), nested types of
# the same package.

function fail(text) { print FILENAME ":" FNR ": " text >"/dev/stderr"; failed = 1; exit 1 }

FNR == 1 { in_comment = 0; pkg = "" }
{
    sub(/\/\/.*/, "")
    while (match($0, /\/\*[^*]*\*\//)) $0 = substr($0, 1, RSTART - 1) " " substr($0, RSTART + RLENGTH)
    if (in_comment) { if (!sub(/^.*\*\//, "")) next; in_comment = 0 }
    if (sub(/\/\*.*/, "")) in_comment = 1
}
/^ *package / { pkg = $2; sub(/;.*/, "", pkg); next }
/^ *const / || /^ *}? *$/ { next }
# A type goes by its name in C.
/^ *struct / {
    type = pkg "_" $2
    types[++type_count] = type; index_of[type] = type_count - 1; full[type] = pkg "." $2
    next
}
/^ *[a-z0-9_.]+ +[a-z0-9_]+(\[[a-z0-9_]+\](\[[0-9]+\])?)? *; *$/ {
    sub(/;.*/, "")
    kind = $1
    sub(/\./, "_", kind)
    name = $2
    size = ""; row = 0
    if (match(name, /\]\[.*\]/)) { row = substr(name, RSTART + 2, RLENGTH - 3); name = substr(name, 1, RSTART) }
    if (match(name, /\[.*\]/)) { size = substr(name, RSTART + 1, RLENGTH - 2); name = substr(name, 1, RSTART - 1) }
    n = ++field_count[type]
    names[type, n] = name; kinds[type, n] = kind; sizes[type, n] = size; rows[type, n] = row; position[type, name] = n - 1
    next
}
{ fail("found \"" $0 "\", expected one field per line") }

END {
    if (failed) exit 1
    primitive["int8_t"] = "INT8"; primitive["int16_t"] = "INT16"; primitive["int32_t"] = "INT32"
    primitive["int64_t"] = "INT64"; primitive["byte"] = "BYTE"; primitive["boolean"] = "BOOLEAN"
    primitive["float"] = "FLOAT"; primitive["double"] = "DOUBLE"; primitive["string"] = "STRING"
    print "#include \"fovea_types.h\""
    for (t = 1; t <= type_count; t++) {
        type = types[t]
        printf "\nstatic const struct fv_field fields_of_%s[] = {\n", type
        for (n = 1; n <= field_count[type]; n++) {
            kind = kinds[type, n]; size = sizes[type, n]
            wire = kind in primitive ? primitive[kind] : "STRUCT"
            if (wire == "STRUCT" && !(kind in index_of)) { print type ": unknown type " kind >"/dev/stderr"; exit 1 }
            fixed = size == "" ? 1 : (size ~ /^[0-9]+$/ ? size : 0)
            if (!fixed && !((type, size) in position)) { print type ": unknown count " size >"/dev/stderr"; exit 1 }
            if (rows[type, n] && !(kind in primitive && kind != "string")) { print type ": rows of " kind >"/dev/stderr"; exit 1 }
            printf "    {\"%s\", FOVEA_WIRE_%s, %d, %d, %d, %d, %d},\n", names[type, n], wire, size != "", fixed, rows[type, n], \
                   fixed ? -1 : position[type, size], wire == "STRUCT" ? index_of[kind] : -1
        }
        print "};"
    }
    print "\nstatic const struct fovea_type fv_types[] = {"
    for (t = 1; t <= type_count; t++)
        printf "    {\"%s\", fields_of_%s, %d, __%s_get_hash},\n", full[types[t]], types[t], field_count[types[t]], types[t]
    print "};"
}
