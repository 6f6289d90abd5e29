/* What the commands write alike: the pictures that are left out, and which files are made. */
#ifndef FOVEA_CALIBRATE_OUTPUTS_H
#define FOVEA_CALIBRATE_OUTPUTS_H

#include <utility>

#include "calibrate/calibrate.h"
#include "calibrate/verdict.h"

namespace calibrate
{

/* Name and reason of each picture that is left out. */
using LeftOutPictures = std::vector<std::pair<std::string, std::string>>;

/* By `reasons`, one for each view, and by the views' own where there are fewer. `prefix` stands
 * before each name. */
LeftOutPictures pictures_left_out(const std::vector<View> &views,
                                  const std::vector<std::string> &reasons,
                                  const std::string &prefix = "");

std::string json_left_out(const LeftOutPictures &pictures);    /* the last member, on lines */
std::string left_out_section(const LeftOutPictures &pictures); /* HTML; "" where there are none */
void print_left_out(const LeftOutPictures &pictures);

/* Write the two texts whose path is not empty. FV_EXIT_OK, or a line is printed. */
int write_verdict(const std::string &json_path, const std::string &json,
                  const std::string &report_path, const std::string &html);

/* Whether the result is to be written to `path`: not where none is named, nor where the calibration
 * fails, which a line says. */
bool result_wanted(const std::string &path, Grade grade);

} // namespace calibrate
#endif
