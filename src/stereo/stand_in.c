/* The second camera in place of the first. */
#include <string.h>

#include "geometry/vec.h"
#include "stereo/stereo.h"

/* False: the first camera's lens does not show it. */
static bool move(const struct fv_stereo *s, struct fovea_feature *feature)
{
    double bearing[3], J[6], turned[3], pixel[2];
    if (!fv_bearing_of(&s->table[1], s->camera[1], (double)feature->x_px, (double)feature->y_px,
                       bearing, J))
        return false;
    fv_rotate_back3(s->T_1_0.R, bearing, turned);
    if (fovea_camera_project(s->camera[0], turned, pixel, NULL) != FOVEA_OK || !(pixel[0] >= 0) ||
        !(pixel[1] >= 0) || pixel[0] > s->camera[0]->width - 1 ||
        pixel[1] > s->camera[0]->height - 1)
        return false;
    feature->x_px = (float)pixel[0];
    feature->y_px = (float)pixel[1];
    return true;
}

uint32_t fv_stereo_stand_in(struct fv_stereo *s, const struct fv_stereo_view *second)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < second->count && count < s->features_max; i++) {
        s->moved[count] = second->features[i];
        if (!move(s, &s->moved[count])) continue;
        memcpy(s->moved_descriptors + (size_t)32 * count, second->descriptors + (size_t)32 * i, 32);
        count++;
    }
    return count;
}

void fv_stereo_centre(const struct fv_stereo *s, double centre[3])
{
    fv_rotate_back3(s->T_1_0.R, s->T_1_0.t, centre);
    for (int i = 0; i < 3; i++)
        centre[i] = -centre[i];
}
