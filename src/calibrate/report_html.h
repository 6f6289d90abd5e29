/* The verdict as one HTML file that needs nothing else: no script, no font, no picture from
 * elsewhere. */
#ifndef FOVEA_CALIBRATE_REPORT_HTML_H
#define FOVEA_CALIBRATE_REPORT_HTML_H

#include "calibrate/report.h"

namespace calibrate
{

/* Numbers stand in <data class="NAME" value="...">, by the names that the JSON verdict has. */
std::string report_html(const Report &report);

} // namespace calibrate
#endif
