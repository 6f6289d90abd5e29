#!/usr/bin/env python3
"""Pages that look at a running fovea-web, without browsers: what the server costs.

Usage: web_load.py [--port 7680] [--pages 5] [--seconds 20] --process PID     PID of fovea-web
Each page acknowledges every picture at once. Prints processor time, memory, and what each page got.
"""
import argparse
import os
import selectors
import socket
import struct
import time


class Page:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.sendall((f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
                             "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
                             "Sec-WebSocket-Protocol: fovea\r\n\r\n").encode())
        self.data, self.bytes, self.pictures, self.messages, self.classes = b"", 0, 0, 0, set()
        while b"\r\n\r\n" not in self.data:
            self.data += self.socket.recv(4096)
        self.data = self.data.partition(b"\r\n\r\n")[2]

    def take(self):
        new = self.socket.recv(1 << 20)
        if not new:
            raise SystemExit("web_load.py: fovea-web closed a page")
        self.data += new
        self.bytes += len(new)
        while len(self.data) >= 2:
            length, head = self.data[1] & 127, 2
            wide = {126: ">H", 127: ">Q"}.get(length)
            if wide:
                head += struct.calcsize(wide)
                if len(self.data) < head:
                    return
                length, = struct.unpack_from(wide, self.data, 2)
            if len(self.data) < head + length:
                return
            if self.data[0] & 15 == 9:  # whether this end lives
                self.socket.sendall(bytes([0x8a, 0x80, 0, 0, 0, 0]))
            elif self.data[0] & 15 == 2:
                at = head
                while at < head + length:
                    bytes_of_packet, = struct.unpack_from(">I", self.data, at)
                    self.packet(self.data[at + 4:at + 4 + bytes_of_packet])
                    at += 4 + bytes_of_packet
            self.data = self.data[head + length:]

    def packet(self, packet):
        self.messages += packet[0] == 1
        if packet[0] != 2:
            return
        self.pictures += 1
        self.classes.add(packet[1])
        words = b"ack %d" % struct.unpack_from(">I", packet, 4)
        self.socket.sendall(bytes([0x81, 0x80 | len(words), 0, 0, 0, 0]) + words)


def processor_s(process):
    with open(f"/proc/{process}/stat", encoding="ascii") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_mib(process, which):
    with open(f"/proc/{process}/status", encoding="ascii") as file:
        return next(int(line.split()[1]) for line in file if line.startswith(which)) / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--port", type=int, default=7680)
    parser.add_argument("--pages", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--process", type=int, required=True, help="number of the process of fovea-web")
    options = parser.parse_args()
    pages = [Page(options.port) for _ in range(options.pages)]
    ready = selectors.DefaultSelector()
    for page in pages:
        ready.register(page.socket, selectors.EVENT_READ, page)
    begin, before = time.monotonic(), processor_s(options.process)
    while time.monotonic() - begin < options.seconds:
        for key, _ in ready.select(0.1):
            key.data.take()
    seconds = time.monotonic() - begin
    used = processor_s(options.process) - before
    print(f"{options.pages} pages, {seconds:.0f} s: {100 * used / seconds:.1f} % of a core, {memory_mib(options.process, 'VmRSS'):.1f} MiB, "
          f"at most {memory_mib(options.process, 'VmHWM'):.1f} MiB")
    for page in pages:
        print(f"  {page.pictures / seconds:.1f} pictures/s of classes {sorted(page.classes)}, {page.messages / seconds:.0f} messages/s, "
              f"{page.bytes / seconds / 1e3:.0f} kB/s")


main()
