#include "inertial/reading.h"

#include "geometry/vec.h"

static const double gyro_max = 1000, acceleration_max = 100000;

static bool within(const double v[3], double most)
{
    for (int i = 0; i < 3; i++) /* false for NaN too */
        if (!(v[i] <= most && v[i] >= -most)) return false;
    return true;
}

bool fv_imu_possible(const struct fovea_imu_sample *sample)
{
    return within(sample->gyro, gyro_max) && within(sample->acceleration, acceleration_max);
}

/* Rows of a matrix and a constant; all 0: none is stated. */
static void correct(const double rows[12], const double measured[3], double out[3])
{
    if (fv_dot3(rows, rows) > 0)
        for (int r = 0; r < 3; r++)
            out[r] = fv_dot3(rows + 4 * r, measured) + rows[4 * r + 3];
    else
        fv_copy3(measured, out);
}

bool fv_imu_read(const struct fovea_rig_imu *rig, const struct fovea_imu_sample *sample,
                 struct fv_imu_reading *reading)
{
    if (__builtin_add_overflow(sample->stamp_ns, rig->time_offset_ns, &reading->stamp_ns))
        return false;
    correct(rig->gyro_correction, sample->gyro, reading->gyro);
    correct(rig->acceleration_correction, sample->acceleration, reading->acceleration);
    return true;
}
