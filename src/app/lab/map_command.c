/* fovea map: what a map file holds, as text, as files for other programs, and as a picture. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "app/lab/commands.h"
#include "support/files.h"
#include "app/lab/map_open.h"
#include "app/config/options.h"
#include "support/say.h"
#include "support/output.h"
#include "support/picture.h"
#include "base/elementary.h"
#include "fovea/odometry.h"
#include "support/text.h"

/* The unit of a map: "of 0.413 m (known by odometry to 0.6 %)", or that it is arbitrary. */
static void unit_print(const struct fv_map *map, uint32_t map_id)
{
    struct fv_map_odom odom;
    const struct fv_map_scale *scale = &odom.scale;
    if (!fv_map_odom_of(map, map_id, &odom) || scale->source == FOVEA_SCALE_FREE)
        printf(" of arbitrary length");
    else
        printf(" of %.4g m (known by %s to %.1f %%)", fv_exp(scale->log_scale),
               scale->source == FOVEA_SCALE_WHEEL_ODOMETRY ? "wheel odometry"
               : scale->source == FOVEA_SCALE_STEREO       ? "two cameras"
               : scale->source == FOVEA_SCALE_INERTIAL     ? "an inertial sensor"
                                                           : "the camera's height",
               100 * __builtin_sqrt(scale->variance));
}

/* ", gravity known to 0.12 degrees", or nothing. */
static void gravity_print(const struct fv_map *map, uint32_t map_id)
{
    struct fv_map_gravity gravity;
    if (fv_map_gravity_of(map, map_id, &gravity))
        printf(", gravity known to %.2g degrees", gravity.sigma * 180 / FV_PI);
}

/* The first map from *id on that holds keyframes. */
static bool next_map(const struct fv_map_open *open, uint32_t *id)
{
    uint32_t next = UINT32_MAX;
    for (uint32_t k = 0; k < open->map.limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &open->map.keyframes[k];
        if (keyframe->used && keyframe->map_id >= *id && keyframe->map_id < next)
            next = keyframe->map_id;
    }
    *id = next;
    return next != UINT32_MAX;
}

static void info_print(const struct fv_map_open *open, const char *path)
{
    const struct fv_map *map = &open->map;
    const struct fovea_camera *c = &open->info.camera;
    uint32_t largest = 0, slots[FV_MAP_KEYFRAMES_MAX];
    const bool any = fv_map_open_largest(open, &largest);
    printf("%s: %zu bytes, format %d, hash %016" PRIx64 "\n", path, open->file_bytes,
           (int)open->info.version, open->hash);
    printf("  camera     %d x %d, %s, f %.6g %.6g, c %.6g %.6g\n", c->width, c->height,
           c->lens == FOVEA_LENS_RADTAN ? "radtan" : "equidistant", c->fx, c->fy, c->cx, c->cy);
    printf("  keyframes  %u (slots for %u), %u frames seen\n", map->state->keyframe_count,
           map->limits.keyframes, (unsigned)open->info.frame_number);
    printf("  landmarks  %u (slots for %u), closures %u\n", map->state->landmark_count,
           map->limits.landmarks, map->state->edge_count);
    const struct fv_archive_grid *grid = &open->info.grid;
    if (grid->side > 0)
        printf("  grid       %u x %u cells of %.3g m in map %u, %u free, %u occupied\n", grid->side,
               grid->side, grid->resolution_m, grid->map_id, open->grid_free, open->grid_occupied);
    for (uint32_t id = 0; any && next_map(open, &id); id++) {
        const uint32_t count = fv_map_open_order(open, id, slots);
        uint32_t landmarks = 0;
        double length = 0, last[3], centre[3];
        for (uint32_t i = 0; i < map->limits.landmarks; i++)
            landmarks +=
                map->landmarks[i].used && fv_map_open_map_of(open, &map->landmarks[i]) == id;
        for (uint32_t i = 0; i < count; i++) {
            fv_map_open_centre(open, slots[i], centre);
            double square = 0;
            for (int k = 0; k < 3 && i > 0; k++)
                square += (centre[k] - last[k]) * (centre[k] - last[k]);
            length += __builtin_sqrt(square);
            memcpy(last, centre, sizeof last);
        }
        printf("  map %-6u %u keyframes, %u landmarks, %.4g units from keyframe to keyframe, units",
               id, count, landmarks, length);
        unit_print(map, id);
        gravity_print(map, id);
        puts(id == open->info.map_id ? ", current when saved" : "");
    }
}

/* ---- export ---------------------------------------------------------------------------------- */

static FILE *begin(struct fv_output *output, const char *option, const char *path)
{
    struct fovea_error error;
    FILE *file = NULL;
    if (fv_output_open(output, path, FV_OUTPUT_WHOLE, &error) != FOVEA_OK)
        fv_say("fovea map: %s: %s", option, error.text);
    else if ((file = fv_output_stream(output)) == NULL)
        fv_say("fovea map: %s: %s: out of memory", option, path);
    if (file == NULL) fv_output_discard(output);
    return file;
}

static enum fv_exit finish(struct fv_output *output)
{
    struct fovea_error error;
    return fv_output_close(output, &error) == FOVEA_OK ? FV_EXIT_OK
                                                       : fv_say_failed("%s", error.text);
}

/* Landmarks grey by their observers, keyframes blue; coordinates are the map's own. */
static enum fv_exit ply_write(const struct fv_map_open *open, uint32_t map_id, const char *path)
{
    const struct fv_map *map = &open->map;
    uint32_t slots[FV_MAP_KEYFRAMES_MAX], landmarks = 0;
    const uint32_t keyframes = fv_map_open_order(open, map_id, slots);
    struct fv_output output;
    FILE *file = begin(&output, "--ply", path);
    if (file == NULL) return FV_EXIT_WRONG;
    for (uint32_t i = 0; i < map->limits.landmarks; i++)
        landmarks +=
            map->landmarks[i].used && fv_map_open_map_of(open, &map->landmarks[i]) == map_id;
    fprintf(
        file,
        "ply\nformat ascii 1.0\ncomment map %u: %u landmarks, then %u keyframes\nelement vertex %u\n"
        "property double x\nproperty double y\nproperty double z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
        map_id, landmarks, keyframes, landmarks + keyframes);
    for (uint32_t i = 0; i < map->limits.landmarks; i++) {
        const struct fv_landmark *l = &map->landmarks[i];
        if (!l->used || fv_map_open_map_of(open, l) != map_id) continue;
        const int grey = 100 + 12 * l->observer_count;
        fprintf(file, "%.9g %.9g %.9g %d %d %d\n", l->point[0], l->point[1], l->point[2], grey,
                grey, grey);
    }
    for (uint32_t i = 0; i < keyframes; i++) {
        double centre[3];
        fv_map_open_centre(open, slots[i], centre);
        fprintf(file, "%.9g %.9g %.9g 31 95 168\n", centre[0], centre[1], centre[2]);
    }
    return finish(&output);
}

/* "time x y z qx qy qz qw" of every keyframe, T_world_cam. */
static enum fv_exit tum_write(const struct fv_map_open *open, uint32_t map_id, const char *path)
{
    uint32_t slots[FV_MAP_KEYFRAMES_MAX];
    const uint32_t keyframes = fv_map_open_order(open, map_id, slots);
    struct fv_output output;
    FILE *file = begin(&output, "--tum", path);
    if (file == NULL) return FV_EXIT_WRONG;
    for (uint32_t i = 0; i < keyframes; i++) {
        const struct fv_keyframe *k = &open->map.keyframes[slots[i]];
        struct fv_se3 T;
        double q[4];
        fv_se3_invert(&k->T_cam_world, &T);
        fv_so3_to_quaternion(T.R, q);
        const int64_t second = 1000000000, rest = k->stamp_ns % second;
        fprintf(file, "%" PRId64 ".%09" PRId64 " %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n",
                k->stamp_ns / second - (rest < 0), rest + (rest < 0 ? second : 0), T.t[0], T.t[1],
                T.t[2], q[1], q[2], q[3], q[0]);
    }
    return finish(&output);
}

/* ---- the command ----------------------------------------------------------------------------- */

struct asked {
    const char *action, *file, *picture, *ply, *tum, *map;
};

static enum fv_exit carry_out(const struct asked *asked, const struct fv_map_open *open)
{
    struct fovea_error error;
    uint32_t map_id = 0;
    if (strcmp(asked->action, "info") == 0) return (info_print(open, asked->file), FV_EXIT_OK);
    if (!fv_map_open_largest(open, &map_id))
        return fv_say_wrong("%s: found no keyframes, nothing to show", asked->file);
    if (asked->map != NULL) {
        int64_t number = -1;
        map_id = 0;
        if (fv_text_integer(asked->map, &number) && number >= 0 && number <= UINT32_MAX)
            map_id = (uint32_t)number;
        if (number != (int64_t)map_id || fv_map_count_keyframes(&open->map, map_id) == 0)
            return fv_say_wrong(
                "fovea map: --map: found '%.40s', expected one of the maps that 'fovea map info' lists",
                asked->map);
    }
    if (asked->picture != NULL) {
        if (fv_map_picture(open, asked->file, map_id, asked->picture, &error) == FOVEA_OK)
            return FV_EXIT_OK;
        return fv_say_failed("%s", error.text);
    }
    enum fv_exit end = asked->ply != NULL ? ply_write(open, map_id, asked->ply) : FV_EXIT_OK;
    if (end == FV_EXIT_OK && asked->tum != NULL) end = tum_write(open, map_id, asked->tum);
    return end;
}

/* NULL when the words fit together. */
static const char *trouble(const struct asked *asked, int operands)
{
    const bool draw = strcmp(asked->action, "draw") == 0,
               export = strcmp(asked->action, "export") == 0;
    if (!draw && !export && strcmp(asked->action, "info") != 0)
        return "expected info, export or draw";
    if (draw != (operands == 3))
        return draw ? "draw needs a map and a picture" : "expected one map";
    if (export && asked->ply == NULL && asked->tum == NULL) return "export needs --ply or --tum";
    if (!export && (asked->ply != NULL || asked->tum != NULL))
        return "--ply and --tum belong to export";
    if (!export && !draw && asked->map != NULL) return "--map belongs to export and draw";
    return NULL;
}

int fv_command_map(int argc, char **argv)
{
    struct asked asked = {0};
    const struct fv_option options[] = {
        {"ply", "FILE", FV_OPTION_TEXT, &asked.ply,
         "export: write landmarks and keyframes as a point cloud"},
        {"tum", "FILE", FV_OPTION_TEXT, &asked.tum,
         "export: write T_world_cam of the keyframes in TUM format"},
        {"map", "N", FV_OPTION_TEXT, &asked.map,
         "number of the map, where the file holds several (default the one with most keyframes)"},
        {0},
    };
    int first;
    struct fovea_error error;
    static struct fv_map_open open;
    const enum fv_options_result result =
        fv_options_parse(options, "info|export|draw FILE [OUT.png]", 2, 3, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    asked.action = argv[first];
    asked.file = argv[first + 1];
    asked.picture = argc - first == 3 ? argv[first + 2] : NULL;
    const char *wrong = trouble(&asked, argc - first);
    if (wrong != NULL) return fv_say_wrong("fovea map: found '%.40s', %s", asked.action, wrong);
    const struct fv_file written[] = {
        {"--ply", asked.ply}, {"--tum", asked.tum}, {"OUT.png", asked.picture}, {0}};
    const struct fv_file read[] = {{"FILE", asked.file}, {0}};
    if (fv_files_apart(written, read, &error) != FOVEA_OK ||
        fv_picture_check_name("OUT.png", asked.picture, &error) != FOVEA_OK ||
        fv_map_open(asked.file, &open, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    const enum fv_exit end = carry_out(&asked, &open);
    fv_map_open_free(&open);
    return end;
}
