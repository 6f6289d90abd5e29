#!/usr/bin/env python3
"""Show a run of Fovea in Rerun's viewer, or write it into a file for it: pose and path, map, pictures with boxes, times, changes of state.

Needs the Python packages rerun-sdk and lcm (pip install rerun-sdk lcm), and the types, made by `make python-types`.
With --save run.rrd it writes a file for `rerun run.rrd`.
Poses are those of the body in `odom`, which stands in `map`; a new map begins with an empty path. Pictures are the run's previews (preview.period_frames).
"""
import argparse
import os
import select
import sys
import time

here = os.path.dirname(os.path.abspath(__file__))
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--url", default="udpm://239.255.76.67:7667?ttl=0&recv_buf_size=8388608", help="LCM URL")
parser.add_argument("--prefix", default="FOVEA", help="channel_prefix of the runtime")
parser.add_argument("--save", metavar="FILE", help="write a file in place of opening the viewer")
parser.add_argument("--idle", type=float, default=0, help="end when no message has come for this number of seconds; 0: never")
parser.add_argument("--types", default=os.path.join(here, "..", "..", "build", "python"))
options = parser.parse_args()
sys.path.insert(0, options.types)
try:
    import lcm
    import rerun as rr
    import fovea
except ImportError as error:
    sys.exit(f"rerun_viewer.py: {error}; expected rerun-sdk and lcm (pip install rerun-sdk lcm), and the types (make python-types)")

STATES = ("starting", "tracking", "weak", "lost", "paused", "coasting")
PATH_MAX, AXES = 20000, [[0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3]]
path, landmarks, last = [], {}, {"state": None, "world": None, "scale": 1.0}


def placed(entity, position, orientation, scale=1.0):
    w, x, y, z = orientation
    rr.log(entity, rr.Transform3D(translation=position, quaternion=rr.Quaternion(xyzw=[x, y, z, w]), scale=scale))


def pose(m):
    if m.state != last["state"]:
        rr.log("log", rr.TextLog(STATES[m.state] if 0 <= m.state < len(STATES) else str(m.state), level="INFO" if m.state == m.STATE_TRACKING else "WARN"))
        last["state"] = m.state
    if (m.map_id, m.reset_counter, m.change_count) != last["world"]:
        last["world"] = (m.map_id, m.reset_counter, m.change_count)
        path.clear()
    rr.log("plots/inliers", rr.Scalars(m.inliers))
    if m.map_id < 0 or m.position[0] != m.position[0]:
        return
    path.append(m.position)
    del path[:-PATH_MAX]
    placed("map/odom", m.map_position, m.map_orientation, m.map_scale)
    placed("map/odom/body", m.position, m.orientation)
    rr.log("map/odom/body/axes", rr.Arrows3D(vectors=AXES, colors=[[255, 0, 0], [0, 255, 0], [0, 0, 255]]))
    rr.log("map/odom/path", rr.LineStrips3D([path]))


def world_map(m):
    for slot in range(m.landmark_first, m.landmark_last):  # those that are not listed are empty
        landmarks.pop(slot, None)
    for slot, of, point in zip(m.landmark_slot, m.landmark_map, m.landmark_p):
        if of == m.map_id:
            landmarks[slot] = point
    placed("map/own", m.own_position, m.own_orientation, m.own_scale)
    rr.log("map/own/landmarks", rr.Points3D(list(landmarks.values()), radii=rr.Radius.ui_points(1.5)))


def preview(m):
    last["scale"] = m.scale
    rr.log("camera/picture", rr.EncodedImage(contents=m.jpeg, media_type="image/jpeg"))


def objects(m):
    seen = [o for o in m.objects if o.state in (o.STATE_CONFIRMED, o.STATE_COASTING)]
    at = [[value / last["scale"] for value in (o.box.x_min_px, o.box.y_min_px, o.box.x_max_px, o.box.y_max_px)] for o in seen]
    rr.log("camera/picture/objects", rr.Boxes2D(array=at, array_format=rr.Box2DFormat.XYXY, labels=[f"{o.class_name} {o.id}" for o in seen]))


def statistics(m):
    for stage in m.stages:
        rr.log("plots/ms/" + stage.name, rr.Scalars(stage.wall_ns * 1e-6))


TAKE = {"POSE": (fovea.pose_t, pose), "MAP": (fovea.map_t, world_map), "PREVIEW": (fovea.preview_t, preview),
        "OBJECTS": (fovea.objects_t, objects), "STATISTICS": (fovea.statistics_t, statistics)}


def take(channel, data):
    kind, show = TAKE[channel[len(options.prefix) + 1:]]
    message = kind.decode(data)
    rr.set_time("stamp", duration=message.stamp.time_ns * 1e-9)
    show(message)
    last["heard"] = time.monotonic()


rr.init("fovea", spawn=options.save is None)
if options.save:
    rr.save(options.save)
bus = lcm.LCM(options.url)
for suffix in TAKE:
    bus.subscribe(f"{options.prefix}_{suffix}", take).set_queue_capacity(1000)
last["heard"] = time.monotonic()
try:
    while not options.idle or time.monotonic() - last["heard"] < options.idle:
        if select.select([bus.fileno()], [], [], 0.2)[0]:  # handle_timeout takes a signal for a fault
            bus.handle()
except KeyboardInterrupt:
    pass
