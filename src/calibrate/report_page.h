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

/* The whole file around `content`. */
std::string html_page(Grade grade, const std::string &content);

} // namespace calibrate
#endif
