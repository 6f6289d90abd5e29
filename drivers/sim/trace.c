#include "sim.h"

/* Which surface of a scene is the nearest along each ray. Loops run over arrays of rays so that the
 * compiler can use vectors. */

FV_IN_WIDE void trace_face(const struct fv_sim_surface *s, const float *restrict x,
                           const float *restrict y, int32_t count, float *restrict best,
                           int32_t *restrict hit, int32_t number)
{
    const float a = s->inverse_z[0], b = s->inverse_z[1], c = s->inverse_z[2];
    const float ua = s->u[0], ub = s->u[1], uc = s->u[2], va = s->v[0], vb = s->v[1], vc = s->v[2];
    for (int32_t i = 0; i < count; i++) {
        const float iz = a * x[i] + b * y[i] + c, u = ua * x[i] + ub * y[i] + uc,
                    v = va * x[i] + vb * y[i] + vc;
        const int32_t seen = (iz > best[i]) & (u >= 0.0f) & (v >= 0.0f) & (u <= iz) & (v <= iz);
        best[i] = seen ? iz : best[i];
        hit[i] = seen ? number : hit[i];
    }
}

FV_IN_WIDE void trace_cut(const struct fv_sim_surface *s, const float *restrict x,
                          const float *restrict y, int32_t count, float *restrict best,
                          int32_t *restrict hit, int32_t number)
{
    const float a = s->inverse_z[0], b = s->inverse_z[1], c = s->inverse_z[2];
    const float ua = s->u[0], ub = s->u[1], uc = s->u[2], va = s->v[0], vb = s->v[1], vc = s->v[2];
    const float pa = s->cut[0][0], pb = s->cut[0][1], pc = s->cut[0][2], qa = s->cut[1][0],
                qb = s->cut[1][1], qc = s->cut[1][2];
    for (int32_t i = 0; i < count; i++) {
        const float iz = a * x[i] + b * y[i] + c, u = ua * x[i] + ub * y[i] + uc,
                    v = va * x[i] + vb * y[i] + vc, p = pa * x[i] + pb * y[i] + pc,
                    q = qa * x[i] + qb * y[i] + qc;
        const int32_t seen = (iz > best[i]) & (u >= 0.0f) & (v >= 0.0f) & (u <= iz) & (v <= iz) &
                             (p >= 0.0f) & (q >= 0.0f);
        best[i] = seen ? iz : best[i];
        hit[i] = seen ? number : hit[i];
    }
}

FV_IN_WIDE void trace_disc(const struct fv_sim_surface *s, const float *restrict x,
                           const float *restrict y, int32_t count, float *restrict best,
                           int32_t *restrict hit, int32_t number)
{
    for (int32_t i = 0; i < count; i++) {
        const float iz = s->inverse_z[0] * x[i] + s->inverse_z[1] * y[i] + s->inverse_z[2];
        const float u = s->u[0] * x[i] + s->u[1] * y[i] + s->u[2] - 0.5f * iz;
        const float v = s->v[0] * x[i] + s->v[1] * y[i] + s->v[2] - 0.5f * iz;
        const int32_t seen = (iz > best[i]) & (u * u + v * v <= 0.25f * iz * iz);
        best[i] = seen ? iz : best[i];
        hit[i] = seen ? number : hit[i];
    }
}

/* |D t - p|^2 - s^2 = q0 + q1 s + q2 s^2 with s = t D.a - p.a, for D = (x, y, 1): A t^2 - 2 B t + C
 * = 0 with constant C > 0 (the camera is outside), so that 1/t = (B + sqrt(B^2 - A C)) / C is the
 * nearer intersection. */
FV_IN_WIDE void trace_round(const struct fv_sim_surface *s, const float *restrict x,
                            const float *restrict y, int32_t count, float *restrict best,
                            int32_t *restrict hit, int32_t number)
{
    const float px = s->p[0], py = s->p[1], pz = s->p[2], ax = s->a[0], ay = s->a[1], az = s->a[2];
    const float k = s->k, lean = s->k * s->pa - 0.5f * s->q1, c = s->c, over = 1.0f / s->c,
                pa = s->pa, height = s->height;
    for (int32_t i = 0; i < count; i++) {
        const float da = ax * x[i] + ay * y[i] + az, dp = px * x[i] + py * y[i] + pz;
        const float qa = x[i] * x[i] + y[i] * y[i] + 1.0f - k * da * da, qb = dp - lean * da;
        const float square = qb * qb - qa * c, positive = square > 0.0f ? square : 0.0f;
        const float iz = (qb + __builtin_sqrtf(positive)) * over,
                    up = da - pa * iz; /* up = s / z */
        const int32_t seen = (square >= 0.0f) & (iz > best[i]) & (up >= 0.0f) & (up <= height * iz);
        best[i] = seen ? iz : best[i];
        hit[i] = seen ? number : hit[i];
    }
}

FV_WIDE static void trace(const struct fv_sim_scene *scene, const uint16_t *list,
                          int32_t list_count, const float *x, const float *y, int32_t count,
                          float *inverse_z, int32_t *hit)
{
    for (int32_t i = 0; i < count; i++) {
        inverse_z[i] = 0.0f;
        hit[i] = -1;
    }
    for (int32_t k = 0; k < list_count; k++) {
        const struct fv_sim_surface *s = &scene->surface[list[k]];
        if (s->is_round)
            trace_round(s, x, y, count, inverse_z, hit, k);
        else if (s->is_cut)
            trace_cut(s, x, y, count, inverse_z, hit, k);
        else if (s->disc)
            trace_disc(s, x, y, count, inverse_z, hit, k);
        else
            trace_face(s, x, y, count, inverse_z, hit, k);
    }
}

/* Not FV_WIDE itself: clang gives such a function another name than its callers use. */
void fv_sim_trace(const struct fv_sim_scene *scene, const uint16_t *list, int32_t list_count,
                  const float *x, const float *y, int32_t count, float *inverse_z, int32_t *hit)
{
    trace(scene, list, list_count, x, y, count, inverse_z, hit);
}
