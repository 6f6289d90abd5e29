#!/usr/bin/env python3
"""Poses of a running Fovea by LCM: a line for each, until MESSAGES have come.

    subscriber.py [URL [MESSAGES]]

Needs the package lcm (pip install lcm) and the types (make python-types; their folder is build/python, or $FOVEA_TYPES).
The pose is T_odom_body: where the robot's body is, in the frame that it had at the start."""
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.environ.get("FOVEA_TYPES", os.path.join(HERE, "..", "..", "build", "python")))

import lcm  # noqa: E402
from fovea import pose_t  # noqa: E402

STATES = {pose_t.STATE_STARTING: "starting", pose_t.STATE_TRACKING: "tracking", pose_t.STATE_WEAK: "weak",
          pose_t.STATE_LOST: "lost", pose_t.STATE_PAUSED: "paused", pose_t.STATE_COASTING: "coasting"}
received = 0


def on_pose(channel, data):
    global received
    received += 1
    pose = pose_t.decode(data)
    line = f"{channel} {pose.stamp.time_ns * 1e-9:.3f} {STATES.get(pose.state, 'unknown')}"
    if pose.state in (pose_t.STATE_TRACKING, pose_t.STATE_WEAK):
        unit = "m" if pose.scale_state == pose_t.SCALE_METRIC else "units"
        line += " {:.3f} {:.3f} {:.3f} ".format(*pose.position) + unit
    print(line, flush=True)


listener = lcm.LCM(sys.argv[1]) if len(sys.argv) > 1 else lcm.LCM()
wanted = int(sys.argv[2]) if len(sys.argv) > 2 else 0  # 0: for ever
listener.subscribe("FOVEA_POSE", on_pose)
print("listening", flush=True)
while wanted == 0 or received < wanted:
    listener.handle()
