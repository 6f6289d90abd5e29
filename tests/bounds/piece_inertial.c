/* Of the inertial estimate: its units. */
#include "inertial/estimator.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/inertial_case.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(INTEGRATED_PER_UNIT, INERTIAL_INTEGRATED);
LIMIT(ELIMINATED_PER_UNIT, INERTIAL_ELIMINATED);
LIMIT(STEPPED_PER_UNIT, INERTIAL_STEPPED);

enum { STATIONS = FV_INERTIAL_WINDOW };

struct estimating {
    struct fovea *rt;
    struct fv_inertial *inertial;
    uint32_t at;
    struct fv_inertial_sample a, b;
};

static void unit(void *context)
{
    struct estimating *w = context;
    fv_inertial_stage_unit(&w->rt->inertial, &w->rt->odometry);
}

static void add_interval(void *context)
{
    struct estimating *w = context;
    integrate(w->inertial, fv_inertial_station_at(w->inertial, 0), &w->a, &w->b, INT32_MAX);
}

static void add_link(void *context)
{
    struct estimating *w = context;
    uint32_t budget = INTEGRATED_PER_UNIT;
    (void)integrate_link(w->inertial, w->at, &budget);
    follow(w->inertial, w->at);
}

static void guess(void *context)
{
    struct estimating *w = context;
    guess_down(w->inertial);
}

static void eliminate(void *context)
{
    struct estimating *w = context;
    MUST(fv_inertial_eliminate(w->inertial, w->at));
}

static void solve(void *context)
{
    struct estimating *w = context;
    MUST(fv_inertial_solve_tail(w->inertial));
}

static void step_back(void *context)
{
    struct estimating *w = context;
    fv_inertial_step_back(w->inertial, w->at);
    move_own(&fv_inertial_station_at(w->inertial, w->at)->now, w->inertial->state->solution);
}

/* Of all stations; the window begins behind a link that is cut, or has none. */
static void of_beginnings(struct estimating *w)
{
    for (int cut = 0; cut < 2; cut++) {
        inertial_case_fill(w->rt, FV_INERTIAL_STATIONS_MAX);
        inertial_case_claim(w->rt);
        fv_inertial_station_at(w->inertial, 0)->cut = cut == 1;
        MUST(fv_inertial_wanted(w->inertial));
        NOTE(inertial_begun, unit, w, 1);
        MUST(w->inertial->state->taking_part == STATIONS);
    }
}

/* Turned slowly, fast, and by many turns between two samples. */
static void of_intervals(struct estimating *w)
{
    static const float rates[] = {1e-6f, 1e-2f, 1, 10, 100, 1000};
    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        w->a = (struct fv_inertial_sample){.gyro = {rates[i], -rates[i], rates[i]}};
        w->b = w->a;
        w->b.after_ns = (int32_t)gap_max_ns;
        NOTE(inertial_interval, add_interval, w, 1);
    }
}

/* Links that take nothing off the budget of samples: one sample each, after the station. */
static void of_links(struct estimating *w)
{
    for (w->at = 0; w->at + 1 < STATIONS; w->at++) {
        struct fv_inertial_station *station = fv_inertial_station_at(w->inertial, w->at);
        struct fv_inertial_sample *first = samples_of(w->inertial, w->at);
        station->sample_count = 1;
        station->integrated = 0;
        first->after_ns = (int32_t)gap_max_ns;
        first->gyro[1] = 100;
        fv_inertial_station_at(w->inertial, w->at + 1)->now.scale = 0;
        NOTE(inertial_link, add_link, w, 1);
    }
    w->inertial->state->taking_part = STATIONS;
    NOTE(inertial_guessed, guess, w, 1);
}

/* Every pass of an estimate over all stations: the oldest with what is usual, and with a prior. */
static void of_elimination(struct estimating *w, bool prior)
{
    struct fv_inertial_state *s = w->inertial->state;
    inertial_case_fill(w->rt, STATIONS);
    fv_inertial_begin(w->inertial);
    s->prior = s->hand_on[0];
    s->prior.known = prior;
    while (s->phase == FV_INERTIAL_INTEGRATE)
        (void)fv_inertial_unit(w->inertial);
    for (int pass = 0; pass < 4; pass++) {
        for (w->at = 0; w->at + 1 < STATIONS; w->at++)
            NOTE(inertial_eliminated, eliminate, w, 1);
        NOTE(inertial_solved, solve, w, 1);
        for (w->at = STATIONS - 1; w->at-- > 0;)
            NOTE(inertial_stepped, step_back, w, 1);
        s->estimate.scale_sigma = 1e-3; /* so that the oldest hands on what it knows */
        s->estimate.known = true;
    }
    MUST(s->handed > 0);
}

/* As many stations as go back in one unit: it begins with the newest and ends the estimate, which
 * then moves the velocity of all that have come since. */
static void of_end(struct estimating *w)
{
    struct fv_inertial_state *s = w->inertial->state;
    inertial_case_fill(w->rt, STATIONS);
    inertial_case_claim(w->rt);
    w->rt->inertial.state->cuts = s->cuts;
    for (uint32_t i = 0; i < STATIONS; i++)
        fv_inertial_station_at(w->inertial, i)->live[0] = 1;
    fv_inertial_begin(w->inertial);
    s->taking_part = STEPPED_PER_UNIT + 1;
    s->next = 0;
    while (s->phase != FV_INERTIAL_IDLE) {
        if (s->phase == FV_INERTIAL_BACK)
            NOTE(inertial_ended, unit, w, 1);
        else
            (void)fv_inertial_unit(w->inertial);
    }
    MUST(s->estimate.known && s->estimate.stations == STEPPED_PER_UNIT + 1);
    MUST(w->rt->inertial.state->claimed_ns == s->estimate.stamp_ns);
}

void pieces_of_inertial(struct fovea *rt)
{
    static struct estimating w;
    w.rt = rt;
    w.inertial = &rt->inertial.estimator;
    full_map_fill(&rt->odometry, FV_MAP_OBSERVERS_MAX);
    of_beginnings(&w);
    inertial_case_fill(rt, STATIONS);
    of_intervals(&w);
    of_links(&w);
    of_elimination(&w, false);
    of_elimination(&w, true);
    of_end(&w);
}
