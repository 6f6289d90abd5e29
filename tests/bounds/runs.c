#include "bounds/runs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/grid_case.h"
#include "bounds/kinds.h"
#include "bounds/pictures.h"
#include "bounds/table.h"
#include "bounds/two_cameras.h"

enum { UNITS_PER_FRAME = 200 }; /* so many of each job at most */

enum {
    BOXES = 1,   /* as many as a step takes, over all of the image */
    SAVES = 2,   /* the map, once */
    DETECTS = 4, /* a detector and edges run */
    FLOORS = 8,  /* the scale comes from the floor */
    BRIEF = 16,  /* a brief check plays it too */
    TWO = 32,    /* cameras, whose stage alone is noted: distances add to others */
    GRIDS = 64,  /* free space, whose units, the map's and those of masks alone are noted beside
                    what the step does for it */
    LOADS = 128  /* the map that the run before saved */
};

struct run {
    const char *name, *uri; /* of the film */
    int start, step;
    int lengths;        /* of the usual number of frames */
    picture_draw *draw; /* does without a film where uri is NULL */
    uint32_t flags;
};

static const struct run runs[] = {
    {"corridor", "sim:corridor", 0, 2, 1, picture_film, SAVES | DETECTS | BRIEF},
    {"tour, fast", "sim:tour", 100, 2, 1, picture_film, FLOORS},
    {"noise", NULL, 0, 1, 1, picture_noise, DETECTS},
    {"drifting noise", NULL, 0, 1, 1, picture_drifting, 0},
    {"tiles", NULL, 0, 1, 1, picture_tiles, 0},
    {"chequer", NULL, 0, 1, 1, picture_chequer, 0},
    {"dots", NULL, 0, 1, 1, picture_dots, BRIEF},
    {"window", "sim:corridor", 0, 2, 1, picture_window, 0},
    {"boxes", NULL, 0, 1, 1, picture_noise, BOXES},
    {"kidnapped", "sim:corridor", 0, 2, 4, picture_kidnapped, 0},
    {"loop", "sim:corridor", 0, 4, 8, picture_film, FLOORS},
    {"two cameras", "sim:corridor", 0, 2, 1, picture_film, TWO},
    {"robot", NULL, 0, 1, 1, picture_film, GRIDS | SAVES | BRIEF},
    {"robot, again", NULL, 0, 1, 1, picture_film, GRIDS | LOADS | BRIEF},
};

/* The map that was saved last. */
static struct {
    uint8_t *data;
    size_t bytes; /* 0: none */
} kept;

/* ---- one step, and its units ----------------------------------------------------------------- */

static void note_step(const struct fovea *rt, const struct run *run, uint64_t step)
{
    struct fovea_stats stats;
    fovea_stats_get(rt, &stats);
    if ((run->flags & TWO) != 0) {
        bound_note("stereo: two cameras", run->name,
                   (uint64_t)stats.stage_wall_ns[FOVEA_STAGE_STEREO]);
        return;
    }
    const bool grids = (run->flags & GRIDS) != 0;
    for (int stage = 0; stage < FOVEA_STAGE_JOBS; stage++) {
        const uint64_t took = (uint64_t)stats.stage_wall_ns[stage];
        step -= took;
        if (!grids) bound_note(fovea_stage_name((enum fovea_stage)stage), run->name, took);
    }
    bound_note(grids ? "the rest of the step: free space" : "the rest of the step", run->name,
               step);
}

/* What its bound is derived for. */
static bool is_noted(const struct run *run, const char *kind)
{
    return (run->flags & GRIDS) == 0 || strncmp(kind, "free space:", 11) == 0 ||
           strncmp(kind, "map:", 4) == 0 || strncmp(kind, "detect: mask", 12) == 0;
}

static void do_units(struct fovea *rt, const struct run *run, enum fovea_job job)
{
    for (int n = 0; n < UNITS_PER_FRAME; n++) {
        const char *kind = kind_of(rt, job);
        struct fovea_grants one = {.features = 0};
        struct fovea_outputs outputs;
        struct fovea_stats stats;
        if (kind == NULL) return;
        one.units[job] = 1;
        (void)fovea_work(rt, &one, &outputs);
        if (outputs.map_bytes > 0) kept.bytes = outputs.map_bytes;
        if (outputs.units_done[job] == 0) return;
        fovea_stats_get(rt, &stats);
        if (is_noted(run, kind))
            bound_note(kind, run->name, (uint64_t)stats.stage_wall_ns[FOVEA_STAGE_JOBS + job]);
    }
}

static void process(struct fovea *rt, const struct run *run, const struct fovea_frame *frame, int n)
{
    static struct fovea_inputs inputs;
    struct fovea_outputs outputs;
    memset(&inputs, 0, sizeof inputs);
    inputs.frame = frame;
    inputs.now_ns = frame->stamp_ns;
    inputs.commands = (run->flags & SAVES) && n == 40 ? FOVEA_COMMAND_SAVE : 0;
    fovea_grants_fixed(fovea_config_get(rt), &inputs.grants);
    inputs.has_boxes = (run->flags & BOXES) != 0;
    inputs.boxes_stamp_ns = frame->stamp_ns;
    inputs.box_count = (run->flags & BOXES) ? FOVEA_INPUT_BOXES_MAX : 0;
    for (uint32_t i = 0; i < inputs.box_count; i++)
        inputs.boxes[i] = (struct fovea_box){0, 0, 1e4f, 1e4f};
    const uint64_t before = counter_now();
    (void)fovea_step(rt, &inputs, &outputs);
    note_step(rt, run, counter_now() - before);
    if ((run->flags & TWO) != 0) {
        (void)fovea_work(rt, &inputs.grants, &outputs);
        return;
    }
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        do_units(rt, run, (enum fovea_job)job);
}

/* ---- a run ----------------------------------------------------------------------------------- */

void runs_limit(struct fovea_config *config, const struct runs_size *size)
{
    if (size->features != 0) config->features.count_max = size->features;
    if (size->keyframes != 0) config->odometry.keyframes = size->keyframes;
    if (size->landmarks != 0) config->odometry.landmarks = size->landmarks;
}

void runs_configure(struct fovea_config *config, const struct runs_size *size)
{
    full_map_config(config, size->width, size->height);
    runs_limit(config, size);
    config->edge_job.period_frames = 4;
    config->edge_job.segments = true;
    config->clock = counter_clock;
}

/* The rig of two cameras in place of the one. */
static void take_two(struct fovea_config *config, const struct runs_size *size)
{
    static struct fovea_config two;
    two_cameras_config(&two, size->width, size->height);
    config->rig = two.rig;
}

/* The robot with its grid. */
static void take_grid(struct fovea_config *config, const struct runs_size *size)
{
    grid_case_config(config, size->width, size->height);
    runs_limit(config, size);
    config->clock = counter_clock;
}

/* The configuration of a run, and its film. */
static void prepare(const struct run *run, const struct runs_size *size, int frames,
                    struct fovea_config *config, struct film *film)
{
    char uri[96];
    runs_configure(config, size);
    if ((run->flags & FLOORS) != 0) {
        config->scale.source = FOVEA_SCALE_CAMERA_HEIGHT;
        config->scale.camera_height_m = 1.2;
    }
    if (!(run->flags & DETECTS)) {
        config->detect.model = NULL;
        config->edge_job.period_frames = 0;
    }
    if ((run->flags & TWO) != 0) take_two(config, size);
    if ((run->flags & GRIDS) != 0) take_grid(config, size);
    if ((run->flags & LOADS) != 0) {
        fovea_map_seal(kept.data, kept.bytes);
        config->map = kept.data;
        config->map_bytes = kept.bytes;
    }
    if ((run->flags & GRIDS) != 0)
        grid_case_uri(uri, sizeof uri, size->width, size->height);
    else if (run->uri != NULL)
        snprintf(uri, sizeof uri, "%s?width=%d&height=%d%s", run->uri, (int)size->width,
                 (int)size->height, (run->flags & TWO) != 0 ? "&baseline=0.11" : "");
    else
        return;
    film_render(film, uri, run->start, run->step, frames);
}

static void play(const struct run *run, const struct runs_size *size)
{
    static struct fovea_config config;
    struct film film = {.width = size->width, .height = size->height};
    const int frames = size->frames * run->lengths;
    prepare(run, size, frames, &config, &film);
    struct fovea *rt = full_map_runtime(&config);
    const size_t saved_bytes = fovea_map_bytes_max(&config);
    uint8_t *pixels = malloc((size_t)film.width * film.height);
    free(kept.data);
    kept.data = malloc(saved_bytes);
    kept.bytes = 0;
    fovea_map_save_to(rt, kept.data, saved_bytes);
    for (int n = 0; n < frames; n++) {
        struct fovea_frame frame = {
            .stamp_ns = (n + 1) * INT64_C(33000000), .sequence = (uint64_t)n, .image_count = 1};
        run->draw(pixels, &film, n);
        frame.images[0] = (struct fovea_image){.data = pixels,
                                               .width = film.width,
                                               .height = film.height,
                                               .stride_bytes = film.width,
                                               .format = FOVEA_PIXEL_GREY8,
                                               .size_bytes = (size_t)film.width * film.height};
        if (film.seconds != NULL) {
            frame.image_count = 2;
            frame.images[1] = frame.images[0];
            frame.images[1].data =
                film.seconds + frame.images[0].size_bytes * (size_t)(n % film.count);
        }
        process(rt, run, &frame, n);
    }
    free(pixels);
    free(rt);
    film_free(&film);
}

void runs_play(const struct runs_size *size)
{
    for (size_t i = 0; i < sizeof runs / sizeof runs[0]; i++) {
        if ((runs[i].flags & LOADS) != 0 && kept.bytes == 0) continue;
        if (size->only != NULL ? strcmp(size->only, runs[i].name) == 0
                               : (runs[i].flags & BRIEF) != 0 || !size->brief)
            play(&runs[i], size);
    }
    free(kept.data);
    kept.data = NULL;
}
