#include "calibrate/text_file.h"

#include <cstdio>

extern "C" {
#include "support/output.h"
#include "support/say.h"
}

namespace calibrate
{

int write_text(const std::string &path, const std::string &text)
{
    fv_output output;
    fovea_error error;
    if (fv_output_open(&output, path.c_str(), FV_OUTPUT_WHOLE, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    FILE *stream = fv_output_stream(&output);
    if (stream == nullptr) {
        fv_output_discard(&output);
        return fv_say_failed("%s: out of memory", path.c_str());
    }
    (void)fwrite(text.data(), 1, text.size(), stream); /* a failure shows when it is closed */
    if (fv_output_close(&output, &error) != FOVEA_OK) return fv_say_failed("%s", error.text);
    return FV_EXIT_OK;
}

} // namespace calibrate
