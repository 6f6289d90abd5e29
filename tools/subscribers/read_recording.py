#!/usr/bin/env python3
"""Print a recording as JSON, one message per line, with nothing but what the recording says about its types.

Usage: read_recording.py FILE [SUFFIX ...]   only the channels PREFIX_SUFFIX, for example POSE

Every recording begins with a message (fovea.recording_t) whose part `types` holds the definition of every message type. So this
program needs no package, no generated code and no knowledge of the version of Fovea that recorded. Data of images and models is shown
as its size.
"""
import json
import math
import os
import re
import struct
import sys

NUMBERS = {"int8_t": "b", "byte": "B", "boolean": "?", "int16_t": "h", "int32_t": "i", "int64_t": "q", "float": "f",
           "double": "d"}
# The two types that the descriptions are read with; they never change.
RECORDING = """
//! type fovea.recording_part_t 0000000000000000
struct recording_part_t { string name; string origin; int64_t hash; int32_t size_bytes; byte data[size_bytes]; }
//! type fovea.recording_t 0000000000000000
struct recording_t { int32_t format; string version; string machine; string kernel_set; string source; boolean real_time;
  string channel_prefix; int32_t part_count; fovea.recording_part_t parts[part_count]; }
"""


def read_types(text):
    """{"fovea.pose_t": (hash, [(kind, name, [dimensions])])} of the definitions in a text."""
    types = {}
    for name, code, body in re.findall(r"^//! type (\S+) ([0-9a-f]{16})$(.*?)(?=^//! type |\Z)", text, re.M | re.S):
        body = re.sub(r"/\*.*?\*/", "", re.sub(r"//.*", "", body), flags=re.S)  # comments
        members = re.findall(r"([\w.]+)\s+(\w+)((?:\[\w+\])*)\s*;", body.partition("{")[2])
        types[name] = (int(code, 16), [(kind, field, re.findall(r"\w+", dimensions)) for kind, field, dimensions in members])
    return types


class Reader:
    """Takes values from the bytes of one message; LCM's numbers are big-endian."""

    def __init__(self, types, data):
        self.types, self.data, self.at = types, data, 8

    def number(self, code):
        value, = struct.unpack_from(">" + code, self.data, self.at)
        self.at += struct.calcsize(code)
        return value

    def value(self, kind):
        if kind == "string":
            length = self.number("i")
            self.at += length
            return self.data[self.at - length:self.at - 1].decode()
        if kind in NUMBERS:
            return self.number(NUMBERS[kind])
        return self.struct(kind)

    def array(self, kind, counts):
        if not counts:
            return self.value(kind)
        if kind == "byte" and len(counts) == 1:
            self.at += counts[0]
            return self.data[self.at - counts[0]:self.at]
        if kind in NUMBERS and len(counts) == 1:
            code = f">{counts[0]}{NUMBERS[kind]}"
            self.at += struct.calcsize(code)
            return list(struct.unpack_from(code, self.data, self.at - struct.calcsize(code)))
        return [self.array(kind, counts[1:]) for _ in range(counts[0])]

    def struct(self, name):
        found = {}
        for kind, field, dimensions in self.types[name][1]:
            counts = [int(d) if d.isdigit() else found[d] for d in dimensions]
            found[field] = self.array(kind, counts)
        return found


def events(path):
    """Number, microseconds, channel and data of each event of an LCM log."""
    with open(path, "rb") as file:
        while True:
            at = file.tell()
            head = file.read(28)
            if not head:
                return
            if len(head) < 28:
                sys.exit(f"{path}: byte {at}: found {len(head)} bytes, expected an event: the log is cut off here")
            sync, number, utime, channel_bytes, data_bytes = struct.unpack(">IQQII", head)
            if sync != 0xEDA1DA01:
                sys.exit(f"{path}: byte {at}: found no event, expected one")
            channel, data = file.read(channel_bytes), file.read(data_bytes)
            if len(channel) + len(data) < channel_bytes + data_bytes:
                sys.exit(f"{path}: byte {at}: found an event cut off, expected {channel_bytes + data_bytes} bytes after its head")
            yield number, utime, channel.decode(), data


class Types:
    """What the first message of a recording says: its header, channel prefix and the types of all messages."""

    def __init__(self, path, data):
        self.path = path
        try:
            self.header = Reader(read_types(RECORDING), data).struct("fovea.recording_t")
            self.text = next(part["data"] for part in self.header["parts"] if part["name"] == "types").decode()
        except (struct.error, UnicodeDecodeError, StopIteration, MemoryError):
            sys.exit(f"{path}: found no part `types` in the first message, expected a recording of format 4 or later")
        self.prefix = self.header["channel_prefix"] + "_" if self.header["channel_prefix"] else ""
        self.types = read_types(self.text)
        self.by_hash = {code: name for name, (code, _) in self.types.items()}

    def name(self, data):
        """The type of a message; None: it is not described."""
        return self.by_hash.get(struct.unpack_from(">Q", data)[0]) if len(data) >= 8 else None

    def read(self, number, channel, name, data):
        reader = Reader(self.types, data)
        try:
            message = reader.struct(name)
        except (struct.error, UnicodeDecodeError, MemoryError):
            sys.exit(f"{self.path}: event {number}, {channel}: found {len(data)} bytes that are no {name}")
        if reader.at != len(data):
            sys.exit(f"{self.path}: event {number}, {channel}: found {len(data)} bytes, expected {reader.at}")
        return message


def plain(value):
    """What JSON can say: bytes as their number, unknown numbers as null."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    return None if isinstance(value, float) and not math.isfinite(value) else value


def messages(path, suffixes=()):
    """Channel, type and members of each message of a recording, of those on the channels PREFIX_SUFFIX alone where any are given."""
    types = None
    for number, _, channel, data in events(path):
        types = types or Types(path, data)
        if suffixes and channel not in [types.prefix + suffix for suffix in suffixes]:
            continue
        name = types.name(data)
        if name is None:
            sys.exit(f"{path}: event {number}, {channel}: found a type without description, expected one")
        yield channel, name, types.read(number, channel, name, data)
    if types is None:
        sys.exit(f"{path}: found no event, expected a recording")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for channel, name, message in messages(sys.argv[1], sys.argv[2:]):
        print(json.dumps({"channel": channel, "type": name, "message": plain(message)}))
    sys.stdout.flush()


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:  # the reader has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
