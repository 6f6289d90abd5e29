/* Two cameras and an inertial sensor, and what it may say at most. */
#ifndef FOVEA_TESTS_BOUNDS_INERTIAL_CASE_H
#define FOVEA_TESTS_BOUNDS_INERTIAL_CASE_H

#include "runtime/state.h"

enum { INERTIAL_CASE_STATION_MS = 240, INERTIAL_CASE_HZ = 1000 };

/* The address of the film: at INERTIAL_CASE_HZ, 20 frames a second. */
void inertial_case_uri(char *uri, size_t capacity, int32_t width, int32_t height);

void inertial_case_config(struct fovea_config *config, int32_t width, int32_t height);

/* A sample and a pose of one motion, fast and shaken, at an instant in ms. */
void inertial_case_sample(int64_t at_ms, struct fovea_imu_sample *sample);
void inertial_case_pose(int64_t at_ms, struct fv_se3 *T_world_cam);

/* Stations from 0 ms on, each INERTIAL_CASE_STATION_MS after the one before, and the samples
 * between them; they refer to keyframes of the runtime's map. */
void inertial_case_fill(struct fovea *rt, uint32_t stations);

/* The scale, gravity and biases are claimed, and an estimate is known. */
void inertial_case_claim(struct fovea *rt);

#endif
