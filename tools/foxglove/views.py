"""What Foxglove and Lichtblick can show of Fovea's messages, in Foxglove's schemas as protobuf.

Topics, after `/` and the channel prefix (here FOVEA):

    /FOVEA/camN/image            RawImage, or CompressedImage where the camera gives MJPEG; from `frame_t`
    /FOVEA/camN/preview          CompressedImage; from `preview_t`
    /FOVEA/camN/features         ImageAnnotations on camN/image; from `features_t`
    /FOVEA/camN/detections       likewise, boxes with class and score; from `detections_t`
    /FOVEA/camN/objects          likewise, boxes with ids; from `objects_t`
    /FOVEA/camN/keypoints        likewise; from `keypoints_t`
    /FOVEA/pose, camera_pose     PoseInFrame in `map`; from `pose_t`
    /FOVEA/transforms            FrameTransforms from `map` to `body` and `cam0`
    /FOVEA/map                   PointCloud of the landmarks in `map` that have been heard of so far; from `map_t`
    /FOVEA/grid                  Grid in `map`, field `occupancy`: 0 (free) to 100 (occupied) percent, -1 unknown; from `grid_t` and the last `pose_t`
    /FOVEA/log                   Log: changes of the states of pose and camera
    /FOVEA/statistics, camera_status   JSON, for plots

`fovea-web` serves the same ones live (src/web/foxglove_views.h), but for pictures, which it sends as CompressedImage.

`map` and the unit of length are those of pose_t. Poses of another map are in its frame: Foxglove has no notion of several maps.
Annotations are in pixels whose origin is the corner of the image, half a pixel from Fovea's, which is the centre of the first pixel.
"""
import json
import math
import struct

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap_protobuf.schema import build_file_descriptor_set

# pixel_format of image_t: encoding of RawImage. Planar formats show their first plane, the brightness.
ENCODINGS = {0: "mono8", 1: "mono16", 2: "mono16", 3: "mono16", 4: "yuyv", 5: "uyvy", 6: "mono8", 7: "mono8", 8: "rgb8", 9: "bgr8",
             10: "bayer_rggb8", 11: "bayer_bggr8", 12: "bayer_grbg8", 13: "bayer_gbrg8", 15: "mono16"}
MJPEG = 14
POSE_STATES = ("starting", "tracking", "weak", "lost", "paused", "coasting")
CAMERA_STATES = ("ok", "late", "stalled", "gone", "returning", "ended")
HALF = 0.5  # from the centre of a pixel to its corner
COLOURS = ((0.90, 0.29, 0.24), (0.18, 0.55, 0.85), (0.20, 0.68, 0.38), (0.95, 0.61, 0.07), (0.61, 0.35, 0.71), (0.10, 0.74, 0.71))


def time_of(stamp):
    """Nanoseconds of UTC where they are known, else on the stamp's clock."""
    return max(stamp["time_ns"] + stamp["utc_offset_ns"], 0)


def set_time(field, time_ns):
    field.seconds, field.nanos = divmod(time_ns, 1000000000)


def rotate(q, v):
    """The vector v, rotated by the unit quaternion w x y z."""
    w, x, y, z = q
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    return (v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz, v[2] + w * tz + x * ty - y * tx)


def multiply(p, q):
    return (p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3], p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1], p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0])


def similar(scale, position, orientation, point):
    """scale R(orientation) point + position."""
    return tuple(scale * r + t for r, t in zip(rotate(orientation, point), position))


def set_vector(field, v):
    field.x, field.y, field.z = v


def set_quaternion(field, q):
    field.w, field.x, field.y, field.z = q


def is_finite(values):
    return all(math.isfinite(value) for value in values)


def add_points(to, kind, points, time_ns, colour):
    annotation = to.points.add(type=kind, thickness=2)
    set_time(annotation.timestamp, time_ns)
    for x, y in points:
        annotation.points.add(x=x + HALF, y=y + HALF)
    annotation.outline_color.r, annotation.outline_color.g, annotation.outline_color.b = colour
    annotation.outline_color.a = 1


def add_text(to, x, y, text, time_ns, colour):
    label = to.texts.add(text=text, font_size=14)
    set_time(label.timestamp, time_ns)
    label.position.x, label.position.y = x + HALF, y + HALF
    label.text_color.r, label.text_color.g, label.text_color.b, label.text_color.a = 1, 1, 1, 1
    label.background_color.r, label.background_color.g, label.background_color.b = colour
    label.background_color.a = 0.8


def corners(box, angle=0.0):
    """Of a box that is turned by an angle about its centre; its limits are exclusive, so half a pixel beyond the last centre."""
    x, y = (box["x_min_px"] + box["x_max_px"]) / 2, (box["y_min_px"] + box["y_max_px"]) / 2
    w, h = (box["x_max_px"] - box["x_min_px"]) / 2, (box["y_max_px"] - box["y_min_px"]) / 2
    c, s = math.cos(angle), math.sin(angle)
    return [(x + c * dx - s * dy, y + s * dx + c * dy) for dx, dy in ((-w, -h), (w, -h), (w, h), (-w, h))]


def add_box(to, item, text, time_ns, colour):
    found = corners(item["box"], item.get("angle", 0.0))
    add_points(to, PointsAnnotation.LINE_LOOP, found, time_ns, colour)
    add_text(to, *found[0], text, time_ns, colour)


class Views:
    """Makes Foxglove's messages from ours, in the order of the recording."""

    def __init__(self, types):
        self.prefix = types.prefix
        self.base = "/" + types.prefix.rstrip("_") + ("/" if types.prefix else "")
        self.schemas = {}
        self.states = {}
        self.slots = {}  # landmarks by slot: map, x, y, z
        self.to_map = None  # map_id, scale, position and orientation of `odom` in `map`, by the last pose
        self.rows = None  # of the grid that is coming: what its messages must share, and its cells
        self.makers = {"fovea.frame_t": self.frame, "fovea.preview_t": self.preview, "fovea.features_t": self.features,
                       "fovea.detections_t": self.detections, "fovea.objects_t": self.objects, "fovea.keypoints_t": self.keypoints,
                       "fovea.pose_t": self.pose, "fovea.map_t": self.map, "fovea.grid_t": self.grid, "fovea.statistics_t": self.statistics,
                       "fovea.camera_status_t": self.camera_status}

    def wants(self, name):
        return name in self.makers

    def take(self, channel, name, message):
        """Topic, schema, encoding and data of each message that Foxglove can show of this one."""
        for topic, made in self.makers[name](channel[len(self.prefix):], message):
            if isinstance(made, dict):
                text = json.dumps(made, allow_nan=False).encode()
                yield self.base + topic, (name, "jsonschema", b'{"type": "object"}'), "json", text
                continue
            kind = type(made)
            if kind not in self.schemas:
                descriptors = build_file_descriptor_set(kind).SerializeToString()
                self.schemas[kind] = (kind.DESCRIPTOR.full_name, "protobuf", descriptors)
            yield self.base + topic, self.schemas[kind], "protobuf", made.SerializeToString()

    def frame(self, _, message):
        for camera, image in enumerate(message["images"]):
            if image["size_bytes"] == 0 or image["pixel_format"] not in (*ENCODINGS, MJPEG):
                continue
            if image["pixel_format"] == MJPEG:
                made = CompressedImage(frame_id=f"cam{camera}", format="jpeg", data=image["data"])
            else:
                rows = image["data"][:image["height"] * image["stride_bytes"]]
                made = RawImage(frame_id=f"cam{camera}", width=image["width"], height=image["height"], step=image["stride_bytes"],
                                encoding=ENCODINGS[image["pixel_format"]], data=rows)
            set_time(made.timestamp, time_of(message["stamp"]) + image["offset_ns"])
            yield f"cam{camera}/image", made

    def preview(self, _, message):
        made = CompressedImage(frame_id=f"cam{message['camera']}", format="jpeg", data=message["jpeg"])
        set_time(made.timestamp, time_of(message["stamp"]))
        yield f"cam{message['camera']}/preview", made

    def features(self, _, message):
        made = ImageAnnotations()
        add_points(made, PointsAnnotation.POINTS, message["p_px"], time_of(message["stamp"]), COLOURS[2])
        yield f"cam{message['camera']}/features", made

    def detections(self, suffix, message):
        made = ImageAnnotations()
        for item in message["detections"]:
            text = f"{item['class_name'] or item['class_id']} {item['score']:.2f}"
            add_box(made, item, text, time_of(message["stamp"]), COLOURS[item["class_id"] % len(COLOURS)])
        yield f"cam{message['camera']}/{suffix.lower()}", made

    def objects(self, _, message):
        made = ImageAnnotations()
        for item in message["objects"]:
            text = f"{item['class_name'] or item['class_id']} {item['id']}"
            add_box(made, item, text, time_of(message["stamp"]), COLOURS[item["id"] % len(COLOURS)])
        yield f"cam{message['camera']}/objects", made

    def keypoints(self, suffix, message):
        made = ImageAnnotations()
        for number, item in enumerate(message["sets"]):
            add_points(made, PointsAnnotation.POINTS, item["p_px"], time_of(message["stamp"]), COLOURS[number % len(COLOURS)])
        yield f"cam{message['camera']}/{suffix.lower()}", made

    def changed(self, who, stamp, names, state, bad):
        """A line of the log when a state changes."""
        if self.states.get(who) == state:
            return
        self.states[who] = state
        name = names[state] if 0 <= state < len(names) else str(state)
        made = Log(level=Log.WARNING if name in bad else Log.INFO, name=who, message=f"{who}: {name}")
        set_time(made.timestamp, time_of(stamp))
        yield "log", made

    def pose(self, suffix, message):
        if suffix == "POSE":
            yield from self.changed("pose", message["stamp"], POSE_STATES, message["state"], ("lost", "weak"))
        known = is_finite(message["position"]) and is_finite(message["map_position"]) and math.isfinite(message["map_scale"])
        if message["map_id"] < 0 or not known:
            return
        to_map = (message["map_scale"], message["map_position"], message["map_orientation"])
        if suffix == "POSE":
            self.to_map = (message["map_id"], *to_map)
        position = similar(*to_map, message["position"])
        orientation = multiply(message["map_orientation"], message["orientation"])
        made = PoseInFrame(frame_id="map")
        set_time(made.timestamp, time_of(message["stamp"]))
        set_vector(made.pose.position, position)
        set_quaternion(made.pose.orientation, orientation)
        yield suffix.lower(), made
        transforms = FrameTransforms()
        transform = transforms.transforms.add(parent_frame_id="map", child_frame_id=message["child_frame"])
        set_time(transform.timestamp, time_of(message["stamp"]))
        set_vector(transform.translation, position)
        set_quaternion(transform.rotation, orientation)
        yield "transforms", transforms

    def map(self, _, message):
        for slot in range(message["landmark_first"], message["landmark_last"]):
            self.slots.pop(slot, None)
        for slot, of, p in zip(message["landmark_slot"], message["landmark_map"], message["landmark_p"]):
            self.slots[slot] = (of, p)
        own = (message["own_scale"], message["own_position"], message["own_orientation"])
        points = [similar(*own, p) for _, (of, p) in sorted(self.slots.items()) if of == message["map_id"]]
        made = PointCloud(frame_id="map", point_stride=12, data=b"".join(struct.pack("<3f", *p) for p in points if is_finite(p)))
        set_time(made.timestamp, time_of(message["stamp"]))
        made.pose.orientation.w = 1
        for at, name in enumerate("xyz"):
            made.fields.add(name=name, offset=4 * at, type=PackedElementField.FLOAT32)
        yield "map", made

    def grid(self, _, message):
        """When the last rows of one are there."""
        shared = message["stamp"]["time_ns"], message["width"], message["height"]
        if message["first_row"] == 0:
            self.rows = shared, []
        if self.rows is None or self.rows[0] != shared or len(self.rows[1]) != message["first_row"] * message["width"]:
            return
        self.rows[1].extend(message["cells"])
        if len(self.rows[1]) != message["width"] * message["height"] or self.to_map is None or self.to_map[0] != message["map_id"]:
            return
        scale, position, orientation = self.to_map[1:]
        made = Grid(frame_id="map", column_count=message["width"], row_stride=message["width"], cell_stride=1,
                    data=struct.pack(f"{len(self.rows[1])}b", *self.rows[1]))
        set_time(made.timestamp, time_of(message["stamp"]))
        set_vector(made.pose.position, similar(scale, position, orientation, message["origin_position"]))
        set_quaternion(made.pose.orientation, multiply(orientation, message["origin_orientation"]))
        made.cell_size.x = made.cell_size.y = scale * message["resolution_m"]
        made.fields.add(name="occupancy", offset=0, type=PackedElementField.INT8)
        yield "grid", made

    def plain(self, value):
        """What JSON can say: unknown numbers as null."""
        if isinstance(value, dict):
            return {key: self.plain(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [self.plain(inner) for inner in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    def statistics(self, _, message):
        yield "statistics", self.plain(message)

    def camera_status(self, _, message):
        who = f"cam{message['camera']}"
        yield from self.changed(who, message["stamp"], CAMERA_STATES, message["state"], ("late", "stalled", "gone"))
        yield "camera_status", self.plain(message)
