/* sim:board: a chessboard, and a camera that looks at it from all sides, as if the board were moved
 * before the camera. Only their relative motion is in the pictures. */
#include "paint.h"

enum { SQUARES_ACROSS = 10, SQUARES_DOWN = 7, SQUARE_TEXELS = 48 };

static const double square_m = 0.03;
static const double board_height_m = 1.5; /* of its middle */
static const double fills = 0.5;          /* of the image's width, in the mean */

void fv_sim_paint_board(struct fv_sim_brush *brush)
{
    enum { WHITE = 225, BLACK = 30 };
    fv_sim_fill(brush, 0, 0, brush->width, brush->height, WHITE);
    for (int32_t j = 0; j < SQUARES_DOWN; j++) {
        for (int32_t i = (j & 1); i < SQUARES_ACROSS; i += 2) {
            const int32_t x = (i + 1) * SQUARE_TEXELS, y = (j + 1) * SQUARE_TEXELS;
            fv_sim_fill(brush, x, y, x + SQUARE_TEXELS, y + SQUARE_TEXELS, BLACK);
        }
    }
}

void fv_sim_place_board(struct fv_sim_world *world)
{
    const double width = (SQUARES_ACROSS + 2) * square_m, height = (SQUARES_DOWN + 2) * square_m;
    const double origin[3] = {0.0, 0.5 * width, board_height_m - 0.5 * height};
    const double u[3] = {0.0, -width, 0.0}, v[3] = {0.0, 0.0, height};
    /* Half a texel more, as a size is cut to whole texels. */
    const double texels_per_m = SQUARE_TEXELS / square_m, more = 0.5 / texels_per_m;
    const uint16_t texture = fv_sim_world_texture(world, FV_SIM_CHESSBOARD, width + more,
                                                  height + more, texels_per_m, false);
    fv_sim_world_face(world, origin, u, v, texture, 1.0);
}

/* Sinusoids of frequencies that share no multiple: distance, direction, place in the image, roll.
 */
void fv_sim_board_pose(const struct fv_sim_motion *motion, double time_s, double position[3],
                       double *yaw, double *pitch, double *roll)
{
    const double *p = motion->phase, half = motion->half_view[0];
    const double width = (SQUARES_ACROSS + 2) * square_m;
    const double mean = 0.5 * width * fv_cos(half) / (fv_sin(half) * fills);
    const double distance = mean * (1.0 + 0.3 * fv_sin(0.53 * time_s + p[0]));
    const double around = 0.55 * fv_sin(0.71 * time_s + p[1]);
    const double above = 0.5 * fv_sin(0.97 * time_s + p[2]);
    position[0] = -distance * fv_cos(above) * fv_cos(around);
    position[1] = -distance * fv_cos(above) * fv_sin(around);
    position[2] = board_height_m + distance * fv_sin(above);
    *yaw = around + 0.6 * half * fv_sin(1.13 * time_s + p[3]);
    *pitch = -above + 0.6 * motion->half_view[1] * fv_sin(1.31 * time_s + p[4]);
    *roll = 0.3 * fv_sin(0.41 * time_s + p[5]);
}
