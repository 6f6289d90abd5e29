#include "geometry/ground.h"

#include <string.h>

#include "geometry/chi_square.h"
#include "geometry/linear.h"
#include "geometry/vec.h"

enum { N = FV_GROUND_SIZE, F = FV_GROUND_FLOOR };

/* Per square root of a metre driven. */
static const double floor_tilt_walk = 0.01, floor_height_walk = 0.01;
static const double mount_tilt_walk = 0.001, mount_height_walk = 0.0005;
/* Standing: what a robot nods, and how often that is another. */
static const double nod_tilt = 0.006, nod_height_m = 0.006, stand_each_m = 0.25;
/* Landmarks: what floors are not flat by, beside the fit. */
static const double uneven_tilt = 0.004, uneven_height = 0.008;
/* What all fits of one map err by alike: more of them make nothing surer than this. */
static const double shared_tilt = 0.005, shared_height_m = 0.006;
/* Gravity: how far from level floors are, and how often that is another. */
static const double slope_sigma = 0.03, level_each_m = 2;
static const double refused_from = 16.266; /* chi square of 3 at 99.9 % */
static const double surprise2 = 9;         /* likewise, from where on standing counts for less */
static const double upright_least = 0.87;  /* cosine of 0.5 rad */

void fv_ground_init(struct fv_ground *g, double tilt_sigma_rad, double height_sigma_m)
{
    memset(g, 0, sizeof *g);
    for (int i = F; i < N; i++) {
        const double sigma = i < F + 2 ? tilt_sigma_rad : height_sigma_m;
        g->P[N * i + i] = sigma * sigma;
    }
}

void fv_ground_place(struct fv_ground *g)
{
    g->placed = g->levelled = 0;
}

/* ---- the filter ------------------------------------------------------------------------------ */

/* Mahalanobis's distance of a residual, squared; negative: S is singular. */
static double distance2(const double S[9], const double r[3])
{
    double A[9], v[3];
    memcpy(A, S, sizeof A);
    fv_copy3(r, v);
    return fv_ldlt_solve(A, 3, v) ? fv_dot3(r, v) : -1;
}

/* HP, and S = H P H'. */
static void project(const struct fv_ground *g, const double H[F][N], double HP[F][N], double S[9])
{
    for (int r = 0; r < F; r++)
        for (int c = 0; c < N; c++) {
            HP[r][c] = 0;
            for (int k = 0; k < N; k++)
                HP[r][c] += H[r][k] * g->P[N * k + c];
        }
    for (int r = 0; r < F; r++)
        for (int c = 0; c < F; c++) {
            S[3 * r + c] = 0;
            for (int k = 0; k < N; k++)
                S[3 * r + c] += HP[r][k] * H[c][k];
        }
}

/* x += K r, P -= K S K', with K' = S^-1 H P. False, and nothing is changed: S is singular. */
static bool correct(struct fv_ground *g, const double HP[F][N], const double S[9],
                    const double r[3])
{
    double A[9], v[3], gain[F][N], P[N * N];
    for (int c = 0; c < N; c++) {
        memcpy(A, S, sizeof A);
        for (int k = 0; k < F; k++)
            v[k] = HP[k][c];
        if (!fv_ldlt_solve(A, 3, v)) return false;
        for (int k = 0; k < F; k++)
            gain[k][c] = v[k];
    }
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < F; k++)
            g->x[i] += gain[k][i] * r[k];
        for (int c = 0; c < N; c++) {
            P[N * i + c] = g->P[N * i + c];
            for (int k = 0; k < F; k++)
                P[N * i + c] -= gain[k][i] * HP[k][c];
        }
    }
    for (int i = 0; i < N; i++)
        for (int c = 0; c < N; c++)
            g->P[N * i + c] = 0.5 * (P[N * i + c] + P[N * c + i]);
    return true;
}

/* ---- driving --------------------------------------------------------------------------------- */

/* The body: its heading in odom, and the slopes of its x-y plane there with its height. */
struct stance {
    double cosine, sine, plane[F];
};

/* False: the body is not upright. */
static bool stance_of(const struct fv_se3 *T, struct stance *stance)
{
    const double *R = T->R, length = __builtin_sqrt(R[0] * R[0] + R[3] * R[3]);
    if (!(R[8] >= upright_least && length > 0.1)) return false;
    *stance = (struct stance){R[0] / length, R[3] / length, {-R[2] / R[8], -R[5] / R[8], T->t[2]}};
    return true;
}

/* What the mount says in the axes of odom. */
static void turned(const struct stance *s, const double in[F], double out[F])
{
    out[0] = s->cosine * in[0] - s->sine * in[1];
    out[1] = s->sine * in[0] + s->cosine * in[1];
    out[2] = in[2];
}

static double nod2(int i)
{
    return i < 2 ? nod_tilt * nod_tilt : nod_height_m * nod_height_m;
}

/* The floor from the stance and the mount. */
static void place(struct fv_ground *g, const struct stance *s)
{
    double A[F][F] = {{s->cosine, -s->sine, 0}, {s->sine, s->cosine, 0}, {0, 0, 1}}, cross[F][F];
    turned(s, g->x + F, g->x);
    for (int r = 0; r < F; r++) {
        g->x[r] += s->plane[r];
        for (int c = 0; c < F; c++) {
            cross[r][c] = 0;
            for (int k = 0; k < F; k++)
                cross[r][c] += A[r][k] * g->P[N * (F + k) + F + c];
            g->P[N * r + F + c] = g->P[N * (F + c) + r] = cross[r][c];
        }
    }
    for (int r = 0; r < F; r++)
        for (int c = 0; c < F; c++) {
            double sum = r == c ? nod2(r) : 0;
            for (int k = 0; k < F; k++)
                sum += cross[r][k] * A[c][k];
            g->P[N * r + c] = sum;
        }
    g->placed = 1;
}

/* Measure 0 = floor - stance - mount; what surprises counts for less. */
static void stand(struct fv_ground *g, const struct stance *s)
{
    const double H[F][N] = {
        {1, 0, 0, -s->cosine, s->sine, 0}, {0, 1, 0, -s->sine, -s->cosine, 0}, {0, 0, 1, 0, 0, -1}};
    double mount[F], HP[F][N], S[9], r[3];
    turned(s, g->x + F, mount);
    for (int i = 0; i < F; i++)
        r[i] = s->plane[i] + mount[i] - g->x[i];
    project(g, H, HP, S);
    for (int i = 0; i < F; i++)
        S[4 * i] += nod2(i);
    const double far2 = distance2(S, r) / surprise2;
    for (int i = 0; i < F && far2 > 1; i++)
        S[4 * i] += (far2 - 1) * nod2(i);
    (void)correct(g, HP, S, r);
}

/* Along the plane by a step: height += slope . step. */
static void carry(double x[F], double *P, int stride, const double step[2])
{
    x[2] += x[0] * step[0] + x[1] * step[1];
    for (int c = 0; c < stride; c++)
        P[stride * 2 + c] += P[c] * step[0] + P[stride + c] * step[1];
    for (int r = 0; r < stride; r++)
        P[stride * r + 2] += P[stride * r] * step[0] + P[stride * r + 1] * step[1];
}

void fv_ground_drive(struct fv_ground *g, const struct fv_se3 *T_odom_body)
{
    static const double walk[N] = {floor_tilt_walk, floor_tilt_walk, floor_height_walk,
                                   mount_tilt_walk, mount_tilt_walk, mount_height_walk};
    struct stance s;
    if (!stance_of(T_odom_body, &s)) {
        fv_ground_place(g);
        return;
    }
    const double step[2] = {T_odom_body->t[0] - g->position[0], T_odom_body->t[1] - g->position[1]};
    g->position[0] = T_odom_body->t[0];
    g->position[1] = T_odom_body->t[1];
    if (!g->placed) {
        place(g, &s);
        g->stood_m = g->driven_m;
        return;
    }
    const double way = __builtin_sqrt(step[0] * step[0] + step[1] * step[1]);
    g->driven_m += way;
    carry(g->x, g->P, N, step);
    for (int i = 0; i < N; i++)
        g->P[N * i + i] += walk[i] * walk[i] * way;
    if (g->driven_m - g->stood_m < stand_each_m) return;
    g->stood_m = g->driven_m;
    stand(g, &s);
}

/* ---- landmarks and gravity ------------------------------------------------------------------- */

/* Covariance of x = down / height in the camera's frame: of the points, and of some 1 rad of tilt
 * where they leave it open. */
static bool covariance_of(const struct fv_floor *floor, double C[9])
{
    const double open = 0.5 * floor->height * floor->height;
    double A[6], I[6];
    memcpy(A, floor->information, sizeof A);
    A[0] += open;
    A[3] += open;
    A[5] += open;
    if (!fv_invert_symmetric3(A, I)) return false;
    const double all[9] = {I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5]};
    memcpy(C, all, sizeof all);
    return true;
}

/* out = J C J' */
static void sandwich(const double J[9], const double C[9], double out[9])
{
    double JC[9], T[9];
    fv_multiply33(J, C, JC);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            T[3 * r + c] = J[3 * c + r];
    fv_multiply33(JC, T, out);
}

/* The fitted plane as slopes and height in odom, with its covariance. In odom the plane is y . (p -
 * t) = 1 with y = R x: z = t_z + (1 - y_x (p_x - t_x) - y_y (p_y - t_y)) / y_z. */
static bool plane_of(const struct fv_ground *g, const struct fv_se3 *T,
                     const struct fv_floor *floor, double z[F], double M[9])
{
    double y[3], J[9], JR[9], C[9];
    fv_rotate3(T->R, floor->down, y);
    for (int i = 0; i < 3; i++)
        y[i] /= floor->height;
    if (!(-y[2] * floor->height >= upright_least) || !covariance_of(floor, C)) return false;
    const double to[2] = {T->t[0] - g->position[0], T->t[1] - g->position[1]},
                 said = 1 + y[0] * to[0] + y[1] * to[1];
    z[0] = -y[0] / y[2];
    z[1] = -y[1] / y[2];
    z[2] = T->t[2] + said / y[2];
    const double rows[9] = {-1 / y[2],
                            0,
                            y[0] / (y[2] * y[2]),
                            0,
                            -1 / y[2],
                            y[1] / (y[2] * y[2]),
                            to[0] / y[2],
                            to[1] / y[2],
                            -said / (y[2] * y[2])};
    memcpy(J, rows, sizeof J);
    fv_multiply33(J, T->R, JR);
    sandwich(JR, C, M);
    return true;
}

bool fv_ground_see(struct fv_ground *g, const struct fv_se3 *T_odom_cam,
                   const struct fv_floor *floor, double height_sigma)
{
    static const double H[F][N] = {{1, 0, 0, 0, 0, 0}, {0, 1, 0, 0, 0, 0}, {0, 0, 1, 0, 0, 0}};
    double z[F], M[9], HP[F][N], S[9], r[3];
    if (!g->placed || !plane_of(g, T_odom_cam, floor, z, M)) return false;
    const bool heightless = height_sigma == __builtin_inf();
    const double high = heightless ? 0 : height_sigma * floor->height,
                 uneven = uneven_height * floor->height;
    M[0] += uneven_tilt * uneven_tilt;
    M[4] += uneven_tilt * uneven_tilt;
    M[8] += uneven * uneven + high * high;
    for (int i = 0; i < F; i++)
        r[i] = z[i] - g->x[i];
    if (heightless) { /* a height that nothing is known of */
        r[2] = 0;
        M[2] = M[5] = M[6] = M[7] = 0;
        M[8] = 1e6;
    }
    project(g, H, HP, S);
    for (int i = 0; i < 9; i++)
        S[i] += M[i];
    const double far2 = distance2(S, r);
    if (!(far2 >= 0 && far2 < refused_from) || !correct(g, HP, S, r)) {
        g->refused++;
        return false;
    }
    for (int i = 0; i < N; i++) {
        const double least = i % F < 2 ? shared_tilt : shared_height_m;
        if (g->P[(N + 1) * i] < least * least) g->P[(N + 1) * i] = least * least;
    }
    g->taken++;
    return true;
}

void fv_ground_level(struct fv_ground *g, const double slope[2], double sigma_rad)
{
    static const double H[F][N] = {{1, 0, 0, 0, 0, 0}, {0, 1, 0, 0, 0, 0}, {0}};
    double HP[F][N], S[9];
    if (!g->placed || (g->levelled && g->driven_m - g->levelled_m < level_each_m)) return;
    const double variance = slope_sigma * slope_sigma + sigma_rad * sigma_rad,
                 r[3] = {slope[0] - g->x[0], slope[1] - g->x[1], 0};
    g->levelled = 1;
    g->levelled_m = g->driven_m;
    project(g, H, HP, S);
    S[0] += variance;
    S[4] += variance;
    S[8] = 1; /* the third says nothing */
    (void)correct(g, HP, S, r);
}

/* ---- results --------------------------------------------------------------------------------- */

bool fv_ground_at(const struct fv_ground *g, const double position[2],
                  struct fv_ground_plane *plane)
{
    const double step[2] = {position[0] - g->position[0], position[1] - g->position[1]};
    double x[F], P[F * F];
    if (!g->placed) return false;
    memcpy(x, g->x, sizeof x);
    for (int r = 0; r < F; r++)
        memcpy(P + F * r, g->P + N * r, F * sizeof *P);
    carry(x, P, F, step);
    *plane = (struct fv_ground_plane){{x[0], x[1]}, x[2], {P[0], P[1], P[2], P[4], P[5], P[8]}};
    return true;
}

void fv_ground_down(const struct fv_ground *g, const struct fv_se3 *T_odom_cam, double down[3])
{
    double normal[3] = {g->x[0], g->x[1], -1};
    (void)fv_normalise3(normal);
    fv_rotate_back3(T_odom_cam->R, normal, down);
}
