/* The simulated road (`sim:road`): a way with bends, straights and slopes, what stands beside it,
 * the cars on it, and what the sun, dirt on the lens and the camera's exposure do to the picture.
 * Everything follows from the seed. */
#ifndef FOVEA_DRIVERS_SIM_ROAD_H
#define FOVEA_DRIVERS_SIM_ROAD_H

#include <stdbool.h>
#include <stdint.h>

#include "base/elementary.h"

struct fv_sim_options;
struct fv_sim_world;

/* What the road leads through. */
enum fv_sim_scenery { FV_SIM_STREET, FV_SIM_SUBURB, FV_SIM_HIGHWAY, FV_SIM_SCENERY_COUNT };

enum {
    FV_SIM_ROAD_LENGTH_M = 480,
    FV_SIM_ROAD_STEPS_PER_M = 4,
    FV_SIM_ROAD_POINTS = FV_SIM_ROAD_LENGTH_M * FV_SIM_ROAD_STEPS_PER_M + 1,
    FV_SIM_DRIVE_STEPS = 1200, /* of 0.05 s */
    FV_SIM_ROAD_CARS_MAX = 8,  /* that move */
    FV_SIM_ROAD_GAINS = 64     /* seconds for which the exposure is drawn; then it stays */
};

#define FV_SIM_ROAD_HEIGHT_M 1.65 /* of the camera over the road */
#define FV_SIM_ROAD_FOCAL_PX 719.0
#define FV_SIM_ROAD_HALF_WIDTH_M 4.0

/* Of the middle line at a distance along it. */
struct fv_sim_road_point {
    double x, y, heading, curvature; /* 1/m, positive to the left */
    double speed;                    /* m/s, driven here */
};

enum fv_sim_car_shape { FV_SIM_CAR, FV_SIM_VAN, FV_SIM_TRUCK, FV_SIM_CAR_SHAPE_COUNT };

struct fv_sim_car {
    enum fv_sim_car_shape shape;
    uint16_t paint, glass;
    double lateral_m; /* of the middle line, to the left */
    double along_m;   /* at time 0; where it follows, ahead of the camera */
    double speed_m_s; /* negative: comes towards; where it follows, of the sway */
    bool follows;     /* keeps the camera's speed, but for a sway */
};

struct fv_sim_road {
    enum fv_sim_scenery scenery;
    struct fv_sim_road_point point[FV_SIM_ROAD_POINTS];
    double slope[3], slope_rate[3], slope_phase[3]; /* height: amplitudes m, 1/m, radians */
    double way_m[FV_SIM_DRIVE_STEPS];               /* along the road, by time */
    double way_speed[FV_SIM_DRIVE_STEPS];
    double bounce[6]; /* phases */
    struct fv_sim_car car[FV_SIM_ROAD_CARS_MAX];
    int32_t car_count;
    double sun[3]; /* direction to it */
    double gain[FV_SIM_ROAD_GAINS];
    double glare; /* grey levels that a sun in front adds */
    bool dirty;
};

/* The way and the drive (road_path.c). */
void fv_sim_road_path_create(struct fv_sim_road *road, uint64_t seed);
/* Middle line at `along_m`: position with its height, heading, and height's slope. */
void fv_sim_road_at(const struct fv_sim_road *road, double along_m, double position[3],
                    double *heading, double *slope);
double fv_sim_road_curvature(const struct fv_sim_road *road, double along_m);
/* How far the camera has come, and its speed along the middle line. */
double fv_sim_road_way(const struct fv_sim_road *road, double time_s, double *speed_m_s);
/* Least distance of a point to the middle line. */
double fv_sim_road_clearance(const struct fv_sim_road *road, double x, double y);

/* What stands there (road_place.c) and the cars (road_cars.c). */
void fv_sim_place_road(struct fv_sim_world *world, const struct fv_sim_options *options);
void fv_sim_road_cars_create(struct fv_sim_world *world, const struct fv_sim_options *options);
void fv_sim_road_car_put(struct fv_sim_world *world, const struct fv_sim_car *car, double along_m,
                         bool back, uint16_t object);
void fv_sim_road_cars_place(struct fv_sim_world *world, double time_s);

/* The lens and the exposure (road_lens.c). `dirt`: of each pixel, 255 where clean. */
void fv_sim_road_lens_create(struct fv_sim_road *road, uint64_t seed);
void fv_sim_road_dirt(const struct fv_sim_road *road, uint64_t seed, int32_t width, int32_t height,
                      uint8_t *dirt);
double fv_sim_road_gain(const struct fv_sim_road *road, double time_s);
/* Light that the sun spreads over the whole picture, in units of the canvas. */
int32_t fv_sim_road_veil(const struct fv_sim_road *road, const double T_world_cam[12]);

#endif
