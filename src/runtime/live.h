/* Live parameters: the members of the configuration that a step may change (FV_LIVE_KEY in
 * config.def). What was carved stays as it is, so that a value which needs other memory is refused.
 */
#ifndef FOVEA_RUNTIME_LIVE_H
#define FOVEA_RUNTIME_LIVE_H

#include "runtime/state.h"

/* Take the live parameters of `config`, or none where fovea_parameters_check refuses them.
 * Real-time safe; time is bounded, that of the tables of the preprocessing chain. */
void fv_live_take(struct fovea *rt, const struct fovea_config *config);

/* Give every stage its settings of rt->config, before it is carved: sizes follow from them. */
void fv_live_spread(struct fovea *rt);

/* The same after it was carved: values, and what is computed from them. */
void fv_live_apply(struct fovea *rt);

#endif
