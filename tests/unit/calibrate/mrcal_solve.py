"""Calibrate one camera by mrcal from corners on stdin; Debian's python3-mrcal 2.2.

Input, all numbers in text: columns, rows, side of a square, width, height, number of views; then
the pixels x, y of every corner, view by view and row by row. Output: "cost" (the sum of
squared residuals), "camera" (fx fy cx cy and the coefficients of LENSMODEL_OPENCV5) and "stdev" (100
standard deviations of projection in its worst direction, at infinity, of 1 px of noise in a
coordinate, at the centres of 10 x 10 cells, row by row).

mrcal starts from its own seed, not from the result that it is compared with. Neither outliers are
rejected, nor is anything regularised, nor is the board bent.
"""

import sys

import mrcal
import numpy as np

MODEL = "LENSMODEL_OPENCV5"
FOCAL_SEED_PX = 500


def read_inputs(text):
    words = text.split()
    columns, rows = int(words[0]), int(words[1])
    square, width, height, count = float(words[2]), int(words[3]), int(words[4]), int(words[5])
    pixels = np.array(words[6:], dtype=float).reshape(count, rows, columns, 2)
    observations = np.concatenate((pixels, np.ones((count, rows, columns, 1))), axis=-1)
    indices = np.zeros((count, 3), dtype=np.int32)
    indices[:, 0] = np.arange(count)
    indices[:, 2] = -1
    sizes = np.array(((width, height),), dtype=np.int32)
    return {
        "extrinsics_rt_fromref": np.zeros((0, 6)),
        "points": None,
        "observations_board": observations,
        "indices_frame_camintrinsics_camextrinsics": indices,
        "observations_point": None,
        "indices_point_camintrinsics_camextrinsics": None,
        "imagersizes": sizes,
        "calibration_object_spacing": square,
        "calobject_warp": None,
        "do_optimize_calobject_warp": False,
        "do_optimize_frames": True,
        "do_optimize_extrinsics": True,  # projection_uncertainty asks for it
        "do_apply_outlier_rejection": False,
        "do_apply_regularization": False,
        "verbose": False,
    }


def solve(inputs):
    width, height = inputs["imagersizes"][0]
    first = [FOCAL_SEED_PX, FOCAL_SEED_PX, (width - 1) / 2, (height - 1) / 2]
    pinhole = ("LENSMODEL_PINHOLE", np.array(first))
    inputs["frames_rt_toref"] = np.array([
        mrcal.rt_from_Rt(pose)
        for pose in mrcal.estimate_monocular_calobject_poses_Rt_tocam(
            inputs["indices_frame_camintrinsics_camextrinsics"][:, :2].copy(),
            inputs["observations_board"], inputs["calibration_object_spacing"],
            [mrcal.cameramodel(intrinsics=pinhole, imagersize=inputs["imagersizes"][0])])
    ])
    # The focal length first, then everything.
    inputs["lensmodel"] = pinhole[0]
    inputs["intrinsics"] = np.array([first])
    mrcal.optimize(**inputs, do_optimize_intrinsics_core=True,
                   do_optimize_intrinsics_distortions=False)
    inputs["lensmodel"] = MODEL
    inputs["intrinsics"] = np.concatenate((inputs["intrinsics"], np.zeros((1, 5))), axis=1)
    inputs["do_optimize_intrinsics_core"] = inputs["do_optimize_intrinsics_distortions"] = True
    # A solve stops at a small step; from there the next goes on.
    for _ in range(3):
        residuals = mrcal.optimize(**inputs)["x"]
    return float(np.dot(residuals, residuals))


def uncertainty(inputs):
    width, height = inputs["imagersizes"][0]
    model = mrcal.cameramodel(optimization_inputs=inputs, icam_intrinsics=0)
    x = (np.arange(10) + .5) * width / 10 - .5
    y = (np.arange(10) + .5) * height / 10 - .5
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    rays = mrcal.unproject(grid, MODEL, inputs["intrinsics"][0])
    return mrcal.projection_uncertainty(rays, model, atinfinity=True, what="worstdirection-stdev",
                                        observed_pixel_uncertainty=1.)


def main():
    inputs = read_inputs(sys.stdin.read())
    cost = solve(inputs)
    print("cost %.17g" % cost)
    print("camera", *("%.17g" % value for value in inputs["intrinsics"][0]))
    print("stdev", *("%.17g" % value for value in uncertainty(inputs).ravel()))


if __name__ == "__main__":
    main()
