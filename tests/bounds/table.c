#include "bounds/table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct bound bounds[BOUNDS_MAX];
static uint32_t bound_count;

struct bound *bound_at(uint32_t i)
{
    return i < bound_count ? &bounds[i] : NULL;
}

struct bound *bound_of(const char *name)
{
    for (uint32_t i = 0; i < bound_count; i++)
        if (strcmp(bounds[i].name, name) == 0) return &bounds[i];
    if (bound_count == BOUNDS_MAX) abort();
    bounds[bound_count].name = name;
    return &bounds[bound_count++];
}

static struct bound_term *term_of(struct bound *bound, uint32_t way, enum piece piece)
{
    for (uint32_t i = 0; i < bound->term_count; i++)
        if (bound->terms[i].way == way && bound->terms[i].piece == piece) return &bound->terms[i];
    if (bound->term_count == BOUND_TERMS_MAX || way >= BOUND_WAYS_MAX) abort();
    bound->terms[bound->term_count] = (struct bound_term){.way = way, .piece = piece};
    return &bound->terms[bound->term_count++];
}

void bound_add(struct bound *bound, uint32_t way, const char *often, double count, enum piece piece)
{
    struct bound_term *term = term_of(bound, way, piece);
    const size_t used = strlen(term->often);
    if (count == 0) return;
    snprintf(term->often + used, sizeof term->often - used, "%s%s", used > 0 ? " + " : "", often);
    term->count += count;
}

double bound_sum(const struct bound *bound, uint32_t *way)
{
    double sums[BOUND_WAYS_MAX] = {0}, always = piece_costs[PIECE_clock];
    uint32_t dearest = BOUND_ALWAYS;
    for (uint32_t i = 0; i < bound->term_count; i++) {
        const struct bound_term *term = &bound->terms[i];
        const double cost = term->count * piece_costs[term->piece];
        *(term->way == BOUND_ALWAYS ? &always : &sums[term->way]) += cost;
    }
    for (uint32_t k = 1; k < BOUND_WAYS_MAX; k++)
        if (sums[k] > sums[dearest]) dearest = k;
    if (way != NULL) *way = dearest;
    return always + sums[dearest];
}

void bound_note(const char *name, const char *run, uint64_t instructions)
{
    struct bound *bound = bound_of(name);
    bound->times++;
    if (instructions <= bound->most) return;
    bound->most = instructions;
    bound->most_in = run;
}
