/* Between map and search: gives the search the cost of each cell, and reads the way that it found.
 */
#ifndef NAVIGATE_WAYS_H
#define NAVIGATE_WAYS_H

#include "plan.h"

/* The grid lies here from now on: the search goes on, or begins anew where it cannot. */
void navigate_ways_move(struct navigate *n, int32_t width, int32_t height, double cell_m,
                        const double origin[2]);
/* Tell the search what has changed in the map. */
void navigate_ways_change(struct navigate *n);
/* Where to go from a place: down the way by `look_m`, or on, up to `far_m`, where the straight line
 * costs no more than the way. False: there is no way. */
bool navigate_ways_ahead(struct navigate *n, const double position[2], double look_m, double far_m,
                         double to[2]);

#endif
