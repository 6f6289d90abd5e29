#include "sim.h"

#include <string.h>

void fv_sim_relative(const double a[12], const double b[12], double R[9], double t[3])
{
    for (int r = 0; r < 3; r++) {
        t[r] = 0;
        for (int k = 0; k < 3; k++)
            t[r] += a[4 * k + r] * (b[4 * k + 3] - a[4 * k + 3]);
        for (int c = 0; c < 3; c++)
            R[3 * r + c] = a[r] * b[c] + a[4 + r] * b[4 + c] + a[8 + r] * b[8 + c];
    }
}

/* Unit quaternion of a rotation whose trace may have any sign: the largest of its four parts comes
 * first. */
void fv_sim_quaternion(const double R[9], double q[4])
{
    double t = R[0] + R[4] + R[8], squares[4] = {t, R[0], R[4], R[8]};
    int best = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[best]) best = i;
    double s = 0.5 * __builtin_sqrt((best == 0 ? 1 + t : 1 + 2 * squares[best] - t)), f = 0.25 / s;
    const double w[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]},
                 v[3] = {R[5] + R[7], R[2] + R[6], R[1] + R[3]};
    q[0] = best == 0 ? s : f * w[best - 1];
    for (int i = 0; i < 3; i++)
        q[i + 1] = best == 0 ? f * w[i] : best == i + 1 ? s : f * v[3 - i - (best - 1)];
    for (int i = 0; i < 4 && q[0] < 0; i++)
        q[i] = i == 0 ? q[0] : -q[i];
    if (q[0] < 0) q[0] = -q[0];
}

void fv_sim_compose(const double a[12], const double b[12], double T[12])
{
    double out[12];
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            out[4 * r + c] = a[4 * r] * b[c] + a[4 * r + 1] * b[4 + c] + a[4 * r + 2] * b[8 + c];
        out[4 * r + 3] =
            a[4 * r + 3] + a[4 * r] * b[3] + a[4 * r + 1] * b[7] + a[4 * r + 2] * b[11];
    }
    memcpy(T, out, sizeof out);
}

/* R = Rz Ry Rx: turned about the body's x axis, then its y axis, then its z axis. */
void fv_sim_pose_rows(const struct fv_uri_pose *pose, double T[12])
{
    double c[3], s[3];
    for (int i = 0; i < 3; i++) {
        const double angle = pose->rotation_deg[i] * (FV_PI / 180.0);
        c[i] = fv_cos(angle);
        s[i] = fv_sin(angle);
    }
    const double rows[12] = {c[2] * c[1],
                             c[2] * s[1] * s[0] - s[2] * c[0],
                             c[2] * s[1] * c[0] + s[2] * s[0],
                             pose->position_m[0],
                             s[2] * c[1],
                             s[2] * s[1] * s[0] + c[2] * c[0],
                             s[2] * s[1] * c[0] - c[2] * s[0],
                             pose->position_m[1],
                             0 - s[1],
                             c[1] * s[0],
                             c[1] * c[0],
                             pose->position_m[2]};
    memcpy(T, rows, sizeof rows);
}
