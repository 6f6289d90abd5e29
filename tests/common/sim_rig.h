/* A runtime on the simulated camera, frame by frame through the public interface, with poses and
 * truth kept. One at a time: large, so make it static. Failures end the test. */
#ifndef FOVEA_TESTS_COMMON_SIM_RIG_H
#define FOVEA_TESTS_COMMON_SIM_RIG_H

#include <stdbool.h>

#include "fovea/fovea.h"

enum { SIM_RIG_FRAMES_MAX = 9300 };

struct sim_rig {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_config config; /* to be changed between open and build */
    struct fovea *rt;
    struct fovea_frame frame;
    struct fovea_inputs inputs;
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_outputs outputs; /* of the last step */
    struct fovea_outputs work;    /* of the work behind it */
    int frames;                   /* processed */
    struct fovea_pose pose[SIM_RIG_FRAMES_MAX];
    double truth[SIM_RIG_FRAMES_MAX][12];
};

/* From frame `start` on; `frames` 0: to its end. */
void sim_rig_open(struct sim_rig *rig, const char *uri, int start, int frames);
/* The same for several runs over the same frames of `sim:`, which are rendered once
 * (kept_source.h). */
void sim_rig_open_kept(struct sim_rig *rig, const char *uri, int start, int frames);
void sim_rig_build(struct sim_rig *rig);
/* Take a frame and prepare the inputs; false at the end. */
bool sim_rig_next(struct sim_rig *rig);
/* Then: what the source's other sensors said up to the frame becomes an input, too. */
void sim_rig_take_samples(struct sim_rig *rig);
/* Step and work with the inputs. */
void sim_rig_process(struct sim_rig *rig);
void sim_rig_close(struct sim_rig *rig);

/* Distance between two poses' origins. */
double sim_rig_moved(const double a[12], const double b[12]);
/* Published way over true way between two frames, in steps of 15 frames; all of them must be posed.
 */
double sim_rig_scale(const struct sim_rig *rig, int from, int to);
/* Root mean square distance of the posed frames' places from the truth, after the best similarity,
 * over the length of the true path through them; they must all be in one world. */
double sim_rig_path_error(const struct sim_rig *rig);

#endif
