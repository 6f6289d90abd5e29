#include "support/json.h"

#include "support/utf8.h"

void fv_json_text(FILE *file, const char *text)
{
    fputc('"', file);
    while (*text != '\0') {
        uint32_t code;
        const int bytes = fv_utf8_decode(text, &code);
        if (bytes == 0)
            fputs("\\ufffd", file);
        else if (code < 0x20)
            fprintf(file, "\\u%04x", (unsigned)code);
        else
            fprintf(file, "%s%.*s", code == '"' || code == '\\' ? "\\" : "", bytes, text);
        text += bytes > 0 ? bytes : 1;
    }
    fputc('"', file);
}
