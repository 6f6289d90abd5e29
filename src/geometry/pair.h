/* Two doubles side by side, in one register on every processor of interest: the operations and the
 * bits of two scalars. */
#ifndef FOVEA_GEOMETRY_PAIR_H
#define FOVEA_GEOMETRY_PAIR_H

#include <stdint.h>

typedef double fv_pair __attribute__((vector_size(16)));
typedef int64_t fv_flags __attribute__((vector_size(16))); /* -1 true, 0 false */

#endif
