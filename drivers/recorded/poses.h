/* Ground truth of data sets: poses by stamp, interpolated, or one per frame. */
#ifndef FOVEA_RECORDED_POSES_H
#define FOVEA_RECORDED_POSES_H

#include "fovea/source.h"

/* Poses are interpolated over at most this gap; frames further from any pose have none. */
#define FV_POSES_GAP_NS INT64_C(250000000)

struct fv_pose {
    int64_t stamp_ns;
    double position_m[3];
    double rotation_wxyz[4]; /* unit quaternion: body to world */
};

struct fv_poses {
    struct fv_pose *by_stamp;
    double (*by_index)[12]; /* T_world_cam, row-major 3x4 */
    size_t count;
    size_t heap_bytes;
    double T_body_cam[12]; /* of poses by stamp */
};

/* Layouts of a line: EuRoC "stamp_ns,px,py,pz,qw,qx,qy,qz,...", TUM "stamp_s px py pz qx qy qz qw".
 * Stamps must rise, quaternions be of length 1 within 5 %. */
enum fv_poses_layout { FV_POSES_EUROC, FV_POSES_TUM };

enum fovea_status fv_poses_read(const char *path, enum fv_poses_layout layout,
                                const double T_body_cam[12], struct fv_poses *poses,
                                struct fovea_error *error);

/* KITTI: 12 numbers per line, line N (from 0) for frame N. */
enum fovea_status fv_poses_read_kitti(const char *path, struct fv_poses *poses,
                                      struct fovea_error *error);

void fv_poses_free(struct fv_poses *poses);

/* T_world_cam at a stamp (normalised linear interpolation of the quaternion, which at these gaps
 * differs from the great circle by less than 1e-4 of the turn between the samples) or of a frame.
 * False: there is none. Real-time safe. */
bool fv_poses_at(const struct fv_poses *poses, int64_t stamp_ns, uint64_t index,
                 double T_world_cam[12]);

#endif
