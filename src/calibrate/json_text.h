/* Pieces of a verdict as JSON. */
#ifndef FOVEA_CALIBRATE_JSON_TEXT_H
#define FOVEA_CALIBRATE_JSON_TEXT_H

#include "calibrate/verdict.h"

namespace calibrate
{

std::string json_number(double value); /* 12 digits; what is not finite is null */
std::string json_numbers(const double *values, size_t count); /* [1, 2] */
std::string json_string(const std::string &text);             /* in quotes */

/* The members "verdict", "reasons" and "date", each on its line, for the head of an object. */
std::string json_verdict(const Verdict &verdict, const std::string &date);

} // namespace calibrate
#endif
