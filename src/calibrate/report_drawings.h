/* Drawings of the HTML report, as inline SVG in pixels of the image. Colours that follow the page's
 * are its custom properties. */
#ifndef FOVEA_CALIBRATE_REPORT_DRAWINGS_H
#define FOVEA_CALIBRATE_REPORT_DRAWINGS_H

#include "calibrate/residuals.h"

namespace calibrate
{

/* Corners that are used, and the area that they span. */
std::string draw_coverage(const std::vector<View> &views, const Solution &solution);

/* Mean residuals of the image's parts as arrows: one as long as a cell is the RMS error. */
std::string draw_residuals(const ResidualPattern &pattern, const Solution &solution);

/* How many residuals point in each direction; independent ones fill the circle. */
std::string draw_directions(const ResidualPattern &pattern);

/* Standard deviation of projection by colour, on a logarithmic scale. Beyond the area that corners
 * span it is hatched; where the model has no ray it says so. */
std::string draw_uncertainty(const std::vector<View> &views, const Solution &solution);
/* The scale of its colours. */
std::string draw_uncertainty_scale();

/* A picture with its corners: those that are used, and those that are left out, as larger rings.
 * `residuals` is empty where the view is not used. */
std::string draw_view(const View &view, const std::vector<Pixel> &residuals);

} // namespace calibrate
#endif
