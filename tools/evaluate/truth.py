"""Ground truth of the recordings as evo trajectories of the camera (T_world_cam)."""
import os

import numpy as np
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface


def _sensor_transform(path):
    """T_BS of an EuRoC sensor.yaml: sensor points to the body."""
    text = open(path).read()
    start = text.index("[", text.index("T_BS"))
    numbers = text[start + 1:text.index("]", start)].replace(",", " ").split()
    return np.array([float(n) for n in numbers]).reshape(4, 4)


def euroc(folder):
    T_body_cam = _sensor_transform(os.path.join(folder, "mav0/cam0/sensor.yaml"))
    body = file_interface.read_euroc_csv_trajectory(
        os.path.join(folder, "mav0/state_groundtruth_estimate0/data.csv"))
    body.transform(T_body_cam, right_mul=True)
    return body


def kitti(folder):
    poses = file_interface.read_kitti_poses_file(os.path.join(folder, "poses.txt"))
    times = np.loadtxt(os.path.join(folder, "times.txt"))
    return PoseTrajectory3D(poses_se3=poses.poses_se3, timestamps=times[:len(poses.poses_se3)])


def tum(folder):
    return file_interface.read_tum_trajectory_file(os.path.join(folder, "groundtruth.txt"))


READERS = {"euroc": euroc, "kitti": kitti, "tum": tum}
