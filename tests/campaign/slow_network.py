"""Two hosts joined by a slow link, for tests: network namespaces with a TUN device each, whose packets are passed on in user space, since not every
kernel has netem. A packet takes its bytes at the rate of the link, then the delay; one that finds the queue full is lost, as in a router. Needs root.
"""
import collections
import contextlib
import ctypes
import fcntl
import os
import struct
import subprocess
import threading
import time

NEAR, FAR = "10.99.7.1", "10.99.7.2"
TUNSETIFF, IFF_TUN, IFF_NO_PI, CLONE_NEWNET = 0x400454ca, 1, 0x1000, 0x40000000


class Way:
    """One direction."""

    def __init__(self, source, sink, bits_per_s, delay_s, queue_bytes):
        self.source, self.sink, self.rate, self.delay_s, self.queue_bytes = source, sink, bits_per_s / 8, delay_s, queue_bytes
        self.waiting, self.news, self.lost, self.passed = collections.deque(), threading.Condition(), 0, 0
        for work in (self.take, self.give):
            threading.Thread(target=work, daemon=True).start()

    def take(self):
        free = time.monotonic()
        while True:
            packet = os.read(self.source, 2000)
            free = max(free, time.monotonic())
            if (free - time.monotonic()) * self.rate > self.queue_bytes:
                self.lost += 1
                continue
            free += len(packet) / self.rate
            self.passed += len(packet)
            with self.news:
                self.waiting.append((free + self.delay_s, packet))
                self.news.notify()

    def give(self):
        while True:
            with self.news:
                while not self.waiting:
                    self.news.wait()
                due, packet = self.waiting.popleft()
            time.sleep(max(0.0, due - time.monotonic()))
            with contextlib.suppress(OSError):
                os.write(self.sink, packet)


class Network:
    """The process is on the near host where it says `on(near)`, and on the far one with `on(far)`: threads and processes that begin there stay there."""

    def __init__(self, bits_per_s=1e6, delay_s=0.1, queue_bytes=1 << 16):
        self.near, self.far = (f"fovea-{name}-{os.getpid()}" for name in ("near", "far"))
        ends = []
        for name, device, here, there in ((self.near, "fovea-n", NEAR, FAR), (self.far, "fovea-f", FAR, NEAR)):
            device += str(os.getpid() % 10000)
            ends.append(os.open("/dev/net/tun", os.O_RDWR))
            fcntl.ioctl(ends[-1], TUNSETIFF, struct.pack("16sH", device.encode(), IFF_TUN | IFF_NO_PI))
            for command in (f"netns add {name}", f"link set {device} netns {name}", f"-n {name} link set lo up",
                            f"-n {name} addr add {here} peer {there} dev {device}", f"-n {name} link set {device} up"):
                subprocess.run(["ip", *command.split()], check=True)
        self.ways = [Way(*pair, bits_per_s, delay_s, queue_bytes) for pair in (ends, ends[::-1])]

    @contextlib.contextmanager
    def on(self, name):
        libc = ctypes.CDLL(None, use_errno=True)
        with open("/proc/self/ns/net", "rb") as home, open("/run/netns/" + name, "rb") as there:
            assert libc.setns(there.fileno(), CLONE_NEWNET) == 0, os.strerror(ctypes.get_errno())
            try:
                yield
            finally:
                assert libc.setns(home.fileno(), CLONE_NEWNET) == 0

    def close(self):
        for name in (self.near, self.far):
            subprocess.run(["ip", "netns", "del", name], check=False)
