"""Read a recording with nothing but the published layouts, and hold its bot_core poses against Fovea's own.

Usage: bot_core_pose.py RECORDING. Prints how many messages agree; fails on the first that does not. The fingerprint of
bot_core's pose_t is computed here from its fields (libbot2), by the rule of LCM's type specification; no generated code is used.
"""
import math
import struct
import sys

FIELDS = [("utime", "int64_t", 0), ("pos", "double", 3), ("vel", "double", 3), ("orientation", "double", 4),
          ("rotation_rate", "double", 3), ("accel", "double", 3)]
MASK = (1 << 64) - 1


def signed(value):
    return value - (1 << 64) if value >> 63 else value


def fingerprint(fields):
    """Names, primitive types and dimensions, byte by byte; then one rotation to the left."""
    value = 0x12345678

    def update(byte):
        nonlocal value
        value = (((value << 8) & MASK) ^ ((signed(value) >> 55) & MASK)) + byte & MASK

    def update_text(text):
        update(len(text))
        for letter in text.encode():
            update(letter)

    for name, kind, dimension in fields:
        update_text(name)
        update_text(kind)
        update(1 if dimension else 0)  # number of dimensions
        if dimension:
            update(0)  # a constant one
            update_text(str(dimension))
    return (value << 1 | value >> 63) & MASK


def events(path):
    data = open(path, "rb").read()
    at = 0
    while at < len(data):
        sync, _, _, channel_bytes, data_bytes = struct.unpack_from(">IQQII", data, at)
        assert sync == 0xEDA1DA01, f"byte {at}: no event"
        at += 28
        channel = data[at:at + channel_bytes].decode()
        at += channel_bytes
        yield channel, data[at:at + data_bytes]
        at += data_bytes


def bot_core_pose(data):
    assert len(data) == 8 + 8 + 16 * 8, f"{len(data)} bytes"
    found, = struct.unpack_from(">Q", data)
    assert found == fingerprint(FIELDS), f"fingerprint {found:016x}, expected {fingerprint(FIELDS):016x}"
    utime, *rest = struct.unpack_from(">q16d", data, 8)
    return utime, rest[0:3], rest[3:6], rest[6:10], rest[10:13], rest[13:16]


def fovea_pose(data):
    """time_ns, state, position and orientation of a fovea.pose_t, by its .lcm file."""
    time_ns, _, _, utc_ns, _ = struct.unpack_from(">qbbqq", data, 8)
    at = 8 + 26
    state, _, _, _ = struct.unpack_from(">bbii", data, at)  # state, uncalibrated, reset_counter, map_id
    at += 10
    for _ in range(2):  # the names of the frames
        at += 4 + struct.unpack_from(">i", data, at)[0]
    values = struct.unpack_from(">7d", data, at)
    return time_ns + utc_ns, state, values[0:3], values[3:7]


def main():
    expected = agreed = moving = 0
    last = before = None
    for channel, data in events(sys.argv[1]):
        if channel.endswith("_POSE") and not channel.endswith("_CAMERA_POSE") and not channel.endswith("_CORE_POSE"):
            last = fovea_pose(data)
            expected += not math.isnan(last[2][0])
        if not channel.endswith("_BOT_CORE_POSE"):
            continue
        utime, pos, vel, orientation, rate, accel = bot_core_pose(data)
        assert utime == last[0] // 1000, f"utime {utime}, expected {last[0] // 1000}"
        assert list(pos) == list(last[2]) and list(orientation) == list(last[3]), f"{pos} {orientation}, expected {last}"
        assert list(accel) == [0, 0, 0] and all(map(math.isfinite, rate))
        if before is not None and utime - before[0] < 100000:
            step_s = (utime - before[0]) * 1e-6
            for k in range(3):
                assert abs(vel[k] * step_s - (pos[k] - before[1][k])) < 1e-6 or vel == [0, 0, 0], f"velocity {vel}"
            moving += any(vel)
        before = (utime, pos)
        agreed += 1
    print(f"{agreed} bot_core poses agree with {expected} posed frames, {moving} with a velocity")
    sys.exit(0 if agreed == expected and moving > 10 else 1)


main()
