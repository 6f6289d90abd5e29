/* A number that moves at nearly constant velocity, estimated by a Kalman filter: position, velocity
 * and their covariance. White noise of the velocity's change drives it (Bar-Shalom, Li and
 * Kirubarajan, 2001, section 6.2.2). Real-time safe. */
#ifndef FOVEA_OBJECTS_FILTER_H
#define FOVEA_OBJECTS_FILTER_H

struct fv_filter {
    double x, v, xx, xv, vv;
};

static inline void fv_filter_start(struct fv_filter *f, double x, double x_sigma, double v_sigma)
{
    *f = (struct fv_filter){x, 0, x_sigma * x_sigma, 0, v_sigma * v_sigma};
}

/* `noise`: variance that the velocity gains per second. */
static inline void fv_filter_predict(struct fv_filter *f, double dt_s, double noise)
{
    f->x += dt_s * f->v;
    f->xx += dt_s * (2 * f->xv + dt_s * (f->vv + noise * dt_s / 3));
    f->xv += dt_s * (f->vv + noise * dt_s / 2);
    f->vv += noise * dt_s;
}

static inline void fv_filter_update(struct fv_filter *f, double measured, double variance)
{
    const double gain_x = f->xx / (f->xx + variance), gain_v = f->xv / (f->xx + variance),
                 off = measured - f->x;
    f->x += gain_x * off;
    f->v += gain_v * off;
    f->vv -= gain_v * f->xv;
    f->xv -= gain_x * f->xv;
    f->xx -= gain_x * f->xx;
}

#endif
