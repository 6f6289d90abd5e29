"""What tools/mcap.py makes of a recording, read by the packages of MCAP and Foxglove: every message with its stamps, and the recording again.

Usage: mcap_check.py RECORDING FOLDER
"""
import json
import os
import struct
import subprocess
import sys

import mcap.reader
import mcap.writer  # noqa: F401
from mcap_protobuf.decoder import DecoderFactory

here = os.path.dirname(os.path.abspath(__file__))
tools = os.path.join(here, "..", "..", "tools")
sys.path += [os.path.join(tools, "subscribers"), os.path.join(here, "..", "common")]
import read_recording  # noqa: E402
from tool_copy import run_copy  # noqa: E402

recording, folder = sys.argv[1:]
made, again, kept = (os.path.join(folder, name) for name in ("made.mcap", "again.lcm", "kept"))


tool = os.path.join(tools, "mcap.py")


def run(*arguments):
    return subprocess.run([sys.executable, tool, *arguments], capture_output=True, text=True)


def expect(holds, what):
    if not holds:
        sys.exit(f"mcap_check: {what}")


def log_events(path):
    """Our own reading of the log, apart from the tool's."""
    data, at = open(path, "rb").read(), 0
    while at < len(data):
        sync, number, utime, channel_bytes, data_bytes = struct.unpack_from(">IQQII", data, at)
        expect(sync == 0xEDA1DA01, "no event")
        at += 28
        yield number, utime, data[at:at + channel_bytes].decode(), data[at + channel_bytes:at + channel_bytes + data_bytes]
        at += channel_bytes + data_bytes


def check_every_message():
    events = list(log_events(recording))
    with open(made, "rb") as file:
        found = [(m.sequence, m.log_time, c.topic, m.data)
                 for _, c, m in mcap.reader.make_reader(file).iter_messages(log_time_order=False) if c.message_encoding == "lcm"]
    expect(len(found) == len(events) > 100, f"found {len(found)} messages, expected {len(events)}")
    for one, (number, utime, channel, data) in zip(found, events):
        expect(one == (number, utime * 1000, channel, data), f"event {number} differs")
    with open(made, "rb") as file:
        for schema in mcap.reader.make_reader(file).get_summary().schemas.values():
            expect(schema.encoding != "lcm" or f"struct {schema.name.split('.')[1]}" in schema.data.decode(), f"{schema.name}: no definition")


def ns(stamp):
    return stamp.seconds * 1000000000 + stamp.nanos


def matrix(q):
    """Of the unit quaternion w x y z, by its columns' definition."""
    w, x, y, z = q
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def apply(scale, q, t, p):
    return [scale * sum(row[i] * p[i] for i in range(3)) + t[k] for k, row in enumerate(matrix(q))]


def near(found, expected, limit):
    return all(abs(a - b) <= limit for a, b in zip(found, expected))


def check_views():
    views = {}
    with open(made, "rb") as file:
        for _, channel, message, decoded in mcap.reader.make_reader(file, decoder_factories=[DecoderFactory(), JsonFactory()]) \
                .iter_decoded_messages(topics=[f"/FOVEA/{name}" for name in NAMES]):
            views.setdefault(channel.topic, []).append((message.log_time, decoded))
    ours = {}
    for channel, _, message in read_recording.messages(recording):
        ours.setdefault(channel, []).append(message)
    for name in NAMES:
        expect(f"/FOVEA/{name}" in views, f"found no {name}")
    frames, images = ours["FOVEA_FRAME"], views["/FOVEA/cam0/image"]
    expect(len(frames) == len(images), "frames are missing")
    for frame, (_, image) in zip(frames, images):
        expect(ns(image.timestamp) == frame["stamp"]["time_ns"], "stamp of an image")
        expect((image.encoding, image.width, image.height) == ("mono8", 320, 240), "kind of an image")
        expect(image.data == frame["images"][0]["data"], "pixels of an image")
    expect(views["/FOVEA/cam0/preview"][0][1].data[:2] == b"\xff\xd8", "no JPEG")
    posed = [pose for pose in ours["FOVEA_POSE"] if pose["map_id"] >= 0]
    expect(len(posed) == len(views["/FOVEA/pose"]) > 20, "poses are missing")
    for pose, (_, found) in zip(posed, views["/FOVEA/pose"]):
        check_pose(pose, found)
    check_corrected(posed[0])
    children = {t.child_frame_id for _, message in views["/FOVEA/transforms"] for t in message.transforms}
    expect(children == {"body", "cam0"} or children == {"cam0"}, f"transforms to {children}")
    features = views["/FOVEA/cam0/features"][5][1].points[0].points
    expect(len(features) == ours["FOVEA_FEATURES"][5]["count"] > 100, "features")
    expect(near((features[0].x, features[0].y), [v + 0.5 for v in ours["FOVEA_FEATURES"][5]["p_px"][0]], 1e-9), "half a pixel")
    check_boxes(ours["FOVEA_DETECTIONS"], [view for _, view in views["/FOVEA/cam0/detections"]])
    cloud = views["/FOVEA/map"][-1][1]
    expect(cloud.point_stride == 12 and len(cloud.data) >= 12 * 50 and len(cloud.data) % 12 == 0, "map")
    expect(any(log.message == "pose: tracking" for _, log in views["/FOVEA/log"]), "log")
    expect(views["/FOVEA/statistics"][-1][1]["frames_in"] == ours["FOVEA_STATISTICS"][-1]["frames_in"], "statistics")


def check_pose(pose, found):
    p, q = found.pose.position, found.pose.orientation
    to_map = pose["map_scale"], pose["map_orientation"], pose["map_position"]
    expect(near((p.x, p.y, p.z), apply(*to_map, pose["position"]), 1e-9), "position")
    for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
        turned = apply(1, pose["map_orientation"], (0, 0, 0), apply(1, pose["orientation"], (0, 0, 0), axis))
        expect(near(apply(1, (q.w, q.x, q.y, q.z), (0, 0, 0), axis), turned, 1e-9), "orientation")
    expect(ns(found.timestamp) == pose["stamp"]["time_ns"] + pose["stamp"]["utc_offset_ns"], "stamp of a pose")


def check_corrected(pose):
    """A pose in a map that a closure has moved, with time in UTC, as this recording has none."""
    sys.path.append(os.path.join(tools, "foxglove"))
    import views
    stamp = {"time_ns": 1234567890123456789, "utc_offset_ns": 77}
    moved = dict(pose, stamp=stamp, map_scale=2.5, map_position=(1, -2, 3), map_orientation=(0.5, 0.5, -0.5, 0.5), position=(4, 5, 6),
                 orientation=(0.8, 0, 0.6, 0))
    types = type("Types", (), {"prefix": "X_"})
    check_pose(moved, dict(views.Views(types).pose("POSE", moved))["pose"])


def check_boxes(ours, views):
    count = 0
    expect(len(ours) == len(views), "detections are missing")
    for message, view in zip(ours, views):
        expect(len(message["detections"]) == len(view.points) == len(view.texts), "boxes are missing")
        for item, drawn in zip(message["detections"], view.points):
            count += 1
            box = item["box"]
            expect(near((drawn.points[0].x, drawn.points[0].y), (box["x_min_px"] + 0.5, box["y_min_px"] + 0.5), 1e-4), "corner")
            expect(near((drawn.points[2].x, drawn.points[2].y), (box["x_max_px"] + 0.5, box["y_max_px"] + 0.5), 1e-4), "corner")
    expect(count > 0, "no box in any message")


class JsonFactory:
    def decoder_for(self, encoding, schema):
        return json.loads if encoding == "json" else None


NAMES = ("cam0/image", "cam0/preview", "cam0/features", "cam0/detections", "cam0/objects", "pose", "camera_pose", "transforms", "map", "log",
         "statistics", "camera_status")


def check_refused(arguments, words):
    with open(kept, "w", encoding="ascii") as file:
        file.write("kept")
    done = run_copy(tool, *arguments, kept)
    line = done.stderr.strip()
    expect(done.returncode != 0 and "\n" not in line and all(word in line for word in words), f"{arguments}: exit {done.returncode}: {done.stderr}")
    expect(open(kept, encoding="ascii").read() == "kept", f"{arguments}: the file that was there is lost")
    expect(sorted(os.listdir(folder)) == sorted(os.path.basename(f) for f in present), f"{arguments}: left {os.listdir(folder)}")


done = run(recording, made)
expect(done.returncode == 0, done.stderr)
check_every_message()
check_views()
done = run(made, again)
expect(done.returncode == 0, done.stderr)
expect(open(again, "rb").read() == open(recording, "rb").read(), "the recording made again differs")

for at in range(1000, os.path.getsize(made) - 1000, os.path.getsize(made) // 15):  # a wrong byte is seen, or makes no difference
    with open(made, "rb") as file:
        damaged = bytearray(file.read())
    damaged[at] ^= 0x55
    with open(again, "wb") as file:
        file.write(damaged)
    back = os.path.join(folder, "back")
    done = run_copy(tool, again, back)
    expect(done.returncode == 0 or len(done.stderr.strip().splitlines()) == 1, f"byte {at}: {done.stderr}")
    expect(done.returncode != 0 or open(back, "rb").read() == open(recording, "rb").read(), f"byte {at}: a wrong recording")
    if os.path.exists(back):
        os.unlink(back)

text, cut, cut_log, views_only = (os.path.join(folder, name) for name in ("text", "cut.mcap", "cut.lcm", "views.mcap"))
open(text, "w", encoding="ascii").write("no recording")
open(cut, "wb").write(open(made, "rb").read()[:-1000])
open(cut_log, "wb").write(open(recording, "rb").read()[:-10])
expect(run_copy(tool, "--views-only", recording, views_only).returncode == 0, "--views-only")
present = [made, again, kept, text, cut, cut_log, views_only]
check_refused([text], ["text", "byte 0", "expected"])
check_refused([cut], ["cut.mcap", "damaged"])
check_refused([cut_log], ["cut.lcm", "cut off"])
check_refused([views_only], ["views.mcap", "expected a recording"])
check_refused([os.path.join(folder, "none")], ["none", "No such file"])
same = run_copy(tool, made, made)
expect(same.returncode != 0 and "expected another file" in same.stderr, "the input was to be replaced")
