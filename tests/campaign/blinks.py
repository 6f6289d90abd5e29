#!/usr/bin/env python3
"""The latency that the page shows, against what is measured: a light blinks before a simulated camera of 60 Hz (blinks.c), and a headless
Chromium sees the blinks in its canvas. What the page says when it shows a blink is compared with the time from the change of the light to the
canvas, by a clock of this program, which is tied to the browser's by the fastest of 20 round trips.

Usage: blinks.py BUILD [COUNT]     exit 0: of COUNT blinks (200) the median of the difference is at most 10 ms, its 95th percentile 35
The Python of tools/browser_python.sh; Debian's chromium and chromium-driver. A loaded machine fails it: it judges times.
"""
import os
import subprocess
import sys
import tempfile
import threading
import time

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "common"))
from chromium import browser  # noqa: E402

PORT = 7686
WATCH = """
    const canvas = document.getElementById("picture"), context = canvas.getContext("2d"), channel = new MessageChannel(), later = new MessageChannel();
    globalThis.seen = [];
    let light = null;
    channel.port1.onmessage = () => {
      if (!fovea.live.picture) return;
      // Behind what the page drew for this frame of the screen.
      const now = performance.now(), level = context.getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data[0];
      if (light !== null && light !== level > 128) later.port2.postMessage([now, level > 128]);
      light = level > 128;
    };
    // The page says it when the frame is painted, too: behind that.
    later.port1.onmessage = ({ data }) => {
      const said = [...document.querySelectorAll("#latency div")].find((row) => row.textContent.startsWith("Camera to screen"));
      seen.push([...data, said ? parseFloat(said.querySelector("dd").textContent) : NaN, fovea.live.picture.stamp_ns * 1e-9, fovea.live.picture.between_ms]);
    };
    const look = () => { channel.port2.postMessage(0); requestAnimationFrame(look); };
    look();"""


def tie(driver):
    """Seconds to add to the page's clock for this program's, by the fastest of 20 round trips; and how long that took."""
    tries = []
    for _ in range(20):
        before = time.monotonic()
        there = driver.execute_script("return performance.now()") * 1e-3
        after = time.monotonic()
        tries.append((after - before, (before + after) / 2 - there))
    return min(tries)


def listen(lines, changes):
    for line in lines:
        stamp, level = line.split()
        changes.append((int(stamp) * 1e-9, int(level) > 128))


def percentile(values, part):
    return sorted(values)[min(len(values) - 1, int(part * len(values)))]


def main():
    build, count = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 200
    changes = []  # seconds, light
    with tempfile.TemporaryDirectory() as folder:
        socket = os.path.join(folder, "feed")
        light = subprocess.Popen([os.path.join(build, "tests", "campaign", "blinks"), socket], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        listener = threading.Thread(target=listen, args=(light.stdout, changes))
        listener.start()
        server = subprocess.Popen([os.path.join(build, "fovea-web"), "--feed", socket, "--lcm-url", "", "--rate", "60", "--port", str(PORT)])
        driver = None
        try:
            time.sleep(1)
            driver = browser(folder)
            driver.get(f"http://127.0.0.1:{PORT}/")
            while not driver.execute_script("return Boolean(globalThis.fovea && fovea.live.picture && fovea.link.tries >= 20)"):
                time.sleep(0.1)
            trip, offset = tie(driver)
            driver.execute_script(WATCH)
            seen = []
            while len(seen) < count:
                time.sleep(1)
                seen = driver.execute_script("return seen")
            again = tie(driver)
        finally:
            if driver is not None:
                driver.quit()
            server.terminate()
            light.stdin.close()
            server.wait()
            light.wait()
            listener.join()
    measured, differences, own, unmatched, left_out = [], [], [], 0, 0
    for when, level, said, stamp, between in seen[:count]:
        when = when * 1e-3 + offset
        earlier = [changed for changed, on in changes if on == level and changed <= when]
        if not earlier or when - earlier[-1] > 0.5:
            unmatched += 1
            continue
        measured.append((when - earlier[-1]) * 1e3)
        differences.append(abs(said - measured[-1]))
        own.append(abs(said - between - (when - stamp) * 1e3))
        left_out += between > 0
    if not measured:
        sys.exit("blinks.py: no blink on the canvas is one of the light")
    median, high = percentile(differences, 0.5), percentile(differences, 0.95)
    print(f"{len(measured)} blinks: light to canvas {percentile(measured, 0.5):.1f} ms (median), {percentile(measured, 0.95):.1f} (95 %); "
          f"said otherwise by {median:.1f} (median), {high:.1f} (95 %), of the time since the picture's own stamp by {percentile(own, 0.5):.1f}, "
          f"{percentile(own, 0.95):.1f}; clocks tied within {trip * 500:.1f} ms, apart by {(again[1] - offset) * 1e3:.1f} at the end; "
          f"{unmatched} not matched; {left_out} of them behind frames that were left out; load {', '.join(f'{load:.1f}' for load in os.getloadavg())}")
    return 0 if unmatched == 0 and median <= 10 and high <= 35 and min(measured) > 5 else 1


if __name__ == "__main__":
    sys.exit(main())
