#include "features/refine.h"

enum { GROUP = 32 };

static const float offset_max_px = 0.75f;

/* With separable weights the basis u, v, u^2 - m, v^2 - m, u v is orthogonal (m the weighted mean
 * of u^2), so each coefficient of the least-squares fit is one weighted sum. Weights 2 9 15 9 2 per
 * axis: sum 37, of w u^2 34, of w (37 u^2 - 34)^2 69486. All sums are integers and exact. */
void fv_refine_peak(const uint8_t *scores, float offset_px[2])
{
    static const int32_t weight[5] = {2, 9, 15, 9, 2}, slope[5] = {-4, -9, 0, 9, 4},
                         bend[5] = {228, 27, -510, 27, 228};
    int32_t u_1 = 0, v_1 = 0, u_2 = 0, v_2 = 0, u_v = 0;
    for (int v = 0; v < FV_CORNER_ROWS; v++) {
        const uint8_t *row = scores + FV_CORNER_COLUMNS * v;
        int32_t sum = 0, sloped = 0, bent = 0;
        for (int u = 0; u < 5; u++) {
            sum += weight[u] * row[u];
            sloped += slope[u] * row[u];
            bent += bend[u] * row[u];
        }
        u_1 += weight[v] * sloped;
        u_2 += weight[v] * bent;
        v_1 += slope[v] * sum;
        v_2 += bend[v] * sum;
        u_v += slope[v] * sloped;
    }
    const double gu = u_1 / (37.0 * 34.0), gv = v_1 / (37.0 * 34.0), uv = u_v / (34.0 * 34.0);
    const double uu = u_2 * (2.0 / 69486.0), vv = v_2 * (2.0 / 69486.0);
    const double determinant = uu * vv - uv * uv;
    offset_px[0] = offset_px[1] = 0;
    if (!(uu < 0 && determinant > 1e-6)) return;
    const double peak[2] = {(uv * gv - vv * gu) / determinant, (uv * gu - uu * gv) / determinant};
    for (int i = 0; i < 2; i++) {
        const float at = (float)peak[i];
        offset_px[i] = at < -offset_max_px  ? -offset_max_px
                       : at > offset_max_px ? offset_max_px
                                            : at;
    }
}

/* At most GROUP corners of one level. */
static void refine_group(const struct fv_kernels *kernels, const struct fv_plane *level,
                         const struct fv_corner *corners, int count, struct fovea_feature *features)
{
    int32_t centres[GROUP] = {0};
    uint8_t scores[GROUP * FV_CORNER_SCORES];
    for (int i = 0; i < count; i++)
        centres[i] = corners[i].y * level->stride + corners[i].x;
    kernels->corner_scores_u8(scores, level->pixels, level->stride, centres, count);
    for (int i = 0; i < count; i++) {
        float offset[2];
        fv_refine_peak(scores + FV_CORNER_SCORES * i, offset);
        features[i].x_px = fv_pyramid_to_raw(corners[i].level, (float)corners[i].x + offset[0]);
        features[i].y_px = fv_pyramid_to_raw(corners[i].level, (float)corners[i].y + offset[1]);
    }
}

void fv_refine_corners(const struct fv_kernels *kernels, const struct fv_pyramid *pyramid,
                       const struct fv_corner *corners, uint32_t count,
                       struct fovea_feature *features)
{
    for (uint32_t start = 0, end; start < count; start = end) {
        for (end = start + 1;
             end < count && end - start < GROUP && corners[end].level == corners[start].level;)
            end++;
        refine_group(kernels, &pyramid->level[corners[start].level], corners + start,
                     (int)(end - start), features + start);
    }
}
