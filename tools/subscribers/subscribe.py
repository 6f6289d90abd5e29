#!/usr/bin/env python3
"""Listen to Fovea's messages: print each, and at the end how many came on each channel and whether any is missing.

Needs the Python package `lcm` (pip install lcm) and the types, made by `make python-types` (lcm-gen -p); their folder is
build/python unless --types names another. About buffers see subscribe.c: what holds there holds here, and Python is
slower, so both are large. Like subscribe.c it receives through liblcm, which a forged fragment ends (docs/security.md).
"""
import argparse
import os
import re
import select
import signal
import struct
import sys
import time

here = os.path.dirname(os.path.abspath(__file__))
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--url", default="udpm://239.255.76.67:7667?ttl=0&recv_buf_size=8388608", help="LCM URL")
parser.add_argument("--prefix", default="FOVEA", help="channel_prefix of the runtime")
parser.add_argument("--idle", type=float, default=0, help="end when no message has come for this number of seconds; 0: never")
parser.add_argument("--quiet", action="store_true", help="print the summary only")
parser.add_argument("--types", default=os.path.join(here, "..", "..", "build", "python"), help="folder of the types")
options = parser.parse_args()
sys.path.insert(0, options.types)

try:
    import lcm
except ImportError:
    sys.exit("subscribe.py: found no package lcm, expected it from: pip install lcm")
try:
    import bot_core
    import fovea
except ImportError:
    sys.exit(f"subscribe.py: found no types in {options.types}, expected them from: make python-types")


STATES = ("starting", "tracking", "weak", "lost", "paused", "coasting")
SCALES = ("free", "initialising", "metric")


def name_of(names, value):
    return names[value] if 0 <= value < len(names) else "unknown"


def tell_pose(m):
    unit = "m" if m.scale_state == m.SCALE_METRIC else "units"
    text = "%s, %s in %s: position %.3f %.3f %.3f %s, scale %s" % (name_of(STATES, m.state), m.child_frame, m.parent_frame,
                                                                 *m.position, unit, name_of(SCALES, m.scale_state))
    if m.scale_state == m.SCALE_METRIC:
        text += " to %.1f %%" % (100 * m.scale_sigma)
    return text + ", quality %.2f, %d inliers, map %d, reset %d" % (m.quality, m.inliers, m.map_id, m.reset_counter)


def tell_bot_core(m):
    return "position %.3f %.3f %.3f m, velocity %.3f %.3f %.3f m/s" % (*m.pos, *m.vel)


TELL = {
    "POSE": (fovea.pose_t, tell_pose),
    "CAMERA_POSE": (fovea.pose_t, tell_pose),
    "BOT_CORE_POSE": (bot_core.pose_t, tell_bot_core),
    "FEATURES": (fovea.features_t, lambda m: f"{m.count} of {m.asked} features"),
    "CAMERA_STATUS": (fovea.camera_status_t, lambda m: f"state {m.state}, {m.width} x {m.height} {m.pixel_format}"),
    "STATISTICS": (fovea.statistics_t, lambda m: f"{m.frames_in} frames in, {m.frames_processed} processed"),
    "CALIBRATION_WARNING": (fovea.calibration_warning_t, lambda m: f"state {m.state}, residuals {m.rms_px:.2f} px, {m.expected_px:.2f} px with the focal length that fits {m.reason}"),
    "GRID": (fovea.grid_t, lambda m: f"{m.width} x {m.height} cells of {m.resolution_m} m, rows {m.first_row} to {m.first_row + m.row_count - 1}, {sum(0 <= c < 100 * m.free_below for c in m.cells)} free, {sum(c > 100 * m.occupied_above for c in m.cells)} occupied"),
    "GRID_HEIGHTS": (fovea.height_grid_t, lambda m: f"rows {m.first_row} to {m.first_row + m.row_count - 1}, {sum(h != m.UNKNOWN for h in m.height_mm)} heights known, the highest {max((h for h in m.height_mm if h != m.UNKNOWN), default=0)} mm"),
    "SCAN": (fovea.scan_t, lambda m: f"{m.count} ranges, the nearest obstacle at {min((r for r in m.range_m if r == r), default=float('nan')):.2f} m"),
    "EDGES": (fovea.edges_t, lambda m: f"{m.method} of {m.width} x {m.height}, rows {m.first_row} to {m.first_row + m.row_count - 1}, {m.segment_count} segments"),
    "PREVIEW": (fovea.preview_t, lambda m: f"{m.width} x {m.height}, {m.size_bytes} bytes of JPEG"),
    "MAP": (fovea.map_t, lambda m: f"map {m.map_id}, {m.landmark_count} landmarks and {m.keyframe_count} keyframes listed"),
    "DETECTIONS": (fovea.detections_t, lambda m: "%d objects found by %s, the best %s with %.2f" % (
        m.count, m.model, m.detections[0].class_name if m.count else "none", m.detections[0].score if m.count else 0)),
    "OBJECTS": (fovea.objects_t, lambda m: f"{m.count} objects, the newest {m.objects[-1].id if m.count else 0}"),
    "RUN": (fovea.run_t, None),
}


last_run = None


def on_run(name, message):
    """Who sends: printed when it changes, which is a restart or a second sender."""
    global last_run
    if message.run_id != last_run:
        print(f"{name}: run {message.run_id & (1 << 64) - 1:016x} of process {message.process} on {message.host}, "
              f"Fovea {message.version}{': a restart, or another sender' if last_run is not None else ''}")
    last_run = message.run_id


class Channel:
    """What came on one channel."""

    def __init__(self):
        self.messages = self.bytes = self.gaps = self.malformed = 0
        self.first = self.last = -1

    def count(self, data, sequence):
        if self.messages == 0:
            self.first = sequence
        elif sequence > self.last + 1:
            self.gaps += sequence - self.last - 1
        self.last = sequence
        self.messages += 1
        self.bytes += len(data)


channels = {suffix: Channel() for suffix in TELL}


def on_message(name, data):
    suffix = name[len(options.prefix) + 1:]
    kind, tell = TELL[suffix]
    try:
        message = kind.decode(data)
    except (ValueError, TypeError, IndexError, OverflowError, MemoryError, struct.error) as problem:
        channels[suffix].malformed += 1
        print(f"{name}: {problem}", file=sys.stderr)
        return
    if suffix == "RUN":
        channels[suffix].count(data, channels[suffix].last + 1)
        on_run(name, message)
        return
    if suffix == "BOT_CORE_POSE":  # which knows its time, but not the number of its frame
        channels[suffix].count(data, channels[suffix].last + 1)
        if not options.quiet:
            print(f"{name}: at {message.utime * 1e-6:.6f} s: {tell(message)}")
        return
    channels[suffix].count(data, message.stamp.sequence)
    if not options.quiet:
        print(f"{name}: frame {message.stamp.sequence} at {message.stamp.time_ns * 1e-9:.6f} s: {tell(message)}")


stopping = False


def on_signal(*_):
    global stopping
    stopping = True


def listen():
    connection = lcm.LCM(options.url)
    for suffix in TELL:
        pattern = re.escape(f"{options.prefix}_{suffix}")  # to LCM it is a regular expression
        connection.subscribe(pattern, on_message).set_queue_capacity(1000)
    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    print("listening", flush=True)
    last = time.monotonic()
    while not stopping and (options.idle == 0 or time.monotonic() - last < options.idle):
        if select.select([connection.fileno()], [], [], 0.1)[0]:  # handle_timeout takes a signal for a fault
            connection.handle()
            last = time.monotonic()


listen()
for suffix, channel in channels.items():
    if channel.messages > 0 or channel.malformed > 0:
        print(f"{suffix} {channel.messages} messages, {channel.bytes} bytes, frames {channel.first} to {channel.last}, "
              f"{channel.malformed} malformed")
if channels["FEATURES"].messages > 0:
    print(f"missing {channels['FEATURES'].gaps}")
sys.exit(1 if channels["FEATURES"].gaps > 0 else 0)
