/* What all reports share: the page around their sections, and the verdict at its head. */
#ifndef FOVEA_CALIBRATE_REPORT_PAGE_H
#define FOVEA_CALIBRATE_REPORT_PAGE_H

#include "calibrate/verdict.h"

namespace calibrate
{

std::string section(const char *id, const char *title, const std::string &content);
std::string figure(const std::string &drawing, const std::string &caption);

/* Title, verdict, reasons and what to do next, then where the numbers come from. Texts are plain.
 */
std::string verdict_header(const std::string &title, const Verdict &verdict,
                           const std::string &next, const std::string &origin);

/* Values with their standard deviations: a row each, of which `what` is plain text, `name` and
 * `shown` are as of `datum`, and a deviation that is not finite is not shown. `lead` are cells of
 * HTML before them, and `lead_head` their heads. */
std::string value_row(const std::string &what, const char *name, double value, double stdev,
                      const char *shown = "%.3f", const std::string &lead = "");
/* The six rows of a place, in degrees and millimetres. */
std::string place_rows(const Pose &place, const std::array<double, 6> &stdev,
                       const std::string &lead = "");
std::string values_table(const std::string &rows, const char *lead_head = "");

/* The whole file around `content`. */
std::string html_page(Grade grade, const std::string &content);

} // namespace calibrate
#endif
