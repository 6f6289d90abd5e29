#include "sim.h"

#include <stdio.h>
#include <string.h>

#include "fovea/text.h"

/* ---- the table of options ---------------------------------------------------------------------------- */

enum kind { KIND_U64, KIND_I32, KIND_REAL, KIND_FLAG, KIND_LENS, KIND_TEXTURES };

struct option {
    const char *name;
    enum kind kind;
    size_t offset;
    double low, high;
    const char *unit;
};

#define AT(member) offsetof(struct fv_sim_options, member)
static const struct option option_table[] = {
    {"seed", KIND_U64, AT(seed), 0, 9007199254740992.0, "integer"},
    {"width", KIND_I32, AT(width), 64, 2048, "pixels"},
    {"height", KIND_I32, AT(height), 64, 2048, "pixels"},
    {"rate", KIND_REAL, AT(rate_hz), 1, 1000, "Hz"},
    {"frames", KIND_U64, AT(frames), 0, 9007199254740992.0, "frames, 0: endless"},
    {"lens", KIND_LENS, AT(lens), 0, 0, "radtan, equidistant or pinhole"},
    {"fov", KIND_REAL, AT(fov_deg), 30, 130, "degrees across"},
    {"noise", KIND_REAL, AT(noise), 0, 20, "grey levels"},
    {"blur", KIND_FLAG, AT(blur), 0, 1, "0 or 1"},
    {"rolling", KIND_FLAG, AT(rolling), 0, 1, "0 or 1"},
    {"exposure", KIND_REAL, AT(exposure_ms), 0.05, 100, "milliseconds"},
    {"readout", KIND_REAL, AT(readout_ms), 0, 100, "milliseconds"},
    {"objects", KIND_I32, AT(objects), 0, FV_SIM_OBJECTS_MAX, "moving objects"},
    {"textures", KIND_TEXTURES, AT(repeated), 0, 0, "natural or repeated"},
    {"light", KIND_REAL, AT(light), 0.1, 4, "factor of brightness"},
    {"time", KIND_REAL, AT(time_s), 0, 100000, "seconds"},
};
enum { OPTIONS = sizeof option_table / sizeof option_table[0] };

static const char *const trajectory_name[FV_SIM_TRAJECTORY_COUNT] = {
    "tour", "orbit", "corridor", "rotate", "stopgo", "fast", "kidnap", "wander", "still"};

/* ---- values ------------------------------------------------------------------------------------------ */

enum { WORD_BYTES = 96 }; /* longer names and values are cut, and then fit nothing */

struct given {
    bool fov, frames;
};

static bool store_word(void *to, enum kind kind, const char *value)
{
    static const char *const lens[3] = {"radtan", "equidistant", "pinhole"};
    if (kind == KIND_TEXTURES) {
        *(bool *)to = strcmp(value, "repeated") == 0;
        return *(bool *)to || strcmp(value, "natural") == 0;
    }
    for (int32_t i = 0; i < 3; i++) {
        if (strcmp(value, lens[i]) != 0) continue;
        *(enum fv_sim_lens *)to = (enum fv_sim_lens)i;
        return true;
    }
    return false;
}

static bool store_number(void *to, const struct option *option, const char *text)
{
    double value;
    int64_t whole;
    if (option->kind == KIND_REAL) {
        if (!fovea_text_number(text, &value) || value < option->low || value > option->high) return false;
        *(double *)to = value;
        return true;
    }
    if (!fovea_text_integer(text, &whole) || (double)whole < option->low || (double)whole > option->high)
        return false;
    if (option->kind == KIND_U64) *(uint64_t *)to = (uint64_t)whole;
    if (option->kind == KIND_I32) *(int32_t *)to = (int32_t)whole;
    if (option->kind == KIND_FLAG) *(bool *)to = whole != 0;
    return true;
}

static enum fovea_status unknown(const char *what, const char *found, const char *const *names, size_t count,
                                 struct fovea_error *error)
{
    char quoted[FOVEA_TEXT_QUOTED_BYTES], list[256];
    const char *like = fovea_text_nearest(found, names, count);
    size_t used = 0;
    list[0] = '\0';
    for (size_t i = 0; i < count && used < sizeof list; i++)
        used += (size_t)snprintf(list + used, sizeof list - used, "%s%s", i == 0 ? "" : " ", names[i]);
    fovea_text_quote(found, quoted, sizeof quoted);
    if (like != NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: unknown %s %s, did you mean '%s'? Expected one of: %s", what, quoted,
                               like, list);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "sim: unknown %s %s; expected one of: %s", what, quoted,
                           list);
}

/* One "name=value". */
static enum fovea_status parse_option(char *text, struct fv_sim_options *options, struct given *given,
                                      struct fovea_error *error)
{
    char quoted[FOVEA_TEXT_QUOTED_BYTES];
    const char *names[OPTIONS];
    const struct option *option = NULL;
    char *value = strchr(text, '=');
    if (value != NULL) *value++ = '\0';
    for (size_t i = 0; i < OPTIONS; i++) {
        names[i] = option_table[i].name;
        if (strcmp(text, names[i]) == 0) option = &option_table[i];
    }
    if (option == NULL) return unknown("option", text, names, OPTIONS, error);
    if (value == NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "sim: %s: found no value, expected %s=VALUE (%s)",
                               text, text, option->unit);
    if (option->offset == AT(fov_deg)) given->fov = true;
    if (option->offset == AT(frames)) given->frames = true;
    void *to = (char *)options + option->offset;
    const bool word = option->kind == KIND_LENS || option->kind == KIND_TEXTURES;
    if (word ? store_word(to, option->kind, value) : store_number(to, option, value)) return FOVEA_OK;
    fovea_text_quote(value, quoted, sizeof quoted);
    if (word)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "sim: %s: found %s, expected %s", text, quoted,
                               option->unit);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "sim: %s: found %s, expected %s in [%.15g, %.15g] (%s)",
                           text, quoted, option->kind == KIND_REAL ? "a number" : "a whole number",
                           option->low, option->high, option->unit);
}

static enum fovea_status check_together(const struct fv_sim_options *options, struct fovea_error *error)
{
    const double period_ms = 1000.0 / options->rate_hz;
    if (options->exposure_ms > period_ms)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "sim: exposure: found %g ms, expected at most the frame period of %g ms (rate=%g)",
            options->exposure_ms, period_ms, options->rate_hz);
    if (options->rolling && options->readout_ms > period_ms)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "sim: readout: found %g ms, expected at most the frame period of %g ms (rate=%g)",
            options->readout_ms, period_ms, options->rate_hz);
    const double widest = options->lens == FV_SIM_LENS_EQUIDISTANT ? 130.0 : 110.0;
    if (options->fov_deg > widest)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: fov: found %g, expected at most %g degrees with this lens",
                               options->fov_deg, widest);
    return FOVEA_OK;
}

/* The next piece of `*at` up to a character of `stops`, cut to fit `word`; `*at` moves behind it. */
static void next_word(const char **at, const char *stops, char word[WORD_BYTES])
{
    const size_t length = strcspn(*at, stops), kept = length < WORD_BYTES - 1 ? length : WORD_BYTES - 1;
    memcpy(word, *at, kept);
    word[kept] = '\0';
    *at += length;
}

static int32_t default_objects(enum fv_sim_trajectory trajectory)
{
    switch (trajectory) {
    case FV_SIM_CORRIDOR:
        return 4;
    case FV_SIM_TOUR:
        return 8;
    case FV_SIM_WANDER:
        return 12;
    default:
        return 6;
    }
}

enum fovea_status fv_sim_options_parse(const char *address, struct fv_sim_options *options,
                                       struct fovea_error *error)
{
    struct fv_sim_options o = {.trajectory = FV_SIM_TRAJECTORY_COUNT,
                               .seed = 1,
                               .width = 640,
                               .height = 480,
                               .rate_hz = 30.0,
                               .noise = 2.0,
                               .exposure_ms = 5.0,
                               .readout_ms = 20.0,
                               .light = 1.0};
    struct given given = {false, false};
    char word[WORD_BYTES];
    next_word(&address, "?", word);
    for (int32_t i = 0; i < FV_SIM_TRAJECTORY_COUNT; i++) {
        if (strcmp(word, trajectory_name[i]) == 0) o.trajectory = (enum fv_sim_trajectory)i;
    }
    if (word[0] == '\0') o.trajectory = FV_SIM_TOUR;
    if (o.trajectory == FV_SIM_TRAJECTORY_COUNT)
        return unknown("trajectory", word, trajectory_name, FV_SIM_TRAJECTORY_COUNT, error);
    o.objects = default_objects(o.trajectory);
    while (*address != '\0') {
        address++;
        next_word(&address, "&", word);
        if (word[0] == '\0') continue;
        const enum fovea_status status = parse_option(word, &o, &given, error);
        if (status != FOVEA_OK) return status;
    }
    if (!given.fov) o.fov_deg = o.lens == FV_SIM_LENS_EQUIDISTANT ? 105.0 : 80.0;
    if (!given.frames) o.frames = fv_sim_motion_frames(o.trajectory, o.rate_hz);
    const enum fovea_status status = check_together(&o, error);
    if (status == FOVEA_OK) *options = o;
    return status;
}
