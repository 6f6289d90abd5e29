/* fovea model run: a network's raw outputs for pictures or arrays. */
#ifndef FOVEA_APP_LAB_MODEL_RUN_H
#define FOVEA_APP_LAB_MODEL_RUN_H

/* Run the model at `path` once for each `count / inputs` files, and write the outputs to `out` as
 * .npz: output0, output1... with the run as first axis, and their scale and zero_point. Returns an
 * exit status; a line was printed to stderr where it is not FV_EXIT_OK. */
int fv_model_run(const char *path, char **files, int count, const char *out);

#endif
