/* Where the cameras of a rig are, from each picture by itself: the start of the joint solve. */
#ifndef FOVEA_CALIBRATE_RIG_START_H
#define FOVEA_CALIBRATE_RIG_START_H

#include "calibrate/rig.h"
#include "calibrate/rigid.h"

namespace calibrate
{

/* Whether a detector may count a board from its other end, and the board counted so: half a turn
 * about its middle. */
bool may_be_turned(const Board &board);
Rigid half_turn(const Board &board);

/* Corner `c` of a view, counted from the board's other end where that is `turned`. */
Pixel rig_corner(const RigInput &input, bool turned, size_t view, size_t c);

/* Fills cameras (lens and place), poses, left_out, used and turned. A lens that is not held is
 * solved for from its own pictures. False, with a line: see solve_rig. */
bool start_rig(const Board &board, const std::vector<RigInput> &inputs, RigSolution &start,
               std::string &error);

} // namespace calibrate
#endif
