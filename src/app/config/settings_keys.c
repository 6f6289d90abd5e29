/* Every key of the configuration. To add one: a member of the struct with its default, and a row
 * here. */
#include "app/settings.h"

#define AT(member) offsetof(struct fv_settings, member)
#define TEXT_OF(member)                                                                            \
    FV_SETTINGS_TEXT, AT(member), 0, (int64_t)sizeof(((struct fv_settings *)0)->member) - 1

static const char *const scale_sources[] = {"free", "camera_height", "odometry", NULL};
static const char *const movable_boxes[] = {"none", "truth", NULL};
static const char *const track_modes[] = {"sort", "centroid", "off", NULL};
static const char *const rates[] = {"auto", "max", "real", NULL};

const struct fv_settings_key fv_settings_keys[] = {
    {"source", TEXT_OF(source), "URI", NULL,
     "where frames come from: name:address, for example sim: or euroc:DIR ('fovea run --help' lists the "
     "names)",
     NULL},
    {"camera", TEXT_OF(camera), "file", NULL,
     "calibration to use; empty: the one that belongs to the source", NULL},
    {"camera_scale", FV_SETTINGS_BOOL, AT(camera_scale), 0, 1, "", NULL,
     "scale a calibration that was made at another size of the same shape; false: refuse it", NULL},
    {"T_base_cam", FV_SETTINGS_TRANSFORM, AT(runtime.T_base_cam), -1000000, 1000000, "m", NULL,
     "three rows of four numbers [R t] that take points of the camera frame (x right, y down, z forward) to "
     "the "
     "robot's base frame (x forward, y left, z up); a row 0 0 0 1 may follow",
     NULL},
    {"mask", TEXT_OF(mask), "file", NULL,
     "PNG of the size of the frames, black where features are to be ignored (the robot's own parts), white "
     "or transparent "
     "elsewhere; empty: none",
     NULL},
    {"movable_boxes", FV_SETTINGS_CHOICE, AT(movable_boxes), 0, 1, "", movable_boxes,
     "boxes in which no features are taken, since what they show moves on its own. none; truth: of all "
     "moving objects of "
     "the simulated camera, which takes as long again as rendering",
     NULL},
    {"rate", FV_SETTINGS_CHOICE, AT(rate), 0, 2, "", rates,
     "max: every frame is processed, grants follow a fixed schedule; real: frames come by the clock, late "
     "ones are "
     "dropped; auto: real for cameras, max for recordings and the simulated camera",
     NULL},
    {"seed", FV_SETTINGS_U64, AT(runtime.seed), 0, INT64_MAX, "", NULL,
     "start of the random numbers of the run", NULL},

    {"lcm_url", TEXT_OF(lcm_url), "URL", NULL,
     "where messages are sent, as LCM understands it: udpm:// for robots (the loop waits for others); empty: "
     "nowhere",
     NULL},
    {"lcm_ttl", FV_SETTINGS_U32, AT(lcm_ttl), 0, 255, "hops", NULL,
     "how far UDP multicast travels: 0 stays on this host, 1 on this network",
     "every host on the way gets all the traffic"},
    {"channel_prefix", TEXT_OF(runtime.channel_prefix), "", NULL,
     "put before channel names, so that several cameras (one process each) can be told apart; letters, "
     "digits and "
     "_ / . -",
     NULL},
    {"pose_every", FV_SETTINGS_U32, AT(runtime.pose_every), 0, 1000000, "frames", NULL,
     "send every n-th pose message; 0: none", NULL},
    {"features_every", FV_SETTINGS_U32, AT(runtime.features_every), 0, 1000000, "frames", NULL,
     "send every n-th features message; 0: none", NULL},
    {"statistics_every", FV_SETTINGS_U32, AT(runtime.statistics_every), 0, 1000000, "frames", NULL,
     "send every n-th statistics message; 0: none", NULL},
    {"camera_status_every", FV_SETTINGS_U32, AT(runtime.camera_status_every), 0, 1000000, "frames",
     NULL, "send every n-th camera status message; 0: none", NULL},
    {"map_every", FV_SETTINGS_U32, AT(runtime.map_every), 0, 1000000, "frames", NULL,
     "send a piece of the map with every n-th frame, the next 256 landmarks and 8 keyframes; 0: none",
     NULL},
    {"record", TEXT_OF(record), "file", NULL, "record the run for replay; empty: do not", NULL},
    {"record_buffer", FV_SETTINGS_U32, AT(record_buffer), 4, 1000, "frames", NULL,
     "frames that may wait in memory for a slow disk when they come by the clock; with more the recording "
     "ends",
     "memory: a frame each"},

    {"features.count_max", FV_SETTINGS_U32, AT(runtime.features.count_max), FOVEA_FEATURES_MIN,
     FOVEA_FEATURES_MAX, "features", NULL, "corners asked of every frame, spread over the image",
     "step time and memory in proportion"},
    {"features.pyramid_levels", FV_SETTINGS_U32, AT(runtime.features.pyramid_levels), 1,
     FOVEA_PYRAMID_LEVELS_MAX, "levels", NULL,
     "levels of the pyramid, each 1.2 times smaller than the one below",
     "all eight take about 3.2 times the time and memory of one"},
    {"features.threshold", FV_SETTINGS_U32, AT(runtime.features.threshold), 2, 100, "grey levels",
     NULL, "FAST contrast that is tried first in every cell", NULL},
    {"features.threshold_min", FV_SETTINGS_U32, AT(runtime.features.threshold_min), 2, 100,
     "grey levels", NULL, "FAST contrast where a cell would stay empty; at most features.threshold",
     NULL},
    {"features.per_cell", FV_SETTINGS_U32, AT(runtime.features.per_cell), 1, 8, "features", NULL,
     "features that a cell of the grid may give: low spreads them evenly, high takes the strongest",
     NULL},

    {"odometry.enabled", FV_SETTINGS_BOOL, AT(runtime.odometry.enabled), 0, 1, "", NULL,
     "estimate the camera's motion", NULL},
    {"odometry.keyframes", FV_SETTINGS_U32, AT(runtime.odometry.keyframes), 8,
     FOVEA_ODOMETRY_KEYFRAMES_MAX, "keyframes", NULL,
     "keyframes kept in the map; the most redundant goes when it is full",
     "memory: 46 kB each at 1000 features"},
    {"odometry.landmarks", FV_SETTINGS_U32, AT(runtime.odometry.landmarks), 1000,
     FOVEA_ODOMETRY_LANDMARKS_MAX, "landmarks", NULL,
     "landmarks kept in the map; the one not seen for longest goes when it is full",
     "memory: 120 B each"},
    {"odometry.window", FV_SETTINGS_U32, AT(runtime.odometry.window), 3, 12, "keyframes", NULL,
     "keyframes optimised together after each new one", "time with the square"},
    {"odometry.inliers_good", FV_SETTINGS_U32, AT(runtime.odometry.inliers_good), 20, 200,
     "landmarks", NULL, "a pose from fewer landmarks is called weak", NULL},
    {"odometry.lost_frames_reset", FV_SETTINGS_U32, AT(runtime.odometry.lost_frames_reset), 1,
     10000, "frames", NULL, "lost for so many frames, a new map is started", NULL},

    {"detect.model", TEXT_OF(model), "file", NULL,
     "network that looks for objects (.fvm, made by tools/import); empty: none", NULL},
    {"detect.period_frames", FV_SETTINGS_U32, AT(runtime.detect.period_frames), 1, 1000000,
     "frames", NULL, "look at every so-manieth frame, when the network has finished by then", NULL},
    {"detect.count_max", FV_SETTINGS_U32, AT(runtime.detect.count_max), 1, FOVEA_DETECTIONS_MAX,
     "detections", NULL, "detections of one image, best first", "size of the message"},
    {"detect.score_threshold", FV_SETTINGS_REAL, AT(runtime.detect.score_threshold), 0, 1, "", NULL,
     "score that a detection needs at least; the model's own thresholds hold where they are higher",
     NULL},
    {"detect.iou_threshold", FV_SETTINGS_REAL, AT(runtime.detect.iou_threshold), 0, 1, "", NULL,
     "overlap (intersection over union) above which the lesser of two boxes goes; 0: the model's own",
     NULL},

    {"scale.source", FV_SETTINGS_CHOICE, AT(runtime.scale.source), 0, 2, "", scale_sources,
     "where metres come from. free: nowhere, the unit is arbitrary; camera_height: from the floor that the "
     "camera sees "
     "(set scale.camera_height_m, and T_base_cam unless the camera looks level); odometry: from wheels or "
     "legs "
     "(scale.odometry_channel)",
     NULL},
    {"scale.camera_height_m", FV_SETTINGS_REAL, AT(runtime.scale.camera_height_m), 0, 1000, "m",
     NULL, "height of the camera's optical centre over the floor, at least 0.01", NULL},
    {"scale.odometry_channel", TEXT_OF(odometry_channel), "LCM channel", NULL,
     "where odometry comes as bot_core.pose_t (include/lcmtypes/): pose of the base in a frame of its own, "
     "utime in UTC, "
     "or on the clock of the frames where their UTC is not known",
     NULL},
    {"scale.allow_unscaled", FV_SETTINGS_BOOL, AT(runtime.scale.allow_unscaled), 0, 1, "", NULL,
     "send the bot_core pose also while its unit is arbitrary; such a pose cannot say so", NULL},

    {"map.loops", FV_SETTINGS_BOOL, AT(runtime.odometry.loops), 0, 1, "", NULL,
     "close loops, and merge maps that meet", NULL},
    {"map.load", TEXT_OF(map_load), "file", NULL,
     "map to begin with, saved with the same calibration; empty: none", NULL},
    {"map.save", TEXT_OF(map_save), "file", NULL,
     "where the map is saved at the end of the run and on the command `save`; empty: nowhere",
     NULL},
    {"map.localise_only", FV_SETTINGS_BOOL, AT(runtime.odometry.localise_only), 0, 1, "", NULL,
     "keep the map as it was loaded: find the camera in it and add nothing", NULL},

    {"track.mode", FV_SETTINGS_CHOICE, AT(runtime.track.mode), 0, 2, "", track_modes,
     "sort: filtered boxes, optimal assignment in two stages; centroid: nearest centroids; off: no tracks",
     NULL},
    {"track.tracks_max", FV_SETTINGS_U32, AT(runtime.track.tracks_max), 1, FOVEA_TRACKS_MAX,
     "tracks", NULL, "tracks at a time; the weakest goes when there are more",
     "memory: 2.2 kB each"},
    {"track.confirm_hits", FV_SETTINGS_U32, AT(runtime.track.confirm_hits), 1, 100, "detections",
     NULL,
     "sort: so many detections, one after the other, confirm a track, with the mean score score_confirm",
     NULL},
    {"track.score_confirm", FV_SETTINGS_REAL, AT(runtime.track.score_confirm), 0, 1, "", NULL,
     "sort: mean score of the detections that confirm a track", NULL},
    {"track.score_high", FV_SETTINGS_REAL, AT(runtime.track.score_high), 0, 1, "", NULL,
     "sort: detections of the first stage", NULL},
    {"track.score_low", FV_SETTINGS_REAL, AT(runtime.track.score_low), 0, 1, "", NULL,
     "sort: detections of the second stage, for tracks that were seen just before; those below the model's "
     "threshold are kept for it",
     NULL},
    {"track.score_new", FV_SETTINGS_REAL, AT(runtime.track.score_new), 0, 1, "", NULL,
     "sort: a new track needs so much", NULL},
    {"track.coast_s", FV_SETTINGS_REAL, AT(runtime.track.coast_s), 0, 60, "s", NULL,
     "sort: a track unseen for longer ends; within it the object is found again", NULL},
    {"track.max_distance_px", FV_SETTINGS_REAL, AT(runtime.track.max_distance_px), 1, 10000, "px",
     NULL, "centroid: what is farther is another object", NULL},
    {"track.max_disappeared", FV_SETTINGS_U32, AT(runtime.track.max_disappeared), 0, 10000,
     "images", NULL, "centroid: a track unseen in more of them ends", NULL},
    {"track.ground", FV_SETTINGS_BOOL, AT(runtime.track.ground), 0, 1, "", NULL,
     "objects stand on the floor, z = 0 of the base frame (T_base_cam): their places in metres follow from "
     "their feet",
     NULL},
    {"track.heights", TEXT_OF(heights), "class:metres ...", NULL,
     "heights of objects by class (label, with _ for spaces, or number), from which their places in metres "
     "follow",
     NULL},
    {"track.movable", TEXT_OF(movable), "auto, class ...", NULL,
     "classes that move on their own: no features are taken in their boxes; auto: people, animals, vehicles, "
     "balls and the "
     "like, as the network has them; \"\": none",
     NULL},

    {"preview.period_frames", FV_SETTINGS_U32, AT(runtime.preview.period_frames), 0, 1000000,
     "frames", NULL, "one JPEG preview every so many frames; 0: none", NULL},
    {"preview.quality", FV_SETTINGS_U32, AT(runtime.preview.quality), 1, 100, "", NULL,
     "JPEG quality in libjpeg's scale", "bytes per preview"},
    {"preview.level", FV_SETTINGS_U32, AT(runtime.preview.level), 0, FOVEA_PYRAMID_LEVELS_MAX - 1,
     "", NULL,
     "pyramid level that is shown, less than features.pyramid_levels; 0 is the whole size", NULL},

    {"loop.priority", FV_SETTINGS_U32, AT(priority), 0, 99, "", NULL,
     "SCHED_FIFO priority of the loop thread, where permitted; 0: ordinary scheduling",
     "everything of lower priority on its processor waits longer"},
    {"loop.cpu", FV_SETTINGS_I32, AT(cpu), -1, 1023, "", NULL,
     "processor that the loop is bound to; -1: any", NULL},
    {"loop.lock_memory", FV_SETTINGS_BOOL, AT(lock_memory), 0, 1, "", NULL,
     "keep the runtime's memory from being paged out, where permitted", NULL},
};

const size_t fv_settings_key_count = sizeof fv_settings_keys / sizeof fv_settings_keys[0];

_Static_assert(sizeof fv_settings_keys / sizeof fv_settings_keys[0] <= FV_SETTINGS_KEYS_MAX,
               "raise FV_SETTINGS_KEYS_MAX");
