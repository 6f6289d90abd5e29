#include "app/config/settings_renamed.h"

#include <stddef.h>
#include <string.h>

/* Every key of 0.1 that is gone; CHANGELOG.md lists them. */
static const struct {
    const char *old, *now;
} names[] = {
    {"T_base_cam", "T_body_cam"},
    {"map.loops", "map.closures"},
    {"scale.odometry_channel", "scale.wheel_odometry_channel"},
    {"track", "objects"},
    {"track.coast_s", "objects.coast_s"},
    {"track.confirm_hits", "objects.confirm_hits"},
    {"track.ground", "objects.ground"},
    {"track.heights", "objects.heights"},
    {"track.max_disappeared", "objects.max_disappeared"},
    {"track.max_distance_px", "objects.max_distance_px"},
    {"track.mode", "objects.mode"},
    {"track.movable", "objects.movable"},
    {"track.score_confirm", "objects.score_confirm"},
    {"track.score_high", "objects.score_high"},
    {"track.score_low", "objects.score_low"},
    {"track.score_new", "objects.score_new"},
    {"track.tracks_max", "objects.count_max"},
};

static const struct {
    const char *key, *old, *now;
} values[] = {
    {"scale.source", "odometry", "wheel_odometry"},
};

const char *fv_settings_renamed(const char *name)
{
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcmp(names[i].old, name) == 0) return names[i].now;
    return NULL;
}

const char *fv_settings_renamed_value(const char *key, const char *value)
{
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++)
        if (strcmp(values[i].key, key) == 0 && strcmp(values[i].old, value) == 0)
            return values[i].now;
    return NULL;
}
