#include "calibrate/json_text.h"

#include <cstdio>
#include <cstdlib>

#include "calibrate/html.h"
extern "C" {
#include "support/json.h"
}

namespace calibrate
{

std::string json_number(double value)
{
    return std::isfinite(value) ? formatted("%.12g", value) : "null";
}

std::string json_numbers(const double *values, size_t count)
{
    std::string text = "[";
    for (size_t i = 0; i < count; i++)
        text += (i > 0 ? ", " : "") + json_number(values[i]);
    return text + "]";
}

std::string json_string(const std::string &text)
{
    char *written = nullptr;
    size_t bytes = 0;
    FILE *stream = open_memstream(&written, &bytes);
    if (stream == nullptr) return "null";
    fv_json_text(stream, text.c_str());
    const bool whole = std::fclose(stream) == 0;
    const std::string quoted = whole ? std::string(written, bytes) : "null";
    std::free(written);
    return quoted;
}

std::string json_verdict(const Verdict &verdict, const std::string &date)
{
    std::string text =
        formatted("  \"verdict\": \"%s\",\n  \"reasons\": [", grade_name(verdict.grade));
    for (size_t i = 0; i < verdict.reasons.size(); i++)
        text += formatted("%s\n    {\"grade\": \"%s\", \"text\": ", i == 0 ? "" : ",",
                          grade_name(verdict.reasons[i].grade)) +
                json_string(verdict.reasons[i].text) + "}";
    return text + "\n  ],\n  \"date\": " + json_string(date) + ",\n";
}

} // namespace calibrate
