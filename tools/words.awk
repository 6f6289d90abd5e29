# The names in C and C++ code, without comments, strings and includes: one line "FILE:LINE NAME" each.
# Usage: awk -f tools/words.awk FILE...
FNR == 1 { comment = 0 }
/^ *# *include/ { next }
{
    code = ""
    for (rest = $0; rest != "";)
        if (comment) {
            if ((end = index(rest, "*/")) == 0) break
            rest = substr(rest, end + 2)
            comment = 0
        } else if (match(rest, /\/\*|\/\/|"([^"\\]|\\.)*"|'([^'\\]|\\.)+'/)) {
            code = code substr(rest, 1, RSTART - 1) " "
            kind = substr(rest, RSTART, 2)
            comment = kind == "/*"
            rest = kind == "//" ? "" : substr(rest, RSTART + RLENGTH)
        } else {
            code = code rest
            rest = ""
        }
    for (; match(code, /[A-Za-z0-9_]+/); code = substr(code, RSTART + RLENGTH))
        if ((word = substr(code, RSTART, RLENGTH)) !~ /^[0-9]/) print FILENAME ":" FNR, word
}
