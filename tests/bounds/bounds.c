/* Bounds of work, derived from capacities and measured pieces, and checked by whole runs: counted
 * in instructions under qemu by tools/bounds.py, which says how and makes docs/bounds.md of the
 * lines on stdout:
 *
 *     capacity NAME VALUE
 *     way BOUND NUMBER TEXT
 *     term BOUND WAY COUNT INSTRUCTIONS-EACH WHAT HOW-OFTEN
 *     bound NAME SUM DEAREST-WAY MOST-COUNTED TIMES RUN
 *
 * with tabs between. Exits with 1 where a count is over its bound or has none. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/grid_case.h"
#include "bounds/inertial_case.h"
#include "bounds/kinds.h"
#include "bounds/runs.h"
#include "bounds/stages.h"
#include "bounds/table.h"
#include "bounds/two_cameras.h"

/* Of a map that is full in the sense of full_map.h. */
enum { KEYFRAMES_LEAST = 24, FEATURES_LEAST = 200 };

static void tell_capacities(const struct capacities *c)
{
    const struct {
        const char *name;
        double value;
    } rows[] = {{"width", c->width},
                {"height", c->height},
                {"level_pixels", c->level_pixels},
                {"level_rows", c->level_rows},
                {"features", c->features},
                {"per_cell", c->per_cell},
                {"keyframes", c->keyframes},
                {"landmarks", c->landmarks},
                {"window", c->window},
                {"grid_side", c->grid_side},
                {"grid_rays", c->grid_rays},
                {"grid_steps", c->grid_steps}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        printf("capacity\t%s\t%.0f\n", rows[i].name, rows[i].value);
}

/* False: a run took more. */
static bool tell(const struct bound *b)
{
    uint32_t dearest;
    const double sum = bound_sum(b, &dearest);
    for (uint32_t way = 1; way < BOUND_WAYS_MAX; way++)
        if (b->ways[way] != NULL) printf("way\t%s\t%u\t%s\n", b->name, way, b->ways[way]);
    for (uint32_t i = 0; i < b->term_count; i++)
        printf("term\t%s\t%u\t%.0f\t%.1f\t%s\t%s\n", b->name, b->terms[i].way, b->terms[i].count,
               piece_costs[b->terms[i].piece], piece_text(b->terms[i].piece), b->terms[i].often);
    printf("bound\t%s\t%.0f\t%u\t%llu\t%llu\t%s\n", b->name, sum, dearest,
           (unsigned long long)b->most, (unsigned long long)b->times,
           b->most_in != NULL ? b->most_in : "-");
    if ((double)b->most <= sum) return true;
    fprintf(stderr, "%s: counted %llu instructions in the run '%s', expected at most %.0f\n",
            b->name, (unsigned long long)b->most, b->most_in, sum);
    return false;
}

/* False: a kind of unit has no bound, or one of nothing. */
static bool are_bounded(void)
{
    bool all = true;
    for (int kind = 0; kind < KIND_COUNT; kind++) {
        const char *name = kind_name((enum kind)kind);
        if (bound_sum(bound_of(name), NULL) > piece_costs[PIECE_clock]) continue;
        fprintf(stderr, "%s: found no bound of this kind of unit, expected one\n", name);
        all = false;
    }
    return all;
}

static void refuse(const char *option, const char *found)
{
    fprintf(stderr, "--%s: found '%s', expected a number of at least 0\n", option, found);
    exit(2);
}

static void read_options(int argc, char **argv, struct runs_size *size)
{
    static const struct option options[] = {{"width", required_argument, NULL, 'w'},
                                            {"height", required_argument, NULL, 'h'},
                                            {"features", required_argument, NULL, 'f'},
                                            {"keyframes", required_argument, NULL, 'k'},
                                            {"landmarks", required_argument, NULL, 'l'},
                                            {"frames", required_argument, NULL, 'n'},
                                            {"run", required_argument, NULL, 'r'},
                                            {"brief", no_argument, NULL, 'b'},
                                            {NULL, 0, NULL, 0}};
    for (int at, c; (c = getopt_long(argc, argv, "", options, &at)) != -1;) {
        char *end = NULL;
        if (c == 'b') size->brief = true;
        if (c == 'r') size->only = optarg;
        if (c == 'b' || c == 'r') continue;
        const long value = c == '?' ? -1 : strtol(optarg, &end, 10);
        if (c == '?') exit(2);
        if (value < 0 || value > 100000 || end == optarg || *end != '\0')
            refuse(options[at].name, optarg);
        if (c == 'w') size->width = (int32_t)value;
        if (c == 'h') size->height = (int32_t)value;
        if (c == 'f') size->features = (uint32_t)value;
        if (c == 'k') size->keyframes = (uint32_t)value;
        if (c == 'l') size->landmarks = (uint32_t)value;
        if (c == 'n') size->frames = (int)value;
    }
    if ((size->keyframes == 0 || size->keyframes >= KEYFRAMES_LEAST) &&
        (size->features == 0 || size->features >= FEATURES_LEAST))
        return;
    fprintf(stderr, "found %u keyframes and %u features, expected at least %d and %d, or 0\n",
            size->keyframes, size->features, KEYFRAMES_LEAST, FEATURES_LEAST);
    exit(2);
}

int main(int argc, char **argv)
{
    static struct fovea_config config;
    struct runs_size size = {.width = 640, .height = 480, .frames = 45};
    bool good = true;
    read_options(argc, argv, &size);
    if (!counter_open()) return 2;
    runs_configure(&config, &size);
    struct fovea *rt = full_map_runtime(&config);
    two_cameras_config(&config, size.width, size.height);
    runs_limit(&config, &size);
    struct fovea *two = full_map_runtime(&config);
    inertial_case_config(&config, size.width, size.height);
    runs_limit(&config, &size);
    struct fovea *inertial = full_map_runtime(&config);
    grid_case_config(&config, size.width, size.height);
    runs_limit(&config, &size);
    struct fovea *grid = full_map_runtime(&config);
    const struct capacities capacities = capacities_of(rt, grid);
    pieces_measure(rt, two, inertial, grid);
    free(grid);
    free(inertial);
    free(two);
    free(rt);
    stages_derive(&capacities);
    units_derive(&capacities);
    good = are_bounded();
    if (size.frames > 0) runs_play(&size);
    tell_capacities(&capacities);
    for (uint32_t i = 0; bound_at(i) != NULL; i++)
        good = tell(bound_at(i)) && good;
    return good ? 0 : 1;
}
