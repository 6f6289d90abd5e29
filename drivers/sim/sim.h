/* The simulated camera, inside: what its files share. The outside is include/fovea/source.h;
 * options are in README.md.
 *
 * World: metres, z up, a closed box (the enclosure) with solids in it. Two kinds of surface are
 * enough:
 *  - face: a rectangle, origin + u U + v V with u, v in [0, 1] (walls, furniture), or the disc
 *    inscribed in
 * it;
 *  - round: a surface of revolution, radius^2 = q0 + q1 s + q2 s^2 at height s in [0, height] over
 *    its base
 * (ball, cone, cylinder, ellipsoid). Rays are (x, y, 1) in the camera frame, so the ray parameter
 * is the depth z, and on a face 1/z, u/z and v/z are affine in (x, y): no division decides what is
 * seen.
 *
 * Everything is a pure function of (options, frame index). Float arithmetic is plain IEEE with sqrt
 * and division only; elementary functions come from base/elementary.h. */
#ifndef FOVEA_DRIVERS_SIM_H
#define FOVEA_DRIVERS_SIM_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/camera.h"
#include "base/elementary.h"
#include "fovea/source.h"
#include "support/uri_options.h"

static inline int32_t fv_sim_clamp(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : value;
}

#include "commands.h"
#include "drive.h"
#include "road.h"

/* ---- options (options.c) --------------------------------------------------------------------- */

enum fv_sim_trajectory {
    FV_SIM_TOUR,
    FV_SIM_ORBIT,
    FV_SIM_CORRIDOR,
    FV_SIM_ROTATE,
    FV_SIM_STOPGO,
    FV_SIM_FAST,
    FV_SIM_KIDNAP,
    FV_SIM_WANDER,
    FV_SIM_STILL,
    FV_SIM_STAND,
    FV_SIM_ROAD,
    FV_SIM_BOARD,
    FV_SIM_DRIVE,
    FV_SIM_TRAJECTORY_COUNT
};

enum fv_sim_lens { FV_SIM_LENS_RADTAN, FV_SIM_LENS_EQUIDISTANT, FV_SIM_LENS_PINHOLE };

enum fv_sim_textures { FV_SIM_TEXTURES_NATURAL, FV_SIM_TEXTURES_REPEATED };

enum { FV_SIM_SAMPLE_HZ_MAX = 1000 };

#define FV_SIM_TURN_DEG_S                                                                          \
    206.25 /* of `fast` where nothing else is asked for: 110 degrees in a second */

struct fv_sim_options {
    enum fv_sim_trajectory trajectory;
#define FV_SIM_OPTION(name, kind, type, member, value, low, high, unit, words) type member;
#include "options.def"
#undef FV_SIM_OPTION
    uint64_t given; /* which options stand in the address; fv_sim_option_given */
};

/* Whether the option of a member (its offset in the struct) stands in the address. */
bool fv_sim_option_given(const struct fv_sim_options *options, size_t offset);

/* Parse what follows "sim:" in the URI. Every error is one line that names the option, what was
 * found and what is expected. Init-only. */
enum fovea_status fv_sim_options_parse(const char *address, struct fv_sim_options *options,
                                       struct fovea_error *error);

/* Wider vectors where the processor has them; the results do not depend on it, as every operation
 * is a plain IEEE or integer one. Only for static functions: clang 14 gives no other file the plain
 * name. */
#if defined(__x86_64__) && !defined(FOVEA_SANITIZED)
#define FV_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define FV_WIDE
#endif
#define FV_IN_WIDE                                                                                 \
    static inline __attribute__((always_inline)) /* compiled with its caller's vectors */

/* ---- textures (texture.c, paint.c) ----------------------------------------------------------- */

enum { FV_SIM_LEVELS_MAX = 24, FV_SIM_TEXTURES_MAX = 64 };

struct fv_sim_brush; /* paint.h */

/* One level of a texture; the last column and row are stored twice, so that bilinear sampling may
 * read past them. */
struct fv_sim_level {
    const uint8_t *texels;
    int32_t width, height, stride;
};

/* Half-octave pyramid: level l is smaller by about 2^(l/2) (2^-(l/2), times 5/7 for odd l), which
 * makes bilinear sampling of the nearest level nearly as smooth as trilinear sampling at half its
 * price. */
struct fv_sim_texture {
    int32_t width, height; /* of the base */
    float u_max, v_max;    /* largest base coordinates */
    int32_t level_count;
    struct fv_sim_level level[FV_SIM_LEVELS_MAX];
    uint8_t *texels; /* all levels, owned */
    size_t bytes;
};

/* Allocate all levels; the base (level 0) is for the caller to paint, then `finish` makes the
 * others. */
bool fv_sim_texture_create(struct fv_sim_texture *texture, int32_t width, int32_t height);
void fv_sim_texture_finish(struct fv_sim_texture *texture);
void fv_sim_texture_free(struct fv_sim_texture *texture);

enum fv_sim_material {
    FV_SIM_PLASTER,
    FV_SIM_BRICK,
    FV_SIM_PANEL,
    FV_SIM_BLOCKS,
    FV_SIM_PARQUET,
    FV_SIM_TILES,
    FV_SIM_CARPET,
    FV_SIM_CEILING,
    FV_SIM_WOOD,
    FV_SIM_FABRIC,
    FV_SIM_CARTON,
    FV_SIM_BOOKS,
    FV_SIM_METAL,
    FV_SIM_CLUTTER,
    FV_SIM_BALL,
    FV_SIM_CONE,
    FV_SIM_PARCEL,
    FV_SIM_CLOTHES,
    FV_SIM_HEAD,
    FV_SIM_CHESSBOARD, /* of fv_sim_board_* */
    FV_SIM_ROAD_FIRST, /* from here on in road_paint.c */
    FV_SIM_ROAD_ASPHALT = FV_SIM_ROAD_FIRST,
    FV_SIM_ROAD_SHADED, /* asphalt under trees */
    FV_SIM_ROAD_GRASS,
    FV_SIM_ROAD_PAVEMENT,
    FV_SIM_ROAD_FACADE,
    FV_SIM_ROAD_ROOF,
    FV_SIM_ROAD_FOLIAGE,
    FV_SIM_ROAD_BARK,
    FV_SIM_ROAD_FENCE,
    FV_SIM_ROAD_RAIL,
    FV_SIM_ROAD_CAR, /* side and end */
    FV_SIM_ROAD_TRUCK,
    FV_SIM_ROAD_GLASS,
    FV_SIM_ROAD_SKY,
    FV_SIM_MATERIAL_COUNT
};

/* Paint the base level with a material, from a seed; `texels_per_m` sets the size of its details.
 */
void fv_sim_paint(struct fv_sim_texture *texture, enum fv_sim_material material,
                  double texels_per_m, uint64_t seed);
/* Hang posters, signs, shelves, windows and doors on a wall; `period_m` > 0 repeats the same ones.
 */
void fv_sim_paint_wall(struct fv_sim_texture *texture, double texels_per_m, uint64_t seed,
                       double period_m);
/* Darken a soft-edged rectangle (texels): the shade that furniture throws. */
void fv_sim_paint_shade(struct fv_sim_texture *texture, int32_t x0, int32_t y0, int32_t x1,
                        int32_t y1, int32_t soft, int32_t strength);
/* Darken towards the edges and by large soft pools, as lamps light a room. */
void fv_sim_paint_light(struct fv_sim_texture *texture, double texels_per_m, uint64_t seed);

/* ---- world (world.c, places.c, objects.c) ---------------------------------------------------- */

enum { FV_SIM_FACES_MAX = 1408, FV_SIM_ROUNDS_MAX = 512, FV_SIM_OBJECTS_MAX = 48 };

struct fv_sim_face {
    double origin[3], u[3],
        v[3]; /* u and v are perpendicular; u x v points to the side that is seen */
    float tex_u, tex_v, tex_du, tex_dv; /* texels at u = v = 0, and across the face */
    float light;
    uint16_t texture, object; /* object: 0 for what never moves */
    uint8_t truth_class;      /* enum fovea_truth_class, of what never moves */
    bool disc;
    bool is_cut; /* to where, of both, cut[k][0] + cut[k][1] u + cut[k][2] v >= 0 */
    double cut[2][3];
};

struct fv_sim_round {
    double base[3], axis[3], side[3]; /* orthonormal axis and side (where the texture starts) */
    double height, q0, q1, q2;
    float light;
    uint16_t texture, object;
    uint8_t truth_class;
};

/* A moving object. Sizes are constants of its class (README.md). */
struct fv_sim_object {
    enum fovea_truth_class object_class;
    bool on_ring;                /* round the corridor, else on an ellipse */
    double center[2], radius[2]; /* ellipse, or half-extents of the ring's lane */
    double rate, phase;          /* radians, or metres along the lane, per second */
    double wobble, wobble_rate, wobble_phase;
    uint16_t texture, texture_head;
};

struct fv_sim_world {
    struct fv_sim_texture texture[FV_SIM_TEXTURES_MAX];
    int32_t texture_count;
    struct fv_sim_face face[FV_SIM_FACES_MAX];
    struct fv_sim_round round[FV_SIM_ROUNDS_MAX];
    int32_t static_faces, static_rounds; /* moving objects come after these */
    int32_t face_count, round_count;
    struct fv_sim_object object[FV_SIM_OBJECTS_MAX];
    int32_t object_count;
    double room[2];  /* half-extents of the room round the origin that trajectories use */
    double lane[2];  /* half-extents of the corridor's centre line, 0 where there is none */
    double store[3]; /* a place cut off from the room (kidnap) */
    uint64_t seed;
    struct fv_sim_road road;   /* only of FV_SIM_ROAD */
    struct fv_sim_drive drive; /* only of FV_SIM_DRIVE */
    bool repeated, full;       /* full: an array or memory was too small */
};

/* Build the world of a trajectory. false: out of memory. Init-only. */
bool fv_sim_world_build(struct fv_sim_world *world, const struct fv_sim_options *options);
void fv_sim_world_free(struct fv_sim_world *world);
/* Put the moving objects where they are at `time_s`. */
void fv_sim_world_place(struct fv_sim_world *world, double time_s);

/* Building blocks (world.c). What they make is an obstacle, until its `truth_class` says other. */
uint16_t fv_sim_world_texture(struct fv_sim_world *world, enum fv_sim_material material,
                              double width_m, double height_m, double texels_per_m, bool wall);
struct fv_sim_face *fv_sim_world_face(struct fv_sim_world *world, const double origin[3],
                                      const double u[3], const double v[3], uint16_t texture,
                                      double light);
/* Upright box with its middle at (x, y), standing on z; `faces` bits: 1 -x, 2 +x, 4 -y, 8 +y, 16
 * top, 32 bottom. */
void fv_sim_world_box(struct fv_sim_world *world, const double center[2], double z,
                      const double size[3], double yaw, uint16_t side, uint16_t top, uint32_t faces,
                      double texels_per_m);
struct fv_sim_round *fv_sim_world_round(struct fv_sim_world *world, double x, double y, double z,
                                        double height, uint16_t texture);

/* Places (places.c), objects (objects.c). */
void fv_sim_place_room(struct fv_sim_world *world, bool store);
void fv_sim_place_corridor(struct fv_sim_world *world);
void fv_sim_place_hall(struct fv_sim_world *world);
void fv_sim_place_house(struct fv_sim_world *world);
void fv_sim_objects_create(struct fv_sim_world *world, const struct fv_sim_options *options);
/* Where an object's foot is and which way it heads. */
void fv_sim_object_pose(const struct fv_sim_object *object, double time_s, double position[2],
                        double *heading);
/* Closed lane round a rectangle with rounded corners: place after `along` metres, heading. */
void fv_sim_ring(const double half[2], double corner, double along, double position[2],
                 double *heading);
double fv_sim_ring_length(const double half[2], double corner);

/* ---- motion (motion.c) ----------------------------------------------------------------------- */

enum { FV_SIM_SPLINE_MAX = 160, FV_SIM_PHASES = 32 };

struct fv_sim_motion {
    enum fv_sim_trajectory trajectory;
    double phase[FV_SIM_PHASES];
    double direction;    /* +1 or -1: which way round */
    double turn_s;       /* how long a turn of `fast` takes */
    double half_view[2]; /* angles from the optical axis to the image's border, across and down */
    double room[2], lane[2], store[3];
    const struct fv_sim_road *road; /* the world's, as the next */
    const struct fv_sim_drive *drive;
    int32_t control_count; /* uniform cubic B-spline, one control point a second: x y z yaw pitch */
    double control[FV_SIM_SPLINE_MAX][5];
};

void fv_sim_motion_create(struct fv_sim_motion *motion, const struct fv_sim_options *options,
                          const struct fv_sim_world *world);
/* Frames of one showing at `rate_hz`; 0: endless. */
uint64_t fv_sim_motion_frames(enum fv_sim_trajectory trajectory, double rate_hz);
/* Of the first camera. */
void fv_sim_motion_pose(const struct fv_sim_motion *motion, double time_s, double T_world_cam[12]);
/* Of the body: the first camera's frame, but with FV_SIM_DRIVE the robot's. */
void fv_sim_motion_body(const struct fv_sim_motion *motion, double time_s, double T_world_body[12]);

/* The calibration board of `sim:board` (board.c): 10 x 7 squares of 30 mm (9 x 6 inner corners) and
 * a margin of one square, upright in the middle of the room, seen from -x. */
void fv_sim_place_board(struct fv_sim_world *world);
void fv_sim_board_pose(const struct fv_sim_motion *motion, double time_s, double position[3],
                       double *yaw, double *pitch, double *roll);
void fv_sim_paint_board(struct fv_sim_brush *brush);
/* Move persons along their lanes until they keep clear of the camera between two times, as far as
 * 24 tries allow. */
void fv_sim_objects_clear(struct fv_sim_world *world, const struct fv_sim_motion *motion,
                          double begin_s, double end_s);

/* ---- scene and rendering (scene.c, render.c, sensor.c) --------------------------------------- */

enum {
    FV_SIM_TILE = 16,
    FV_SIM_TILE_PIXELS = FV_SIM_TILE * FV_SIM_TILE,
    FV_SIM_BLOCK_TILES = 4, /* tiles per side of a block, the coarser level of culling */
    FV_SIM_BLOCK_ROWS = FV_SIM_TILE * FV_SIM_BLOCK_TILES,
    FV_SIM_CANVAS_ROWS =
        3 * FV_SIM_BLOCK_ROWS, /* a row of blocks whose edges are smoothed, and its neighbours */
    FV_SIM_SURFACES_MAX = FV_SIM_FACES_MAX + FV_SIM_ROUNDS_MAX
};

/* One surface as the camera sees it: everything in the camera frame, single precision. */
struct fv_sim_surface {
    float inverse_z[3], u[3],
        v[3];        /* face: affine in (x, y, 1), u and v scaled to [0, 1] and divided by z */
    float cut[2][3]; /* face that is cut: to where both are positive, affine in (x, y, 1) */
    float area;      /* face: texel^2 per unit of normalised area at z = 1 */
    float slant;     /* face: 1 / distance of the plane; round: 1 / smallest z */
    float x_min, x_max, y_min, y_max; /* bounds in the normalised plane */
    float p[3], a[3], e1[3], e2[3];   /* round: base, axis and the two sides */
    float height, q1, q2, k, pa,
        c; /* round: k = 1 + q2, pa = p.a, c the constant of the quadratic */
    float tex_u, tex_v, tex_du, tex_dv, light, sun[3];
    const struct fv_sim_texture *texture;
    uint16_t object;
    uint8_t truth_class;
    bool is_round, disc, is_cut;
};

struct fv_sim_rect {
    float x_min, x_max, y_min, y_max;
};

/* What never changes for a camera: a bearing for every pixel, tile by tile. */
struct fv_sim_raster {
    int32_t width, height, tiles_x, tiles_y;
    float *x, *y;              /* tile-major, FV_SIM_TILE_PIXELS each */
    struct fv_sim_rect *bound; /* of each tile, a pixel of margin included */
    float *pixel_area; /* of each tile: normalised area of a pixel at its middle, times the root of
                          |ray| */
    bool filled;
};

struct fv_sim_scene {
    int32_t surface_count;
    struct fv_sim_surface surface[FV_SIM_SURFACES_MAX];
};

/* (X/Z, Y/Z) of `count` pixels of a row, from pixel (px, py) on (rays.c). False: one of them is not
 * seen, or looks too far aside. */
bool fv_sim_rays(const struct fovea_camera *camera, double px, double py, int32_t count,
                 double (*at)[2]);

/* False: no memory, or a camera that looks too far aside. */
bool fv_sim_raster_create(struct fv_sim_raster *raster, const struct fovea_camera *camera);
/* Once, before the first picture: it takes longer than all else of opening a source. */
bool fv_sim_raster_fill(struct fv_sim_raster *raster, const struct fovea_camera *camera);
void fv_sim_raster_free(struct fv_sim_raster *raster);
/* Turn the world into surfaces for one camera pose; what cannot be seen is left out. */
void fv_sim_scene_set(struct fv_sim_scene *scene, const struct fv_sim_world *world,
                      const double T_world_cam[12], const struct fv_sim_rect *bound);
/* Surfaces of `from` (NULL: all of the scene) that may be seen in `bound`; returns how many.
 * `*covered` says whether the first one is alone and fills the bound. */
int32_t fv_sim_scene_cull(const struct fv_sim_scene *scene, const uint16_t *from,
                          int32_t from_count, const struct fv_sim_rect *bound, uint16_t *list,
                          bool *covered);

/* Working memory of the renderer. It may hold fewer rows than the image has: pixel row y is at row
 * y % rows. */
struct fv_sim_canvas {
    uint16_t *linear;  /* light, 8 bits of fraction, width x rows */
    uint16_t *surface; /* seen surface + 1, width x rows */
    int32_t rows;      /* those of the image, or FV_SIM_CANVAS_ROWS where these are fewer */
    /* NULL, or called with rows that are done, from top to bottom: they stay until the next call.
     */
    void (*finished)(void *context, const uint16_t *linear, int32_t y_begin, int32_t y_end);
    void *context;
};

/* Light of the pixel rows [y_begin, y_end) into the canvas. Real-time safe. */
void fv_sim_render(const struct fv_sim_scene *scene, const struct fv_sim_raster *raster,
                   int32_t y_begin, int32_t y_end, struct fv_sim_canvas *canvas);
/* Which surface each of `count` <= FV_SIM_TILE_PIXELS rays meets (index into `list`, -1: none), and
 * 1/z there. */
void fv_sim_trace(const struct fv_sim_scene *scene, const uint16_t *list, int32_t list_count,
                  const float *x, const float *y, int32_t count, float *inverse_z, int32_t *hit);

/* Light to grey levels with noise, a pure function of the arguments: begun for each frame, then
 * handed its pixels in order, each time but the last a multiple of FV_SIM_SENSOR_LANES. */
enum { FV_SIM_SENSOR_LANES = 64 };
struct fv_sim_sensor {
    uint32_t state[FV_SIM_SENSOR_LANES];
    uint16_t gain;  /* 256ths */
    int16_t spread; /* 1/256 grey levels per 256 of a sum of four random bytes */
};
void fv_sim_sensor_begin(struct fv_sim_sensor *sensor, double light, double noise, uint64_t seed);
void fv_sim_sensor_expose(struct fv_sim_sensor *sensor, const uint16_t *linear, int32_t count,
                          uint8_t *grey);

/* ---- the source (source.c, truth.c) ---------------------------------------------------------- */

/* A sensor on the body beside the cameras: a row of the list below, defined in its own file. */
struct fv_sim_body_sensor {
    enum fovea_sample_kind kind;
    const char *name;   /* of the option that holds its rate */
    size_t hz;          /* offset of that option in the options, samples per second; 0: none */
    size_t state_bytes; /* that it keeps from sample to sample, zero at first */
    /* Describe it in the rig; NULL: the rig has no room for this kind. */
    void (*describe)(const struct fv_sim_options *options, struct fovea_rig *rig);
    /* Fill in sample n (each is requested once, in order) but its stamp, in a run whose first frame
     * is `begin_s` after frame 0. */
    void (*sample)(const struct fovea_source *source, void *state, uint64_t n, double begin_s,
                   struct fovea_sample *sample);
};

/* All of them; of two samples with one stamp, that of the earlier row comes first. */
#define FV_SIM_BODY_SENSORS(ROW)                                                                   \
    ROW(imu)                                                                                       \
    ROW(wheel_odometry)

#define FV_SIM_BODY_SENSOR_DECLARE(name) extern const struct fv_sim_body_sensor fv_sim_##name;
FV_SIM_BODY_SENSORS(FV_SIM_BODY_SENSOR_DECLARE)
#undef FV_SIM_BODY_SENSOR_DECLARE

enum {
#define FV_SIM_BODY_SENSOR_INDEX(name) FV_SIM_BODY_SENSOR_##name,
    FV_SIM_BODY_SENSORS(FV_SIM_BODY_SENSOR_INDEX)
#undef FV_SIM_BODY_SENSOR_INDEX
        FV_SIM_BODY_SENSOR_COUNT
};

struct fovea_source {
    struct fovea_source_info info;
    struct fovea_source_selection selection;
    struct fv_sim_options options;
    struct fv_sim_motion motion;
    struct fv_sim_raster raster;
    struct fv_sim_canvas canvas;
    struct fv_sim_sensor sensor;
    struct fv_sim_world world;
    struct fv_sim_scene scene;
    uint32_t camera; /* of the rig, which the scene is seen by */
    /* What is requested by any thread (sim_control), and what the frame that is rendered
     * takes of it. The brightness of the address's exposure at gain 1 is that of `light`. */
    struct {
        _Atomic double exposure_ms, gain;
    } requested;
    struct {
        double exposure_ms, gain;
    } taken;
    uint8_t *image[FOVEA_SOURCE_FRAMES_HELD_MAX][FOVEA_CAMERAS_MAX];
    uint64_t image_index[FOVEA_SOURCE_FRAMES_HELD_MAX]; /* trajectory frame shown in it */
    bool held[FOVEA_SOURCE_FRAMES_HELD_MAX];
    uint64_t deliverable; /* frames that the selection leaves; 0: endless */
    uint64_t delivered;
    bool started;
    void *sensor_state[FV_SIM_BODY_SENSOR_COUNT];
    uint64_t sample_count[FV_SIM_BODY_SENSOR_COUNT]; /* that came */
    struct fv_sim_commands commands;
    uint8_t *dirt[FOVEA_CAMERAS_MAX]; /* on the lenses, of each pixel; only of the road */
    uint16_t *lensed;  /* light behind the lens, as large as the canvas; only of the road */
    int32_t veil;      /* light that the sun spreads over the picture */
    uint8_t *grey;     /* the image that is rendered */
    uint16_t *exposed; /* light of the whole frame, only with blur (the mean of instants) or a
                          rolling shutter */
    float *depth_m;    /* truth; pages untouched until asked for */
    uint8_t *class_mask;
    uint8_t *object_map;
};

/* Time on the trajectory at the middle of exposure of a frame's middle row. */
double fv_sim_frame_time(const struct fovea_source *source, uint64_t index);
/* Set the scene for an instant, for surfaces that may show in pixel rows [y_begin, y_end). */
void fv_sim_set_scene(struct fovea_source *source, double time_s, int32_t y_begin, int32_t y_end);
/* Rolling shutter: rows that share an instant, and their delay against the middle row, seconds. */
int32_t fv_sim_band_rows(const struct fovea_source *source);
double fv_sim_row_delay(const struct fovea_source *source, int32_t y_begin, int32_t y_end);
enum fovea_status fv_sim_truth(struct fovea_source *source, const struct fovea_frame *frame,
                               struct fovea_truth *truth);
enum fovea_status fv_sim_truth_pose(struct fovea_source *source, const struct fovea_frame *frame,
                                    double T_world_cam[12]);

/* Rigid transforms of three rows [R t] (pose.c). From a to b: R = Ra^T Rb, t = Ra^T (tb - ta); a
 * then b; what an option states; and a rotation as a unit quaternion with w >= 0. */
void fv_sim_relative(const double a[12], const double b[12], double R[9], double t[3]);
void fv_sim_compose(const double a[12], const double b[12], double T[12]);
void fv_sim_pose_rows(const struct fv_uri_pose *pose, double T[12]);
void fv_sim_quaternion(const double R[9], double q[4]);

/* Cameras of the rig that the options ask for, on a body whose frame is the first camera's
 * (rig.c). */
enum fovea_status fv_sim_rig_describe(const struct fv_sim_options *options, struct fovea_rig *rig,
                                      struct fovea_error *error);
/* Add the sensors to the source's info; refuse what cannot be taken with the frames
 * (body_sensors.c). */
enum fovea_status fv_sim_body_sensors_open(struct fovea_source *source, struct fovea_error *error);
void fv_sim_body_sensors_close(struct fovea_source *source);
uint32_t fv_sim_samples(struct fovea_source *source, const struct fovea_frame *frame,
                        struct fovea_sample *samples, uint32_t count_max);

extern const struct fovea_source_ops fv_source_sim;

#endif
