#include "bounds/runs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/grid_case.h"
#include "bounds/inertial_case.h"
#include "bounds/inertial_parts.h"
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
    LOADS = 128, /* the map that the run before saved */
    SENSES = 256 /* two cameras and an inertial sensor, whose parts alone are noted */
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
    {"shaken", "", 0, 1, 2, picture_blinks, SENSES | BRIEF},
    {"robot", NULL, 0, 1, 1, picture_film, GRIDS | SAVES | BRIEF},
    {"robot, again", NULL, 0, 1, 1, picture_film, GRIDS | LOADS | BRIEF},
};

/* The map that was saved last. */
static struct {
    uint8_t *data;
    size_t bytes; /* 0: none */
} kept;

/* ---- one step, and its units ----------------------------------------------------------------- */

static void note_parts(const struct run *run)
{
    const struct inertial_parts parts = inertial_parts_take();
    bound_note("odometry: motion by samples", run->name, parts.predicted);
    bound_note("odometry: rolling shutter", run->name, parts.placed);
    bound_note("odometry: inertial sensor", run->name, parts.stepped);
}

static void note_step(const struct fovea *rt, const struct run *run, uint64_t step)
{
    struct fovea_stats stats;
    fovea_stats_get(rt, &stats);
    if ((run->flags & TWO) != 0) {
        bound_note("stereo: two cameras", run->name,
                   (uint64_t)stats.stage_wall_ns[FOVEA_STAGE_STEREO]);
        return;
    }
    const bool grids = (run->flags & GRIDS) != 0, senses = (run->flags & SENSES) != 0;
    if (senses) note_parts(run);
    for (int stage = 0; stage < FOVEA_STAGE_JOBS; stage++) {
        const uint64_t took = (uint64_t)stats.stage_wall_ns[stage];
        step -= took;
        if (!grids && !senses)
            bound_note(fovea_stage_name((enum fovea_stage)stage), run->name, took);
    }
    bound_note(grids    ? "the rest of the step: free space"
               : senses ? "the rest of the step: inertial sensor"
                        : "the rest of the step",
               run->name, step);
}

/* What its bound is derived for. */
static bool is_noted(const struct run *run, const char *kind)
{
    if ((run->flags & (TWO | SENSES)) != 0) /* the rest is one camera's, or sees no more here */
        return strncmp(kind, "map: inertial", 13) == 0 ||
               strncmp(kind, "map: landmarks of", 17) == 0;
    return (run->flags & GRIDS) == 0 || strncmp(kind, "free space:", 11) == 0 ||
           strncmp(kind, "map:", 4) == 0 || strncmp(kind, "detect: mask", 12) == 0;
}

static void do_units(struct fovea *rt, const struct run *run, enum fovea_job job)
{
    for (int n = 0; n < UNITS_PER_FRAME; n++) {
        const enum kind kind = kind_of(rt, job);
        struct fovea_grants one = {.features = 0};
        struct fovea_outputs outputs;
        struct fovea_stats stats;
        if (kind == KIND_COUNT) return;
        one.units[job] = 1;
        (void)fovea_work(rt, &one, &outputs);
        if (outputs.map_bytes > 0) kept.bytes = outputs.map_bytes;
        if (outputs.units_done[job] == 0) return;
        fovea_stats_get(rt, &stats);
        if (is_noted(run, kind_name(kind)))
            bound_note(kind_name(kind), run->name,
                       (uint64_t)stats.stage_wall_ns[FOVEA_STAGE_JOBS + job]);
    }
}

/* The samples up to a frame, handed over at once where they come, and with the step. */
static void sense(struct fovea *rt, const struct run *run, const struct film_samples *samples)
{
    struct fovea_outputs outputs;
    const uint64_t before = counter_now();
    (void)fovea_sense(rt, samples->list, samples->count, &outputs);
    bound_note("fovea_sense", run->name, counter_now() - before);
}

static void process(struct fovea *rt, const struct run *run, const struct fovea_frame *frame,
                    const struct film_samples *samples, int n)
{
    static struct fovea_inputs inputs;
    struct fovea_outputs outputs;
    memset(&inputs, 0, sizeof inputs);
    inputs.frame = frame;
    inputs.now_ns = frame->stamp_ns;
    inputs.commands = (run->flags & SAVES) && n == 40 ? FOVEA_COMMAND_SAVE : 0;
    fovea_grants_fixed(fovea_config_get(rt), &inputs.grants);
    if (samples != NULL) {
        sense(rt, run, samples);
        inputs.samples = samples->list;
        inputs.sample_count = samples->count;
    }
    inputs.has_boxes = (run->flags & BOXES) != 0;
    inputs.boxes_stamp_ns = frame->stamp_ns;
    inputs.box_count = (run->flags & BOXES) ? FOVEA_INPUT_BOXES_MAX : 0;
    for (uint32_t i = 0; i < inputs.box_count; i++)
        inputs.boxes[i] = (struct fovea_box){0, 0, 1e4f, 1e4f};
    const uint64_t before = counter_now();
    (void)fovea_step(rt, &inputs, &outputs);
    note_step(rt, run, counter_now() - before);
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

/* The rig with an inertial sensor, its first camera's rows read one after the other. */
static void take_inertial(struct fovea_config *config, const struct runs_size *size)
{
    static struct fovea_config inertial;
    inertial_case_config(&inertial, size->width, size->height);
    config->rig = inertial.rig;
    config->rig.cameras[0].readout_ns = 20000000;
}

/* The configuration of a run, and its film. */
static void prepare(const struct run *run, const struct runs_size *size, int frames,
                    struct fovea_config *config, struct film *film)
{
    char uri[128];
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
    if ((run->flags & SENSES) != 0) take_inertial(config, size);
    if ((run->flags & LOADS) != 0) {
        fovea_map_seal(kept.data, kept.bytes);
        config->map = kept.data;
        config->map_bytes = kept.bytes;
    }
    if ((run->flags & GRIDS) != 0)
        grid_case_uri(uri, sizeof uri, size->width, size->height);
    else if ((run->flags & SENSES) != 0)
        inertial_case_uri(uri, sizeof uri, size->width, size->height);
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
    (void)inertial_parts_take(); /* what pieces and other runs had counted */
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
        const struct film_samples *samples = film.samples != NULL ? &film.samples[n] : NULL;
        if (samples != NULL) frame.stamp_ns = samples->stamp_ns;
        process(rt, run, &frame, samples, n);
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
