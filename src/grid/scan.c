/* The nearest obstacle of a scan by sector (fovea/grid.h). */
#include "base/elementary.h"
#include "fovea/grid.h"

static const double turn_rad = 6.283185307179586;

static bool within(double value, double least, double most)
{
    return value >= least && value <= most;
}

static bool is_usable(const struct fovea_scan *scan, const struct fovea_scan_sectors *sectors)
{
    const double width =
        sectors->step_rad < 0 ? -sectors->step_rad : sectors->step_rad; /* false for NaN below */
    return within(scan->first_rad, -100, 100) &&
           within(scan->step_rad, -turn_rad * (1 + 1e-6), turn_rad * (1 + 1e-6)) &&
           scan->count <= 65536 && (scan->ranges_m != NULL || scan->count == 0) &&
           within(sectors->first_rad, -100, 100) && within(width, 1e-3, turn_rad * (1 + 1e-6)) &&
           within(sectors->count * width, 0, turn_rad * (1 + 1e-6));
}

/* The sector that an angle is in; `sectors->count` or above: none. */
static uint32_t sector_of(const struct fovea_scan_sectors *sectors, double angle)
{
    const double width = sectors->step_rad < 0 ? -sectors->step_rad : sectors->step_rad,
                 around = turn_rad / width,
                 at = (angle - sectors->first_rad) / sectors->step_rad + 0.5,
                 once = at - around * fv_floor(at / around);
    const uint32_t sector = once > 0 ? (uint32_t)once : 0;
    /* What is left of a turn by rounding is the first one's. */
    return sector == sectors->count && around - sectors->count < 1e-3 ? 0 : sector;
}

enum fovea_status fovea_scan_nearest(const struct fovea_scan *scan,
                                     const struct fovea_scan_sectors *sectors, float *nearest_m)
{
    /* Until the end a negative number says that there was no ray, or that one is not known. */
    const float none = -1, unknown = -2;
    if (!is_usable(scan, sectors)) return FOVEA_ERROR_ARGUMENT;
    for (uint32_t k = 0; k < sectors->count; k++)
        nearest_m[k] = none;
    for (uint32_t i = 0; i < scan->count; i++) {
        const uint32_t k = sector_of(sectors, scan->first_rad + i * scan->step_rad);
        const float range = scan->ranges_m[i];
        if (k >= sectors->count) continue;
        float *nearest = &nearest_m[k];
        if (range >= 0 && range < __builtin_inff())
            *nearest = *nearest >= 0 && *nearest < range ? *nearest : range;
        else if (!(range >= 0))
            *nearest = *nearest >= 0 && *nearest < __builtin_inff() ? *nearest : unknown;
        else if (*nearest == none)
            *nearest = range;
    }
    for (uint32_t k = 0; k < sectors->count; k++)
        if (nearest_m[k] < 0) nearest_m[k] = __builtin_nanf("");
    return FOVEA_OK;
}
