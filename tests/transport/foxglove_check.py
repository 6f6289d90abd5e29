"""Foxglove's protocol of fovea-web, by a client on PyPI websockets, held against PyPI's foxglove-sdk and against tools/foxglove/views.py.

Usage: foxglove_check.py make RECORDING OUT   the recording, with messages of kinds that a simulated run does not send
       foxglove_check.py views OUT            what `fovea-web --play OUT` sends is what views.py makes of it
       foxglove_check.py heard                `fovea-web --lcm` sends previews, poses and the map
       foxglove_check.py live                 of a run: parameters with its answers, and every answer as foxglove-sdk's server gives it
"""
import asyncio
import base64
import json
import math
import os
import struct
import sys

import foxglove
import foxglove.websocket
import websockets
from foxglove.channels import LogChannel
from foxglove_schemas_protobuf import (CompressedImage_pb2, FrameTransforms_pb2, Grid_pb2, ImageAnnotations_pb2, Log_pb2, PointCloud_pb2,
                                       PoseInFrame_pb2)
from google.protobuf import descriptor_pb2

here = os.path.dirname(os.path.abspath(__file__))
tools = os.path.join(here, "..", "..", "tools")
sys.path += [os.path.join(tools, "subscribers"), os.path.join(tools, "foxglove")]
import read_recording  # noqa: E402
import views  # noqa: E402

ADDRESS = "ws://127.0.0.1:7680/"
PATIENCE_S = 120  # other programs may use the processor
CONNECTION = {"max_size": 1 << 21, "open_timeout": PATIENCE_S, "ping_timeout": None, "close_timeout": 0.2}
PUBLISHED = {kind.DESCRIPTOR.full_name: kind for kind in (
    CompressedImage_pb2.CompressedImage, ImageAnnotations_pb2.ImageAnnotations, PoseInFrame_pb2.PoseInFrame,
    FrameTransforms_pb2.FrameTransforms, PointCloud_pb2.PointCloud, Grid_pb2.Grid, Log_pb2.Log)}


def expect(holds, what):
    if not holds:
        sys.exit(f"foxglove_check: {what}")


# ---- a recording with what a simulated run does not send ---------------------------------------------------------------------------


class Encoder:
    """A message as LCM encodes it, by the definitions of a recording; what is not given is 0."""

    def __init__(self, types):
        self.types = types

    def encode(self, name, values):
        return struct.pack(">Q", self.types[name][0]) + self.struct(name, values)

    def struct(self, name, values):
        data = b""
        for kind, field, dimensions in self.types[name][1]:
            counts = [int(d) if d.isdigit() else values[d] for d in dimensions]
            data += self.array(kind, counts, values.get(field))
        return data

    def array(self, kind, counts, value):
        if counts:
            return b"".join(self.array(kind, counts[1:], value[i] if value is not None else None) for i in range(counts[0]))
        if kind == "string":
            text = (value or "").encode() + b"\0"
            return struct.pack(">i", len(text)) + text
        if kind in read_recording.NUMBERS:
            return struct.pack(">" + read_recording.NUMBERS[kind], value or 0)
        return self.struct(kind, value or {})


def further(pose):
    """Messages beside a pose: a grid of two pieces, turned boxes, keypoints."""
    turned = (math.cos(0.3), 0, 0, math.sin(0.3))
    grid = {"stamp": pose["stamp"], "map_id": pose["map_id"], "frame": "odom", "resolution_m": 0.125, "width": 7, "height": 5,
            "origin_position": (-3, 1.5, 0.25), "origin_orientation": turned}
    for first, count in ((0, 3), (3, 2)):
        cells = [-1 if (first * 7 + i) % 3 == 0 else (first * 7 + i) * 2 for i in range(7 * count)]
        yield "GRID", "fovea.grid_t", dict(grid, first_row=first, row_count=count, cell_count=7 * count, cells=cells)
    box = {"x_min_px": 10.25, "y_min_px": 20.5, "x_max_px": 55.125, "y_max_px": 81.75}
    found = [{"class_id": 3, "class_name": "", "score": 0.125, "box": box, "angle": 0.4},
             {"class_id": 8, "class_name": "pallet", "score": 0.5, "box": box}]
    yield "DETECTIONS2", "fovea.detections_t", {"stamp": pose["stamp"], "camera": 1, "count": 2, "detections": found}
    sets = [{"class_id": 0, "point_count": 3, "p_px": ((1.5, 2.5), (3, 4), (5, 6.25)), "point_score": (1, 1, 1)}, {"class_id": 1, "point_count": 0}]
    yield "KEYPOINTS", "fovea.keypoints_t", {"stamp": pose["stamp"], "camera": 0, "count": 2, "sets": sets}
    objects = [{"id": 7, "class_id": 3, "class_name": "person", "box": box}, {"id": 12, "class_id": 9, "box": box}]
    yield "OBJECTS", "fovea.objects_t", {"stamp": pose["stamp"], "camera": 0, "count": 2, "objects": objects}


def make(recording, out):
    types, number = None, 0
    with open(out, "wb") as file:
        def put(utime, channel, data):
            nonlocal number
            name = channel.encode()
            file.write(struct.pack(">IQQII", 0xEDA1DA01, number, utime, len(name), len(data)) + name + data)
            number += 1
        for _, utime, channel, data in read_recording.events(recording):
            if types is None:
                types = read_recording.Types(recording, data)
                encoder = Encoder(types.types)
            put(utime, channel, data)
            if channel != types.prefix + "POSE":
                continue
            pose = types.read(0, channel, "fovea.pose_t", data)
            if pose["map_id"] >= 0 and math.isfinite(pose["map_scale"]):
                for suffix, name, message in further(pose):
                    put(utime, types.prefix + suffix, encoder.encode(name, message))


# ---- a client ----------------------------------------------------------------------------------------------------------------------


class Client:
    """Subscribes to every channel that is advertised."""

    def __init__(self, socket):
        self.socket = socket
        self.channels, self.info, self.texts, self.data, self.times = {}, None, [], [], []

    async def take(self, seconds):
        """One message, if one comes in time."""
        try:
            message = await asyncio.wait_for(self.socket.recv(), seconds)
        except asyncio.TimeoutError:
            return None
        if isinstance(message, str):
            await self.take_text(json.loads(message))
        elif message[0] == 1:
            subscription, time_ns = struct.unpack_from("<IQ", message, 1)
            self.data.append((self.channels[subscription - 1000]["topic"], time_ns, message[13:]))
        else:
            expect(message[0] == 2 and len(message) == 9, f"bytes of kind {message[0]}")
            self.times.append(struct.unpack_from("<Q", message, 1)[0])
        return message

    async def take_text(self, said):
        if said["op"] == "serverInfo":
            expect(self.info is None and not self.channels, "serverInfo comes first and once")
            self.info = said
        elif said["op"] == "advertise":
            for channel in said["channels"]:
                expect(channel["id"] not in self.channels, "an id is used again")
                self.channels[channel["id"]] = channel
                await self.say(op="subscribe", subscriptions=[{"id": 1000 + channel["id"], "channelId": channel["id"]}])
        else:
            self.texts.append(said)

    async def say(self, **what):
        await self.socket.send(json.dumps(what))

    async def wait(self, holds, what):
        loop = asyncio.get_running_loop()
        end = loop.time() + PATIENCE_S
        while not holds():
            expect(loop.time() < end, f"{what}: not in {PATIENCE_S} s; texts {str(self.texts)[:600]}")
            await self.take(0.2)


def opened(protocol="foxglove.sdk.v1", **more):
    return websockets.connect(ADDRESS, subprotocols=[protocol], **CONNECTION, **more)


# ---- views -------------------------------------------------------------------------------------------------------------------------


def described(messages):
    """Fields and values of message types, by full name."""
    found = {}

    def add(prefix, message):
        name = f"{prefix}.{message.name}"
        found[name] = sorted((f.number, f.name, f.type, f.label, f.type_name) for f in message.field)
        for inner in message.enum_type:
            found[f"{name}.{inner.name}"] = sorted((v.number, v.name) for v in inner.value)
    for package, message in messages:
        add("." + package, message)
    return found


def check_schema(channel):
    """What describes a channel's messages says what the published schema says."""
    expect(channel["encoding"] == channel["schemaEncoding"] == "protobuf", f"{channel['topic']}: encoding")
    sent = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"], validate=True))
    ours = described((file.package, message) for file in sent.file for message in file.message_type)
    published, left = {}, [PUBLISHED[channel["schemaName"]].DESCRIPTOR.file]
    while left:
        file = left.pop()
        left += file.dependencies
        copy = descriptor_pb2.FileDescriptorProto()
        file.CopyToProto(copy)
        published.update(described((copy.package, message) for message in copy.message_type))
    expect("." + channel["schemaName"] in ours, f"{channel['schemaName']}: not described")
    expect(ours == published, f"{channel['schemaName']}: found {ours}, expected {published}")


def made_by_views(recording):
    """Messages of each topic by stamp."""
    types, made, all_of = None, None, {}
    for number, _, channel, data in read_recording.events(recording):
        if types is None:
            types = read_recording.Types(recording, data)
            made = views.Views(types)
        name = types.name(data)
        if name is None or not channel.startswith(types.prefix) or not made.wants(name):
            continue
        message = types.read(number, channel, name, data)
        for topic, schema, _, payload in made.take(channel, name, message):
            all_of.setdefault(topic, (schema, {}))[1].setdefault(views.time_of(message["stamp"]), []).append(payload)
    return all_of


def near(one, other):
    """The same JSON, but for the last digits of numbers of single precision."""
    if isinstance(one, dict):
        return isinstance(other, dict) and one.keys() == other.keys() and all(near(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return isinstance(other, list) and len(one) == len(other) and all(near(a, b) for a, b in zip(one, other))
    if isinstance(one, float) or isinstance(other, float):
        return one is not None and other is not None and math.isclose(one, other, rel_tol=1e-6)
    return one == other


def check_image(topic, time_ns, payload, expected):
    """Live pictures are JPEGs of what the recording holds raw."""
    image = CompressedImage_pb2.CompressedImage.FromString(payload)
    expect(image.format == "jpeg" and image.frame_id == "cam0" and image.data[:2] == b"\xff\xd8", f"{topic}: kind")
    expect(image.timestamp.seconds * 10**9 + image.timestamp.nanos == time_ns and time_ns in expected, f"{topic}: stamp {time_ns}")
    at = image.data.index(b"\xff\xc0")  # baseline frame
    expect(struct.unpack_from(">HH", image.data, at + 5) == (240, 320), f"{topic}: size")


async def stands_at_start(page):
    """Until the page hears that the recording is paused at its start, which the server says after it has gone there."""
    while True:
        message = await asyncio.wait_for(page.recv(), PATIENCE_S)
        said = json.loads(message) if isinstance(message, str) else {}
        if said.get("kind") == "playback" and said["paused"] and said["position_ms"] == 0:
            return


def is_enough(client, expected):
    found = {}
    for topic, time_ns, _ in client.data:
        found.setdefault(topic, set()).add(time_ns)
    enough = {topic: max(min(len(stamps) // 4, 12), 1) for topic, (_, stamps) in expected.items()}
    return len(client.times) > 10 and all(len(found.get(topic, ())) >= count for topic, count in enough.items())


async def check_views(recording):
    expected = made_by_views(recording)
    async with websockets.connect(ADDRESS, subprotocols=["fovea"], origin="http://127.0.0.1:7680", **CONNECTION) as page:
        # Paused at its start until the client has subscribed. A seek is done at the server's next tick: who subscribes before that gets what
        # is shown where the recording stood. Where that is not the start, log and map begin there, and views.py makes neither.
        await page.send("play 1 pause")
        await page.send("play 2 seek 0")
        await stands_at_start(page)
        async with opened() as socket:
            client = Client(socket)
            first = {topic for topic in expected if topic.endswith(("/cam0/image", "/log"))}
            await client.wait(lambda: first <= {topic for topic, _, _ in client.data}, f"of the start, {sorted(first)}")
            await page.send("play 3 resume")
            await page.close()
            await client.wait(lambda: is_enough(client, expected), f"messages of {sorted(expected)}")
    expect(client.info["capabilities"] == ["time"] and client.info["name"].startswith("fovea "), f"serverInfo {client.info}")
    topics = {channel["topic"] for channel in client.channels.values()}
    expect(topics == set(expected), f"found topics {sorted(topics)}, expected {sorted(expected)}")
    for channel in client.channels.values():
        name, encoding, _ = expected[channel["topic"]][0]
        if not channel["topic"].endswith("/image"):
            expect((channel["schemaName"], channel["schemaEncoding"]) == (name, encoding), f"schema of {channel['topic']}")
        if encoding == "protobuf":
            check_schema(channel)
        else:
            expect(json.loads(channel["schema"])["type"] == "object" and channel["encoding"] == "json", "schema of JSON")
    for topic, time_ns, payload in client.data:
        (_, encoding, _), stamps = expected[topic]
        if topic.endswith("/image"):
            check_image(topic, time_ns, payload, stamps)
        elif encoding == "protobuf":
            expect(payload in stamps[time_ns], f"{topic} at {time_ns}: found {payload.hex()}, expected {[p.hex() for p in stamps[time_ns]]}")
        else:
            expect(any(near(json.loads(payload), json.loads(p)) for p in stamps[time_ns]), f"{topic} at {time_ns}: {payload}")
    expect(client.times == sorted(client.times), f"time goes back: {client.times}")
    print(f"{len(client.data)} messages on {len(topics)} topics as views.py makes them")


async def check_heard():
    async with opened() as socket:
        client = Client(socket)
        wanted = {f"/FOVEA/{name}" for name in ("cam0/image", "cam0/preview", "pose", "camera_pose", "transforms", "map", "log")}
        await client.wait(lambda: wanted <= {topic for topic, _, _ in client.data}, f"messages on {sorted(wanted)}")
        expect(client.info["capabilities"] == ["time"], f"serverInfo {client.info}")
        await client.say(op="setParameters", parameters=[{"name": "features.threshold", "value": 30}])
        await client.wait(lambda: client.texts, "a refusal")
        expect(client.texts[0]["level"] == 2 and client.texts[0]["message"].startswith("features.threshold: "), f"{client.texts}")


# ---- answers -----------------------------------------------------------------------------------------------------------------------

VALUES = {"features.threshold": 20, "odometry.enabled": True}


class Listener(foxglove.websocket.ServerListener):
    """Parameters of foxglove-sdk's server."""

    def __init__(self):
        self.values = dict(VALUES)

    def on_get_parameters(self, client, names, request_id=None):
        return [foxglove.websocket.Parameter(name, value=self.values[name]) for name in names or self.values if name in self.values]

    def on_set_parameters(self, client, parameters, request_id=None):
        for one in parameters:
            self.values[one.name] = one.get_value()
        return parameters


# Channel 0 stands for that of the log.
QUESTIONS = [
    {"op": "getParameters", "parameterNames": ["features.threshold"], "id": "one"},
    {"op": "getParameters", "parameterNames": ["features.threshold", "odometry.enabled"]},
    {"op": "setParameters", "parameters": [{"name": "features.threshold", "value": 31}], "id": "two"},
    {"op": "getParameters", "parameterNames": ["features.threshold"], "id": "three"},
    {"op": "setParameters", "parameters": [{"name": "features.threshold", "value": 20}]},
    {"op": "subscribeParameterUpdates", "parameterNames": ["odometry.enabled"]},
    {"op": "subscribeParameterUpdates", "parameterNames": ["odometry.enabled"]},
    {"op": "unsubscribeParameterUpdates", "parameterNames": ["odometry.enabled", "none.such"]},
    {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 0}]},
    {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 0}]},
    {"op": "subscribe", "subscriptions": [{"id": 8, "channelId": 0}]},
    {"op": "subscribe", "subscriptions": [{"id": 9, "channelId": 123456}]},
    {"op": "unsubscribe", "subscriptionIds": [7]},
    {"op": "unsubscribe", "subscriptionIds": [7]},
    {"op": "advertise", "channels": [{"id": 1, "topic": "/t", "encoding": "json", "schemaName": ""}]},
    {"op": "subscribeConnectionGraph"},
    {"op": "fetchAsset", "uri": "package://x", "requestId": 1},
    {"op": "nonsense"}, {"x": 1}, "no JSON", "[1]", b"", b"\x01", b"\x01\x05\x00\x00\x00abc", b"\x02", b"\x09",
]
ANSWERS = [1, 1, 1, 1, 0, 0, 0, 0, 0, 1, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 1]  # to each; one more comes with the next


def shape(text):
    """What of an answer two servers have in common: not the words for people."""
    said = json.loads(text)
    if said["op"] == "status":
        return "status", said["level"], sorted(said)
    if said["op"] == "parameterValues":
        return "parameterValues", said.get("id"), sorted(said), sorted((p["name"], p["value"], p.get("type")) for p in said["parameters"])
    return said["op"], sorted(said)


async def ask(address):
    """The shapes of the first texts of a server, and of its answers to each question."""
    async with websockets.connect(address, subprotocols=["foxglove.sdk.v1"], **CONNECTION) as socket:
        expect(socket.subprotocol == "foxglove.sdk.v1", f"{address}: found {socket.subprotocol}")
        channel, answers, first = None, [], {}

        async def hear(seconds, count=None):
            nonlocal channel
            found, loop = [], asyncio.get_running_loop()
            end = loop.time() + (seconds if not count else PATIENCE_S)
            while loop.time() < end:
                try:
                    message = await asyncio.wait_for(socket.recv(), max(end - loop.time(), 0.001))
                except asyncio.TimeoutError:
                    break
                if isinstance(message, bytes):
                    continue
                said = json.loads(message)
                if said["op"] == "advertise":
                    for one in said["channels"]:
                        if one["topic"].endswith("/log"):
                            channel, first["advertise"] = one["id"], (sorted(said), sorted(one), one["encoding"], one["schemaEncoding"], one["schemaName"])
                elif said["op"] == "serverInfo":
                    first["serverInfo"] = sorted(said), sorted(said["capabilities"]), type(said["sessionId"])
                else:
                    found.append(shape(message))
                    if count == len(found):
                        break
            return found
        while channel is None:
            await hear(0.2)
        for question, count in zip(QUESTIONS, ANSWERS):
            if isinstance(question, dict):
                question = json.dumps(question).replace('"channelId": 0', f'"channelId": {channel}')
            await socket.send(question)
            answers.append((question, await hear(0.05, count)))
        answers.append(("the end", await hear(0.5)))
        return first, answers


async def check_live():
    listener = Listener()
    capability = foxglove.websocket.Capability
    server = foxglove.start_server(name="x", host="127.0.0.1", port=0, server_listener=listener,
                                   capabilities=[capability.Parameters, capability.Time])
    LogChannel("/log")
    expected = await ask(f"ws://127.0.0.1:{server.port}")
    server.stop()
    found = await ask(ADDRESS)
    expect(found[0] == expected[0], f"found {found[0]}, expected {expected[0]}")
    for (question, answer), (_, other) in zip(found[1], expected[1]):
        expect(answer == other, f"{question}: found {answer}, expected as foxglove-sdk's server {other}")
    await check_parameters()
    print(f"{len(QUESTIONS)} answers as foxglove-sdk gives them")


def values(texts):
    return [text for text in texts if text["op"] == "parameterValues"]


def statuses(texts):
    return [text for text in texts if text["op"] == "status"]


async def check_parameters():
    """A value that is set comes back as the run's, to those who watch it too; a wrong one is refused by the run, with key and reason."""
    async with opened() as socket, opened("foxglove.websocket.v1") as other:
        one, two = Client(socket), Client(other)
        await one.wait(lambda: one.info is not None, "serverInfo")
        expect(other.subprotocol == "foxglove.websocket.v1", "the older name of the protocol")
        await two.say(op="subscribeParameterUpdates", parameterNames=["features.threshold"])
        await two.wait(lambda: two.info is not None, "serverInfo")
        await one.say(op="getParameters", parameterNames=[], id="all")
        await one.wait(lambda: values(one.texts), "all parameters")
        found = {p["name"]: p for p in values(one.texts)[0]["parameters"]}
        expect(len(found) > 100 and not statuses(one.texts), f"found {len(found)} parameters and {statuses(one.texts)}")
        expect(found["features.threshold"]["value"] == 20 and found["odometry.enabled"]["value"] is True, "values")
        expect(any(p.get("type") == "float64" and isinstance(p["value"], (int, float)) for p in found.values()), "no real number")
        one.texts.clear()
        await one.say(op="setParameters", parameters=[{"name": "features.threshold", "value": 33}], id="set")
        await one.wait(lambda: values(one.texts), "an answer")
        expect(values(one.texts)[0] == {"op": "parameterValues", "id": "set", "parameters": [{"name": "features.threshold", "value": 33}]},
               f"{one.texts}")
        await two.wait(lambda: values(two.texts), "an update")
        expect(values(two.texts)[-1]["parameters"] == [{"name": "features.threshold", "value": 33}], f"{two.texts}")
        one.texts.clear()
        await one.say(op="setParameters", id="wrong", parameters=[
            {"name": "features.threshold", "value": 100000}, {"name": "odometry.landmarks", "value": 2000}, {"name": "none.such", "value": 1},
            {"name": "seed"}])
        await one.wait(lambda: values(one.texts) and len(statuses(one.texts)) >= 4, "refusals")
        said = {text["message"].split(":")[0]: text for text in statuses(one.texts)}
        expect(set(said) == {"features.threshold", "odometry.landmarks", "none.such", "seed"}, f"{said}")
        expect(all(text["level"] >= 1 and len(text["message"].split(": ", 1)[1]) > 10 for text in said.values()), f"{said}")
        expect({p["name"]: p["value"] for p in values(one.texts)[0]["parameters"]}["features.threshold"] == 33, "the value in force")


kind = sys.argv[1]
if kind == "make":
    make(*sys.argv[2:])
elif kind == "views":
    asyncio.run(check_views(sys.argv[2]))
elif kind == "heard":
    asyncio.run(check_heard())
else:
    asyncio.run(check_live())
