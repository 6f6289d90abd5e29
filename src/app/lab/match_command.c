/* fovea match: which features of two pictures belong together. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "support/aligned.h"
#include "support/canvas.h"
#include "app/lab/commands.h"
#include "app/lab/extract.h"
#include "support/files.h"
#include "support/picture.h"
#include "app/config/options.h"
#include "support/say.h"
#include "support/text.h"
#include "fovea/match.h"

/* Two pictures and what was matched. */
struct pair {
    struct fv_extract a, b;
    struct fovea_match_config config;
    struct fovea_matched matched;
    void *memory; /* of the matches */
    double search_ms;
};

/* The pictures side by side, a line for every inlier, its colour by turns; other matches are grey.
 */
static enum fovea_status draw(const struct pair *pair, const char *path, struct fovea_error *error)
{
    static const uint32_t colours[6] = {0xff5544, 0xffbb33, 0xaadd33, 0x33ccbb, 0x4499ff, 0xdd77ff};
    const struct fv_extract *a = &pair->a, *b = &pair->b;
    const int shift = a->image.width;
    const int height = a->image.height > b->image.height ? a->image.height : b->image.height;
    struct fv_canvas canvas;
    enum fovea_status status = fv_canvas_create(&canvas, shift + b->image.width, height, 0);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%.300s: out of memory", path);
    fv_canvas_image(&canvas, 0, 0, &a->image);
    fv_canvas_image(&canvas, shift, 0, &b->image);
    for (uint32_t inlier = 0; inlier < 2; inlier++) /* inliers above the others */
        for (uint32_t i = 0; i < pair->matched.count; i++) {
            const struct fovea_match *match = &pair->matched.matches[i];
            const struct fovea_local_feature *p = &a->found.features[match->a],
                                             *q = &b->found.features[match->b];
            if (match->inlier != inlier) continue;
            const uint32_t colour = inlier ? colours[i % 6] : 0x808080;
            fv_canvas_line(&canvas, p->x_px, p->y_px, q->x_px + (float)shift, q->y_px, 1, colour);
            fv_canvas_disc(&canvas, p->x_px, p->y_px, 2.5f, colour);
            fv_canvas_disc(&canvas, q->x_px + (float)shift, q->y_px, 2.5f, colour);
        }
    status = fv_canvas_write(&canvas, path, error);
    fv_canvas_free(&canvas);
    return status;
}

static void print_json(const struct pair *pair)
{
    const struct fovea_matched *matched = &pair->matched;
    printf(
        "{\"features\": [%u, %u], \"method\": \"%s\", \"matcher\": \"brute_force\", \"search_ms\": %.3f, "
        "\"geometry\": \"%s\", \"asked\": \"%s\", \"inliers\": %u, \"model\": [",
        pair->a.found.count, pair->b.found.count, fovea_feature_method_name(pair->a.config.method),
        pair->search_ms, fovea_match_geometry_name(matched->geometry),
        fovea_match_geometry_name(pair->config.geometry), matched->inlier_count);
    for (int i = 0; i < 9; i++)
        printf("%s%.9g", i == 0 ? "" : ", ", matched->model[i]);
    printf("], \"matches\": [");
    for (uint32_t i = 0; i < matched->count; i++) {
        const struct fovea_match *match = &matched->matches[i];
        const struct fovea_local_feature *p = &pair->a.found.features[match->a],
                                         *q = &pair->b.found.features[match->b];
        printf(
            "%s\n  {\"a\": %u, \"b\": %u, \"a_px\": [%.4f, %.4f], \"b_px\": [%.4f, %.4f], \"distance\": %g, \"inlier\": %s}",
            i == 0 ? "" : ",", match->a, match->b, (double)p->x_px, (double)p->y_px,
            (double)q->x_px, (double)q->y_px, (double)match->distance,
            match->inlier ? "true" : "false");
    }
    printf("\n]}\n");
}

/* Of inliers, between the pictures. */
static double most_moved(const struct pair *pair)
{
    double most = 0;
    for (uint32_t i = 0; i < pair->matched.count; i++) {
        const struct fovea_match *match = &pair->matched.matches[i];
        const struct fovea_local_feature *p = &pair->a.found.features[match->a],
                                         *q = &pair->b.found.features[match->b];
        const double x = (double)(q->x_px - p->x_px), y = (double)(q->y_px - p->y_px);
        if (match->inlier && x * x + y * y > most) most = x * x + y * y;
    }
    return __builtin_sqrt(most);
}

static void print_summary(const struct pair *pair)
{
    const struct fovea_matched *matched = &pair->matched;
    printf("%u matches of %u and %u features", matched->count, pair->a.found.count,
           pair->b.found.count);
    if (pair->config.geometry != FOVEA_MATCH_ANY)
        printf(", %u inliers of the %s", matched->inlier_count,
               fovea_match_geometry_name(matched->geometry));
    printf(", searched in %.1f ms\n", pair->search_ms);
    if (matched->geometry != pair->config.geometry)
        printf("no %s matrix is determined: a homography explains the matches (%s), which move by "
               "%.1f px at most\n",
               fovea_match_geometry_name(pair->config.geometry),
               pair->config.geometry == FOVEA_MATCH_ESSENTIAL
                   ? "a camera that turned, or did not move"
                   : "a plane, or a camera that turned or did not move",
               most_moved(pair));
    for (int i = 0; i < 9 && matched->inlier_count > 0 && pair->config.geometry != FOVEA_MATCH_ANY;
         i += 3)
        printf("  %12.6g %12.6g %12.6g\n", matched->model[i], matched->model[i + 1],
               matched->model[i + 2]);
}

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static enum fovea_status match(struct pair *pair, struct fovea_error *error)
{
    struct fovea_matcher *matcher;
    pair->config.descriptor_bytes = pair->a.found.descriptor_bytes; /* SIFT's or SURF's */
    const size_t bytes = fovea_match_size(&pair->config, error);
    if (bytes == 0) return FOVEA_ERROR_ARGUMENT;
    pair->memory = fv_aligned_new(bytes);
    if (pair->memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory: %zu bytes", bytes);
    enum fovea_status status =
        fovea_match_init(&matcher, &pair->config, pair->memory, bytes, error);
    if (status != FOVEA_OK) return status;
    const double start = now_ms();
    status = fovea_match_run(matcher, &pair->a.found, &pair->b.found, &pair->matched);
    pair->search_ms = now_ms() - start;
    return status;
}

enum {
    VERIFIED =
        1 << FOVEA_MATCH_HOMOGRAPHY | 1 << FOVEA_MATCH_ESSENTIAL | 1 << FOVEA_MATCH_FUNDAMENTAL
};

static const struct fv_member_option table[] = {
    {"residual", "PIXELS", "largest residual of an inlier, in B (0.1 to 50, default 3)",
     FV_MEMBER_FLOAT, "threshold_px", offsetof(struct fovea_match_config, threshold_px), VERIFIED,
     "--geometry homography, essential or fundamental"},
    {"samples", "N", "most samples of matches that --geometry is computed from (default 2000)",
     FV_MEMBER_WHOLE, "samples_max", offsetof(struct fovea_match_config, samples_max), VERIFIED,
     "--geometry homography, essential or fundamental"},
    {0},
};

/* What the command line says, before it is read. */
struct request {
    struct fv_extract_request features;
    struct fv_member_options members;
    const char *matcher, *geometry, *focal, *centre;
    uint64_t ratio;
    bool no_cross_check;
};

static bool read_numbers(const char *text, int count, double *values)
{
    for (int i = 0; i < count; i++) {
        char word[32];
        const size_t length = strcspn(text, ",");
        if (length >= sizeof word || (text[length] == ',') != (i + 1 < count)) return false;
        memcpy(word, text, length);
        word[length] = '\0';
        if (!fv_text_number(word, &values[i])) return false;
        text += length + 1;
    }
    return true;
}

/* A pinhole camera: its focal length, and its principal point, the middle of A by default. */
static enum fovea_status read_camera(const struct request *request, const struct fovea_image *image,
                                     struct fovea_match_config *config, struct fovea_error *error)
{
    double focal = 0, centre[2] = {(image->width - 1) / 2., (image->height - 1) / 2.};
    if (!read_numbers(request->focal, 1, &focal) || !(focal >= 1) || focal > 1e5)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--focal: found '%.100s', expected pixels from 1 to 100000",
                               request->focal);
    if (request->centre != NULL && !read_numbers(request->centre, 2, centre))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--centre: found '%.100s', expected X,Y in pixels", request->centre);
    config->focal_px = (float)focal;
    config->centre_px[0] = (float)centre[0];
    config->centre_px[1] = (float)centre[1];
    return FOVEA_OK;
}

static const char *geometry_name(int geometry)
{
    return fovea_match_geometry_name((enum fovea_match_geometry)geometry);
}

static enum fovea_status read_request(const struct request *request,
                                      struct fovea_extract_config *extract,
                                      struct fovea_match_config *config, struct fovea_error *error)
{
    if (request->ratio < 1 || request->ratio > 100)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--ratio: found %" PRIu64 ", expected 1 to 100 (percent)",
                               request->ratio);
    if (request->matcher != NULL && strcmp(request->matcher, "brute_force") != 0)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT, "--matcher: found '%.100s', expected brute_force%s",
            request->matcher,
            strcmp(request->matcher, "approximate") == 0
                ? ": the exact search is faster than an approximate one (docs/operations.md)"
                : "");
    enum fovea_status status = fv_extract_config(&request->features, extract, error);
    if (status != FOVEA_OK) return status;
    fovea_match_config_default(config, extract->descriptor);
    config->count_max = extract->count_max;
    config->ratio = (float)request->ratio / 100;
    config->cross_check = !request->no_cross_check;
    int geometry = FOVEA_MATCH_FUNDAMENTAL;
    status = fv_choice_read("geometry", request->geometry, geometry_name,
                            FOVEA_MATCH_GEOMETRY_COUNT, &geometry, error);
    if (status != FOVEA_OK) return status;
    config->geometry = (enum fovea_match_geometry)geometry;
    if (geometry == FOVEA_MATCH_ESSENTIAL && request->focal == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--focal: found none, expected pixels from 1 to 100000: the "
                               "essential matrix needs a camera");
    if (geometry != FOVEA_MATCH_ESSENTIAL && (request->focal != NULL || request->centre != NULL))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "--%s: found it without effect, expected --geometry essential",
                               request->focal != NULL ? "focal" : "centre");
    return fv_member_options_read(&request->members, 1u << geometry, config, error);
}

/* Read both pictures, match, and write what was asked for. */
static enum fv_exit run(const struct request *request, const struct fovea_extract_config *extract,
                        char **paths, struct pair *pair, const char *picture, bool json)
{
    struct fovea_error error = {0};
    enum fovea_status status = fv_extract(paths[0], NULL, extract, &pair->a, &error);
    if (status == FOVEA_OK) status = fv_extract(paths[1], NULL, extract, &pair->b, &error);
    if (status == FOVEA_OK && pair->config.geometry == FOVEA_MATCH_ESSENTIAL)
        status = read_camera(request, &pair->a.image, &pair->config, &error);
    if (status == FOVEA_OK) status = match(pair, &error);
    if (status != FOVEA_OK) fv_member_options_name(&request->members, &error);
    if (status != FOVEA_OK)
        return status == FOVEA_ERROR_SYSTEM ? fv_say_failed("%s", error.text)
                                            : fv_say_wrong("%s", error.text);
    if (picture != NULL && draw(pair, picture, &error) != FOVEA_OK)
        return fv_say_failed("%s", error.text);
    if (json)
        print_json(pair);
    else
        print_summary(pair);
    return FV_EXIT_OK;
}

int fv_command_match(int argc, char **argv)
{
    struct request request = {.ratio = 80, .members.table = table};
    const char *picture = NULL;
    bool json = false;
    struct fv_option options[FV_OPTIONS_MAX + 1] = {{0}};
    const struct fv_option own[] = {
        {"matcher", "NAME", FV_OPTION_TEXT, &request.matcher,
         "brute_force (default): each descriptor of A is compared with each of B"},
        {"ratio", "PERCENT", FV_OPTION_COUNT, &request.ratio,
         "keep matches nearer than PERCENT of the second nearest (default 80; 100 keeps all)"},
        {"no-cross-check", NULL, FV_OPTION_FLAG, &request.no_cross_check,
         "keep matches that are not the nearest in both directions too"},
        {"geometry", "NAME", FV_OPTION_TEXT, &request.geometry,
         "fundamental (default: a rigid scene, unknown cameras), homography (a plane, or a camera that turns), essential (a rigid scene and --focal), or any (matches are not verified)"},
        {"focal", "PIXELS", FV_OPTION_TEXT, &request.focal,
         "focal length of both pictures, for --geometry essential"},
        {"centre", "X,Y", FV_OPTION_TEXT, &request.centre,
         "principal point in pixels, for --geometry essential (default: the middle)"},
        {"draw", "FILE", FV_OPTION_TEXT, &picture, "write both pictures with the matches as PNG"},
        {"json", NULL, FV_OPTION_FLAG, &json, "print every match"},
        {0},
    };
    int first;
    fv_extract_offer(&request.features, 1000, options);
    fv_member_options_offer(&request.members, options);
    fv_member_options_join(options, own);
    const enum fv_options_result result =
        fv_options_parse(options, "A B", 2, 2, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;

    struct fovea_extract_config extract;
    struct fovea_error error;
    struct pair pair = {0};
    const struct fv_file written[] = {{"--draw", picture}, {0}},
                         read[] = {{"A", argv[first]}, {"B", argv[first + 1]}, {0}};
    if (read_request(&request, &extract, &pair.config, &error) != FOVEA_OK ||
        fv_files_apart(written, read, &error) != FOVEA_OK ||
        fv_picture_check_name("--draw", picture, &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    const enum fv_exit status = run(&request, &extract, argv + first, &pair, picture, json);
    fv_extract_free(&pair.a);
    fv_extract_free(&pair.b);
    free(pair.memory);
    return status;
}
