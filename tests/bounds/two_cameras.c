#include "bounds/two_cameras.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bounds/full_map.h"

void two_cameras_config(struct fovea_config *config, int32_t width, int32_t height)
{
    char uri[96];
    snprintf(uri, sizeof uri, "sim:corridor?width=%d&height=%d&baseline=0.11", (int)width,
             (int)height);
    fovea_config_default(config);
    config->rig = full_map_rig(uri);
}

static void fill_noise(const struct fv_pyramid *pyramid)
{
    for (uint32_t i = 0; i < pyramid->levels; i++)
        for (int32_t y = 0; y < pyramid->level[i].height; y++)
            for (int32_t x = 0; x < pyramid->level[i].width; x++)
                fv_plane_row(&pyramid->level[i], y)[x] =
                    (uint8_t)((uint32_t)(y * 7919 + x + 1) * 2654435761u >> 19);
}

void two_cameras_see(struct fovea *rt, struct fv_stereo_view views[FV_STEREO_CAMERAS])
{
    struct fv_front_end *ends[FV_STEREO_CAMERAS] = {&rt->front_end, &rt->second_front_end};
    const uint32_t features = rt->config.features.count_max,
                   looked = features < FV_STEREO_LOOKED_MAX ? features : FV_STEREO_LOOKED_MAX;
    const float x = (float)rt->config.rig.cameras[0].camera.width / 2,
                y = (float)rt->config.rig.cameras[0].camera.height / 2;
    for (int i = 0; i < FV_STEREO_CAMERAS; i++) {
        struct fovea_feature *list = ends[i]->features.list;
        const uint32_t count = i == 0 ? features : looked;
        fill_noise(&ends[i]->images.main);
        for (uint32_t f = 0; f < count; f++) {
            const bool beside = i == 1 && f + FV_STEREO_CANDIDATES_MAX < count;
            list[f] = (struct fovea_feature){.x_px = x - (i == 1 ? 4 + 0.02f * (float)f : 0),
                                             .y_px = y + (beside ? 2.2f : 0)};
        }
        memset(ends[i]->orb.descriptors, 0, (size_t)count * FV_DESCRIPTOR_BYTES);
        views[i] = (struct fv_stereo_view){.pyramid = &ends[i]->images.main,
                                           .count = count,
                                           .features = list,
                                           .descriptors = ends[i]->orb.descriptors};
    }
}
