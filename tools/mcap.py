#!/usr/bin/env python3
"""Convert a recording of Fovea to MCAP, for Foxglove and Lichtblick, and back.

    $(tools/mcap_python.sh build) tools/mcap.py run.lcm run.mcap
    $(tools/mcap_python.sh build) tools/mcap.py run.mcap again.lcm     # the same bytes as run.lcm

The MCAP file holds every message twice: as it was recorded (message encoding `lcm`, with the definition of its type), from which the
recording can be made again, and, where Foxglove has a schema for what it says, as that (views.py lists the topics). --views-only leaves the
first out: such a file cannot be converted back. Times are those of the recording, to the nanosecond in the messages.
"""
import argparse
import os
import struct
import sys

# This file bears the name of the package that it imports: its own folder is searched last.
here = os.path.dirname(os.path.abspath(__file__))
sys.path = [path for path in sys.path if os.path.abspath(path or ".") != here]
sys.path += [os.path.join(here, "subscribers"), os.path.join(here, "foxglove")]
try:
    import mcap.reader
    import mcap.writer
    import views
except ImportError as problem:
    sys.exit(f"mcap.py: {problem}; expected the Python that `tools/mcap_python.sh build` prints")
import read_recording  # noqa: E402

LCM = "lcm"  # message and schema encoding of what was recorded


class Writer:
    """Channels and schemas of an MCAP file, each made at its first message."""

    def __init__(self, stream):
        self.writer = mcap.writer.Writer(stream)
        self.writer.start(profile="", library="fovea")
        self.channels = {}

    def channel(self, topic, schema, encoding):
        """`schema`: name, encoding and data, or None."""
        if topic not in self.channels:
            schema_id = self.writer.register_schema(*schema) if schema is not None else 0
            self.channels[topic] = self.writer.register_channel(topic=topic, message_encoding=encoding, schema_id=schema_id)
        return self.channels[topic]

    def add(self, topic, schema, encoding, time_ns, sequence, data):
        channel = self.channel(topic, schema, encoding)
        self.writer.add_message(channel, log_time=time_ns, publish_time=time_ns, sequence=sequence, data=data)

    def finish(self):
        self.writer.finish()


def to_mcap(path, stream, with_lcm):
    """The recording `path` as MCAP; returns the numbers of messages: recorded, and of views."""
    out, types, made = Writer(stream), None, None
    counts = [0, 0]
    for number, utime, channel, data in read_recording.events(path):
        if types is None:
            types = read_recording.Types(path, data)
            made = views.Views(types)
        if number != counts[0] or utime < 0:
            sys.exit(f"{path}: event {counts[0]}: found number {number} and time {utime}, expected number {counts[0]} and a time from 0")
        name = types.name(data)
        schema = (name, LCM, types.text.encode()) if name is not None else None
        if with_lcm:
            out.add(channel, schema, LCM, utime * 1000, number & 0xFFFFFFFF, data)
        counts[0] += 1
        if name is None or not channel.startswith(types.prefix) or not made.wants(name):
            continue
        for topic, schema, encoding, payload in made.take(channel, name, types.read(number, channel, name, data)):
            out.add(topic, schema, encoding, utime * 1000, number & 0xFFFFFFFF, payload)
            counts[1] += 1
    if types is None:
        sys.exit(f"{path}: found no event, expected a recording")
    out.finish()
    return counts


def messages(path, file):
    """Channel and message of each one, in the order of the file; checksums are compared."""
    try:
        for _, channel, message in mcap.reader.make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            yield channel, message
    except OSError:
        raise
    except Exception as problem:  # of mcap, its decompressors and decoders, which have no common kind
        sys.exit(f"{path}: found a damaged MCAP file: {' '.join(str(problem).split())[:150]}")


def to_lcm(path, stream):
    """The recording in the MCAP file `path`; returns its number of messages."""
    count = 0
    with open(path, "rb") as file:
        for channel, message in messages(path, file):
            if channel.message_encoding != LCM:
                continue
            if message.sequence != count & 0xFFFFFFFF or message.log_time % 1000 != 0:
                sys.exit(f"{path}: {channel.topic}: found message {message.sequence} at {message.log_time} ns, expected message {count} "
                         "at whole microseconds: this is no recording that mcap.py converted")
            name = channel.topic.encode()
            stream.write(struct.pack(">IQQII", 0xEDA1DA01, count, message.log_time // 1000, len(name), len(message.data)))
            stream.write(name + message.data)
            count += 1
    if count == 0:
        sys.exit(f"{path}: found no message with encoding `lcm`, expected a recording that mcap.py converted without --views-only")
    return count


def convert(options):
    with open(options.input, "rb") as file:
        is_mcap = file.read(8) == b"\x89MCAP0\r\n"
    if os.path.exists(options.output) and os.path.samefile(options.input, options.output):
        sys.exit(f"mcap.py: {options.output}: found the input, expected another file")
    whole = f"{options.output}.{os.getpid()}.part"  # replaces what is there when it is whole
    try:
        with open(whole, "xb") as stream:
            if is_mcap:
                text = f"{to_lcm(options.input, stream)} messages"
            else:
                text = "%d messages recorded, %d for Foxglove" % tuple(to_mcap(options.input, stream, not options.views_only))
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(whole, options.output)
    finally:
        if os.path.exists(whole):
            os.unlink(whole)
    print(f"{options.output}: {text}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("input", help="recording (fovea run --record), or MCAP file made from one")
    parser.add_argument("output", help="MCAP file, or recording")
    parser.add_argument("--views-only", action="store_true", help="leave the messages as recorded out: smaller, and for Foxglove only")
    try:
        convert(parser.parse_args())
    except OSError as problem:
        sys.exit(f"mcap.py: {problem.filename or problem}: {problem.strerror}")


main()
