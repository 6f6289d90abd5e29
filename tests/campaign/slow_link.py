#!/usr/bin/env python3
"""How old poses and statistics are behind a link of 1 Mbit/s and 200 ms (there and back): of a page, and of a client of Foxglove's protocol that
subscribes to every channel, pictures included. The link joins two network namespaces (slow_network.py: root). Each message is looked for at a second
client without the link; the time between is its age.

Usage: slow_link.py BUILD [SECONDS]     exit 0: after the first 10 of SECONDS (40), no pose and no statistics of the page is older than 500 ms. Those
of a client of Foxglove's protocol are printed: it asked for messages that take longer than that on such a link.
"""
import contextlib
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

from slow_network import NEAR, Network

PORT = 7688


class Client:
    """A websocket whose frames are heard on a thread of its own; each message that counts by what is in it, and when it came."""

    def __init__(self, token, protocol):
        self.socket = socket.create_connection((NEAR, PORT))
        self.socket.sendall((f"GET / HTTP/1.1\r\nHost: {NEAR}:{PORT}\r\nOrigin: http://{NEAR}:{PORT}\r\nCookie: fovea_{PORT}={token}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                             f"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: {protocol}\r\n\r\n").encode())
        self.came, self.pictures, self.channels = {}, 0, {}
        self.file = self.socket.makefile("rb")
        while self.file.readline() != b"\r\n":
            pass
        threading.Thread(target=self.hear, daemon=True).start()

    def say(self, opcode, data):
        head = bytes([0x80 | opcode]) + (bytes([0x80 | len(data)]) if len(data) < 126 else bytes([0xfe]) + struct.pack(">H", len(data)))
        self.socket.sendall(head + bytes(4) + data)

    def hear(self):
        with contextlib.suppress(ConnectionError):
            self.listen()

    def listen(self):
        while True:
            head = self.file.read(2)
            if len(head) < 2:
                return
            length = head[1] & 127
            if length >= 126:
                length = int.from_bytes(self.file.read(2 if length == 126 else 8), "big")
            data = self.file.read(length)
            if head[0] & 15 == 9:
                self.say(10, data)
            elif head[0] & 15 == 1:
                self.text(json.loads(data))
            elif head[0] & 15 == 2:
                self.binary(data)

    def note(self, name, what):
        self.came.setdefault((name, what), time.monotonic())


class Page(Client):
    def __init__(self, token):
        super().__init__(token, "fovea")

    def text(self, message):
        pass

    def binary(self, data):
        at = 0
        while at < len(data):
            length, = struct.unpack_from(">I", data, at)
            packet = data[at + 4:at + 4 + length]
            at += 4 + length
            if packet[0] == 1:
                name = packet[2:2 + packet[1]].decode()
                if name in ("POSE", "STATISTICS"):
                    self.note(name, packet[2 + packet[1]:])
            elif packet[0] == 2:
                self.pictures += 1
                self.say(1, b"ack %d" % struct.unpack_from(">I", packet, 4))


class Foxglove(Client):
    def __init__(self, token):
        super().__init__(token, "foxglove.sdk.v1")

    def text(self, message):
        if message["op"] != "advertise":
            return
        wanted = []
        for channel in message["channels"]:
            self.channels[channel["id"]] = channel["topic"]
            wanted.append({"id": channel["id"], "channelId": channel["id"]})
        self.say(1, json.dumps({"op": "subscribe", "subscriptions": wanted}).encode())

    def binary(self, data):
        if data[0] != 1:
            return
        name = self.channels[struct.unpack_from("<I", data, 1)[0]]
        self.pictures += "image" in name.lower()
        if any(word in name.lower() for word in ("pose", "tf", "transform", "statistic")):
            self.note(name, data[5:])


def ages(near, far, since):
    """Of the messages that both were sent after a time, by name."""
    found = {}
    for key, when in far.came.items():
        if when > since and key in near.came:
            found.setdefault(key[0], []).append((when - near.came[key]) * 1e3)
    return found


def main():
    build, seconds = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 40
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        feed, token = (os.path.join(folder, name) for name in ("feed", "token"))
        network = Network()
        robot = subprocess.Popen([os.path.join(build, "fovea"), "run", "--source", "sim:orbit?frames=1000000", "--rate", "real", "--quiet", "--picture", "none",
                                  "--set", "lcm_url=", "--set", "listen=none", "--set", "web.socket=" + feed])
        with network.on(network.near):
            server = subprocess.Popen([os.path.join(build, "fovea-web"), "--feed", feed, "--lcm-url", "", "--port", str(PORT), "--address", NEAR, "--token", token],
                                      stderr=subprocess.DEVNULL)
        try:
            time.sleep(2)
            with open(token, encoding="ascii") as file:
                words = file.read().split()
            for kind in (Page, Foxglove):
                with network.on(network.near):
                    near = kind(words[1])
                with network.on(network.far):
                    far = kind(words[1])
                begin = time.monotonic()
                time.sleep(seconds)
                for name, all_ms in sorted(ages(near, far, begin + 10).items()):
                    all_ms.sort()
                    worst = max(worst, all_ms[-1]) if kind is Page else worst
                    print(f"{kind.__name__:9} {name:24} {len(all_ms):5} messages: {all_ms[len(all_ms) // 2]:.0f} ms (median), {all_ms[int(0.95 * len(all_ms))]:.0f} (95 %), "
                          f"{all_ms[-1]:.0f} at most", flush=True)
                print(f"{kind.__name__:9} {far.pictures / seconds:.1f} pictures a second, {near.pictures / seconds:.1f} without the link; load "
                      f"{', '.join(f'{load:.1f}' for load in os.getloadavg())}", flush=True)
                near.socket.close()
                far.socket.close()
        finally:
            server.terminate()
            robot.terminate()
            server.wait()
            robot.wait()
            network.close()
    return 0 if 0 < worst <= 500 else 1


sys.exit(main())
