#include "calibrate/outputs.h"

#include <cstdio>

#include "calibrate/html.h"
#include "calibrate/json_text.h"
#include "calibrate/report_page.h"
#include "calibrate/text_file.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{

LeftOutPictures pictures_left_out(const std::vector<View> &views,
                                  const std::vector<std::string> &reasons,
                                  const std::string &prefix)
{
    LeftOutPictures pictures;
    for (size_t v = 0; v < views.size(); v++) {
        const std::string &why = v < reasons.size() ? reasons[v] : views[v].left_out;
        if (!why.empty()) pictures.emplace_back(prefix + views[v].name, why);
    }
    return pictures;
}

std::string json_left_out(const LeftOutPictures &pictures)
{
    std::string text = "  \"left_out\": [";
    for (size_t i = 0; i < pictures.size(); i++)
        text += std::string(i > 0 ? "," : "") +
                "\n    {\"name\": " + json_string(pictures[i].first) +
                ", \"reason\": " + json_string(pictures[i].second) + "}";
    return text + "\n  ]\n}\n";
}

std::string left_out_section(const LeftOutPictures &pictures)
{
    std::string list;
    for (const auto &[name, why] : pictures)
        list += "<li>" + escaped(name) + ": " + escaped(why) + "</li>\n";
    if (list.empty()) return "";
    return section("left-out", "Pictures that are left out, and why", "<ul>\n" + list + "</ul>\n");
}

void print_left_out(const LeftOutPictures &pictures)
{
    for (const auto &[name, why] : pictures)
        std::printf("left out  %s: %s\n", name.c_str(), why.c_str());
}

int write_verdict(const std::string &json_path, const std::string &json,
                  const std::string &report_path, const std::string &html)
{
    int status = FV_EXIT_OK;
    if (!json_path.empty()) status = write_text(json_path, json);
    if (status == FV_EXIT_OK && !report_path.empty()) status = write_text(report_path, html);
    return status;
}

bool result_wanted(const std::string &path, Grade grade)
{
    if (path.empty()) return false;
    if (grade == Grade::fail) fv_say("%s: not written, as the calibration fails", path.c_str());
    return grade != Grade::fail;
}

} // namespace calibrate
