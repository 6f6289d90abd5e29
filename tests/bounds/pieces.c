#include "bounds/pieces.h"

#include <stdio.h>
#include <stdlib.h>

#include "bounds/full_map.h"

double piece_costs[PIECE_COUNT];

static const char *const texts[PIECE_COUNT] = {
#define TEXT(name, text) text,
    PIECES(TEXT)
#undef TEXT
};

const char *piece_text(enum piece piece)
{
    return texts[piece];
}

void piece_note(enum piece piece, double instructions)
{
    if (instructions > piece_costs[piece]) piece_costs[piece] = instructions;
}

_Noreturn void piece_wrong(const char *file, int line, const char *what)
{
    fprintf(stderr, "%s:%d: found a worst input that is none, expected %s\n", file, line, what);
    exit(1);
}

void pieces_measure(struct fovea *rt, struct fovea *two, struct fovea *inertial, struct fovea *grid)
{
    pieces_of_ground(grid);
    pieces_of_grid(grid);
    pieces_of_free_space(grid);
    pieces_of_stereo(two);
    pieces_of_stereo_match(two);
    pieces_of_stereo_align(two);
    pieces_of_distances(two);
    pieces_of_inertial(inertial);
    pieces_of_inertial_samples(inertial);
    pieces_of_turns(inertial);
    pieces_of_features(rt);
    pieces_of_pose(rt);
    pieces_of_map(rt);
    pieces_of_localise(rt);
    pieces_of_covariance(rt);
    pieces_of_odometry(rt);
    pieces_of_relocalise(rt);
    pieces_of_initialise(rt);
    pieces_of_bundle(rt);
    pieces_of_motions(rt);
    pieces_of_essential(rt);
    pieces_of_homography(rt);
    pieces_of_roots(rt);
    pieces_of_window(rt);
    pieces_of_window_copy(rt);
    pieces_of_creation(rt);
    pieces_of_agreement(rt);
    pieces_of_archive(rt);
    pieces_of_lens(rt);
    pieces_of_edges(rt);
    pieces_of_floor(rt);
    pieces_of_jobs(rt);
    pieces_of_masks();
    pieces_of_decoders();
    pieces_of_tensors();
    pieces_of_inputs(rt->config.rig.cameras[0].camera.width,
                     rt->config.rig.cameras[0].camera.height);
    if (rt->config.odometry.closures) {
        pieces_of_closure(rt);
        pieces_of_similarity(rt);
        pieces_of_closure_search(rt);
        pieces_of_closure_commit(rt);
    }
}
