#!/usr/bin/env python3
"""Send a command to a run of Fovea: reset, pause, resume, save, overwrite (with save: over a larger map, too), record,
record-stop, maps, load:MAP, backup, restore:FILE, or KEY=VALUE.

maps lists the maps in the folder of the run (map.folder); load:MAP loads one of them, by its name there, in place of the map
that the run has.

backup prints all settings of the run as one file; restore:FILE gives such a file back, which is taken or refused as a whole.

KEY=VALUE changes a live parameter (docs/configuration.md), such as features.threshold=30; with --keep it holds after the next
start too, where the run has a file for it (parameters.file). KEY= asks for the value of any key and changes nothing.

Needs the message types (make python-types), and no package: a command is one UDP packet, made here. With --key the
command proves that its sender knows the key of the run (command_key), is meant for this run alone and cannot be
repeated: the run's number is heard on PREFIX_RUN, or given by --run-id. It prints the answer (command_result_t,
parameter_result_t): exit 0 if the command is done, 1 if it was refused or failed, 3 without an answer.
"""
import argparse
import os
import socket
import struct
import sys
import time

here = os.path.dirname(os.path.abspath(__file__))
MASK = (1 << 64) - 1


def siphash(key, data):
    """SipHash-2-4 (J.-P. Aumasson and D. J. Bernstein, 2012)."""
    k0, k1 = struct.unpack("<QQ", key)
    v = [k0 ^ 0x736F6D6570736575, k1 ^ 0x646F72616E646F6D, k0 ^ 0x6C7967656E657261, k1 ^ 0x7465646279746573]

    def rotate(value, bits):
        return (value << bits | value >> (64 - bits)) & MASK

    def rounds(count):
        for _ in range(count):
            v[0] = (v[0] + v[1]) & MASK
            v[2] = (v[2] + v[3]) & MASK
            v[1] = rotate(v[1], 13) ^ v[0]
            v[3] = rotate(v[3], 16) ^ v[2]
            v[0] = rotate(v[0], 32)
            v[2] = (v[2] + v[1]) & MASK
            v[0] = (v[0] + v[3]) & MASK
            v[1] = rotate(v[1], 17) ^ v[2]
            v[3] = rotate(v[3], 21) ^ v[0]
            v[2] = rotate(v[2], 32)

    padded = data + bytes(7 - len(data) % 8) + bytes([len(data) & 0xFF])
    for (word,) in struct.iter_unpack("<Q", padded):
        v[3] ^= word
        rounds(2)
        v[0] ^= word
    v[2] ^= 0xFF
    rounds(4)
    return v[0] ^ v[1] ^ v[2] ^ v[3]


def listen(group, port):
    """A socket that hears what is sent to the group."""
    hearing = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    hearing.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    hearing.bind((group, port))
    hearing.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + bytes(4))
    return hearing


def messages(hearing, channels, seconds):
    """Channel and encoded message of those that come within some seconds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        hearing.settimeout(max(end - time.monotonic(), 0.001))
        try:
            packet = hearing.recv(65536)
        except socket.timeout:
            return
        name, zero, data = packet[8:].partition(b"\0")
        if packet[:4] == b"LC02" and zero and name.decode(errors="replace") in channels:
            yield name.decode(), data


def hear_run(fovea, options):
    """The number of the run that sends on PREFIX_RUN, within 3 seconds."""
    channel = options.prefix + "_RUN"
    if not hasattr(fovea, "run_t"):
        sys.exit("command.py: these types have no run_t: expected --run-id")
    for _, data in messages(listen(options.group, options.port), [channel], 3):
        return fovea.run_t.decode(data).run_id
    sys.exit(f"command.py: found no run on {channel} within 3 s, expected one, or --run-id")


def wait_for_answer(fovea, options, hearing, message):
    """Print the answer to the message; the exit code."""
    change = isinstance(message, fovea.parameter_t)
    words = ("done", "refused", "needs a restart" if change else "failed")
    settings = isinstance(message, fovea.settings_t)
    channel = options.prefix + ("_PARAMETER_RESULT" if change else "_SETTINGS_RESULT" if settings else "_COMMAND_RESULT")
    kinds = {channel: fovea.parameter_result_t if change else fovea.settings_result_t if settings else fovea.command_result_t}
    if isinstance(message, fovea.map_load_t):
        kinds[options.prefix + "_MAP_FILES"] = fovea.map_files_t
    other = None  # what a run that was not meant says: its word only where the right one is silent
    for name, data in messages(hearing, kinds, options.wait):
        answer = kinds[name].decode(data)
        if (answer.id, answer.sender) != (message.id, message.sender):
            continue
        done = not hasattr(answer, "result") or answer.result == answer.RESULT_DONE
        if hasattr(answer, "files"):
            text = "\n".join(f"{file.name}  {file.landmarks} landmarks, {file.bytes} bytes" for file in answer.files) or "no maps"
        else:
            text = words[answer.result] + (": " + answer.reason if answer.reason else "")
        if change and message.value == "" and done:
            text = f"{answer.key}: {answer.value}"
        if settings and answer.text and done:
            text = answer.text.rstrip()
        if message.run_id in (0, answer.run_id):
            print(text)
            return 0 if done else 1
        other = text
    if other is not None:
        print(other)
        return 1
    print(f"no answer on {channel} within {options.wait:g} s")
    return 3


def read_key(path):
    with open(path, encoding="ascii") as file:
        key = bytes.fromhex(file.read().strip())
    if len(key) != 16:
        sys.exit(f"command.py: {path}: found {len(key)} bytes, expected 32 hexadecimal digits")
    return key


COMMANDS = ("reset", "pause", "resume", "save", "overwrite", "record", "record-stop")


OTHERS = ("maps", "load:MAP", "backup", "restore:FILE", "KEY=VALUE")


def is_alone(text):
    """Whether the word is a request of its own kind."""
    return text in ("backup", "maps") or text.startswith(("restore:", "load:"))


def word(text):
    if text not in COMMANDS and "=" not in text and not is_alone(text):
        raise argparse.ArgumentTypeError(f"found {text!r}, expected one of {', '.join(COMMANDS + OTHERS)}")
    return text


def make_message(fovea, options):
    """The message that the words ask for, and its channel."""
    files = [text for text in options.command if is_alone(text)]
    changes = [text for text in options.command if "=" in text and text not in files]
    if options.keep and not changes:
        sys.exit("command.py: --keep: found no KEY=VALUE, expected one to keep")
    if files and len(options.command) > 1:
        sys.exit(f"command.py: found {len(options.command)} words, expected {files[0]} alone")
    if files and (files[0] == "maps" or files[0].startswith("load:")):
        message = fovea.map_load_t()
        message.file = files[0].partition(":")[2]
        if files[0] == "load:":
            sys.exit("command.py: load: found no name, expected that of a map in map.folder")
        return message, "MAP_LOAD"
    if files:
        message = fovea.settings_t()
        if files[0] != "backup":
            with open(files[0].split(":", 1)[1], encoding="utf-8") as file:
                message.text = file.read()
            if not 0 < len(message.text.encode()) <= 32767:
                sys.exit(f"command.py: {files[0]}: found {len(message.text.encode())} bytes, expected 1 to 32767")
        return message, "SETTINGS"
    if not changes:
        message = fovea.command_t()
        message.commands = sum(1 << COMMANDS.index(text) for text in set(options.command))
        return message, "COMMAND"
    if len(options.command) > 1:
        sys.exit(f"command.py: found {len(options.command)} words, expected KEY=VALUE alone")
    message = fovea.parameter_t()
    message.key, message.value = changes[0].split("=", 1)
    message.keep = options.keep
    return message, "PARAMETER"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", nargs="+", type=word, metavar="COMMAND", help=", ".join(COMMANDS + OTHERS))
    parser.add_argument("--keep", action="store_true", help="keep KEY=VALUE for the next start")
    parser.add_argument("--group", default="239.255.76.67", help="multicast group of the run's lcm_url")
    parser.add_argument("--port", type=int, default=7667)
    parser.add_argument("--ttl", type=int, default=0, help="0: this host; 1: this network")
    parser.add_argument("--prefix", default="FOVEA", help="channel_prefix of the run")
    parser.add_argument("--key", help="file of the key (command_key)")
    parser.add_argument("--run-id", type=int, help="run that is meant; heard where it is not given and --key is")
    parser.add_argument("--sender", type=int, default=1, help="own number of every machine that shares the key")
    parser.add_argument("--wait", type=float, default=3, metavar="SECONDS", help="for the answer; 0: do not wait")
    parser.add_argument("--types", default=os.path.join(here, "..", "..", "build", "python"), help="folder of the types")
    options = parser.parse_args()
    sys.path.insert(0, options.types)
    try:
        import fovea
    except ImportError:
        sys.exit(f"command.py: found no types in {options.types}, expected them from: make python-types")
    message, suffix = make_message(fovea, options)
    message.utime = time.time_ns() // 1000
    message.counter = time.time_ns()  # rises, as long as this clock does
    message.id = message.counter
    message.sender = options.sender
    message.run_id = options.run_id or 0
    if options.key is not None:
        if not options.run_id:
            message.run_id = hear_run(fovea, options)
        code = siphash(read_key(options.key), message.encode())  # mac is 0 so far
        message.mac = code - (1 << 64) if code >> 63 else code
    packet = b"LC02" + bytes(4) + f"{options.prefix}_{suffix}".encode() + b"\0" + message.encode()
    hearing = listen(options.group, options.port) if options.wait > 0 else None  # before the answer can come
    sending = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, options.ttl)
    sending.sendto(packet, (options.group, options.port))
    return wait_for_answer(fovea, options, hearing, message) if hearing else 0


sys.exit(main())
