/* Pieces of a self-contained HTML page that is well-formed XML, too. */
#ifndef FOVEA_CALIBRATE_HTML_H
#define FOVEA_CALIBRATE_HTML_H

#include "calibrate/calibrate.h"

namespace calibrate
{

#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
std::string
formatted(const char *format, ...);

/* Text from elsewhere, for content and for attributes in quotes. Bytes that are no UTF-8, and
 * control characters, become U+FFFD. */
std::string escaped(const std::string &text);

/* <data>: `value` in 12 digits for programs, with `shown` (a printf format
 * of a double) for people; what is not finite is "not known". `name` says what it is. */
std::string datum(const char *name, double value, const char *shown = "%.3g");

/* A picture as the URI of a PNG; empty: there is none. */
std::string picture_uri(const Thumbnail &picture);

} // namespace calibrate
#endif
