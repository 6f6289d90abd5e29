#include "calibrate/html.h"

#include <cstdarg>
#include <cstdio>
#include <cstdlib>

extern "C" {
#include "support/picture.h"
#include "support/utf8.h"
}

namespace calibrate
{

std::string formatted(const char *format, ...)
{
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    const int length = vsnprintf(nullptr, 0, format, arguments);
    va_end(arguments);
    std::string text((size_t)length + 1, '\0');
    vsnprintf(text.data(), text.size(), format, again);
    va_end(again);
    text.pop_back();
    return text;
}

std::string escaped(const std::string &text)
{
    std::string safe;
    for (const char *at = text.c_str(); *at != '\0';) {
        uint32_t code = 0;
        const int bytes = fv_utf8_decode(at, &code);
        const bool control =
            code < 0x20 || (code >= 0x7f && code < 0xa0) || code == 0xfffe || code == 0xffff;
        if (bytes == 0 || (control && code != '\n' && code != '\t'))
            safe += "\xef\xbf\xbd";
        else if (*at == '&' || *at == '<' || *at == '>' || *at == '"' || *at == '\'')
            safe += formatted("&#%d;", *at);
        else
            safe.append(at, (size_t)bytes);
        at += bytes == 0 ? 1 : bytes;
    }
    return safe;
}

std::string datum(const char *name, double value, const char *shown)
{
    if (!std::isfinite(value))
        return formatted("<data class=\"%s\" value=\"\">not known</data>", name);
    char text[64];
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
    snprintf(text, sizeof text, shown, value);
#pragma GCC diagnostic pop
    return formatted("<data class=\"%s\" value=\"%.12g\">%s</data>", name, value, text);
}

static std::string base64(const unsigned char *bytes, size_t count)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (size_t i = 0; i < count; i += 3) {
        uint32_t group = (uint32_t)bytes[i] << 16;
        if (i + 1 < count) group |= (uint32_t)bytes[i + 1] << 8;
        if (i + 2 < count) group |= bytes[i + 2];
        for (size_t k = 0; k < 4; k++)
            text += i + k <= count ? digits[(group >> (18 - 6 * k)) & 63] : '=';
    }
    return text;
}

std::string picture_uri(const Thumbnail &picture)
{
    if (picture.width <= 0 || picture.height <= 0) return "";
    fovea_image image = {};
    image.data = picture.grey.data();
    image.width = picture.width;
    image.height = picture.height;
    image.stride_bytes = picture.width;
    image.format = FOVEA_PIXEL_GREY8;
    image.size_bytes = picture.grey.size();
    unsigned char *png;
    size_t bytes;
    fv_picture_encode(&image, &png, &bytes);
    if (png == nullptr) return "";
    const std::string uri = "data:image/png;base64," + base64(png, bytes);
    std::free(png);
    return uri;
}

} // namespace calibrate
