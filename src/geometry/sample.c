#include "geometry/sample.h"

void fv_sample_distinct(struct fv_random *random, uint32_t count, uint32_t size, uint32_t *index)
{
    /* Draw from what is left and shift past the ones taken, kept in rising order: no rejection, so
     * bounded.
     */
    uint32_t sorted[FV_SAMPLE_SIZE_MAX];
    for (uint32_t k = 0; k < size; k++) {
        uint32_t draw = fv_random_below(random, count - k), at = 0;
        while (at < k && sorted[at] <= draw) {
            draw++;
            at++;
        }
        for (uint32_t m = k; m > at; m--)
            sorted[m] = sorted[m - 1];
        sorted[at] = draw;
        index[k] = draw;
    }
}

uint32_t fv_sample_bound(double inlier_fraction, uint32_t size, double confidence)
{
    double all = 1;
    for (uint32_t k = 0; k < size; k++)
        all *= inlier_fraction;
    if (!(all > 1e-5)) return 1000000;
    if (all > 0.999) return 4;
    double needed = fv_log(1 - confidence) / fv_log(1 - all);
    return needed < 4 ? 4 : needed > 1e6 ? 1000000 : (uint32_t)needed + 1;
}
