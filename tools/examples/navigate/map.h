/* The map of the planner: cells of the grid by kind, what touches told, and what ways over them
 * cost. */
#ifndef NAVIGATE_MAP_H
#define NAVIGATE_MAP_H

#include "plan.h"

/* Ways keep it between the robot's edge and what is occupied, where they can: an edge may be a cell
 * or two nearer than the grid has it. Steering stops where half of it is left. */
static const double navigate_margin_m = 0.12;

/* The cell at a place; -1: outside the grid. */
int32_t navigate_cell(const struct navigate *n, double x, double y);
double navigate_middle(const struct navigate *n, int32_t cell, int axis);
/* To [-pi, pi]. */
double navigate_turned(double angle);

/* Where the search has a cell of the grid: at one place, wherever the grid's window goes. */
int32_t navigate_field(const struct navigate *n, int32_t cell);
void navigate_map(struct navigate *n, const int8_t *cells);
/* Mark what was touched of late, and find the gaps anew. */
void navigate_map_touches(struct navigate *n);
/* Price of a metre in a cell; 0: none may be driven there. */
double navigate_price(const struct navigate *n, int32_t cell);
/* What is left to the goal from a cell where ways end: at the goal's own, or, where that is not in
 * the grid (-1), at the edges. Negative: none ends there. */
double navigate_exit(const struct navigate *n, int32_t cell, int32_t goal);

#endif
