"""What the tests of fovea-web's page share: a browser with a page, runs, and what holds of every page.

The arguments are those of the program: BUILD FOLDER.
"""
import atexit
import importlib.util
import os
import signal
import socket
import subprocess
import sys
import time

build, folder = sys.argv[1:3]
here = os.path.dirname(os.path.abspath(__file__))
ADDRESS = "http://127.0.0.1:7680/"
PATIENCE_S = 600  # other programs may use the processor


def module(*path):
    """A program beside this one, as a module."""
    spec = importlib.util.spec_from_file_location(path[-1], os.path.join(here, *path) + ".py")
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def reader():
    return module("..", "..", "tools", "subscribers", "read_recording")


def begin(words, **more):
    """A program that does not outlive this one, whatever this one ends by but a kill."""
    process = subprocess.Popen(words, **more)
    atexit.register(process.kill)
    return process


def run(*more):
    """A run whose frames are few and half as full of features: drawing by the processor alone is what costs here."""
    words = [os.path.join(build, "fovea"), "run", "--source", "sim:orbit?frames=1000000&rate=5", "--rate", "real", "--quiet", "--picture",
             "none", "--model", "src/detect/shipped.fvm", "--set", "features.count_max=500", "--set", "map_every=2", "--set", "record_buffer=200", "--set", "web.socket=" + os.path.join(folder, "feed"), *more]
    return begin(words, env={**os.environ, "FOVEA_SYS_ROOT": heat()})


def heat():
    """A machine of one thermal zone, which is near its limit: the folder before its /sys."""
    zone = os.path.join(folder, "hot", "sys", "class", "thermal", "thermal_zone0")
    os.makedirs(zone, exist_ok=True)
    for name, text in (("type", "cpu-thermal"), ("temp", "79000"), ("trip_point_0_type", "passive"), ("trip_point_0_temp", "80000")):
        with open(os.path.join(zone, name), "w") as file:
            file.write(text + "\n")
    return os.path.join(folder, "hot")


def end(process):
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE_S) == 0, "an exit status"


def web(*more):
    feed = () if more and more[0] in ("--play", "--feed") else ("--feed", os.path.join(folder, "feed"))
    return begin([os.path.join(build, "fovea-web"), *feed, *more])


def until_served():
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        try:
            socket.create_connection(("127.0.0.1", 7680), PATIENCE_S).close()
            return
        except OSError:
            time.sleep(0.05)
    raise SystemExit("web_page.py: nothing is served at " + ADDRESS)


class Page:
    """All that follow each other are in one browser, which starts once."""
    shared = None

    def __init__(self):
        if Page.shared is None:
            Page.shared = module("..", "common", "chromium").browser(folder, "--host-resolver-rules=MAP robot.local 127.0.0.1")
        self.driver = Page.shared

    def close(self):
        """Nothing of it is left for the next, but what the browser holds in its cache."""
        self.driver.delete_all_cookies()
        self.size()
        self.driver.get("about:blank")
        for name in ("browser", "performance"):
            self.driver.get_log(name)

    @staticmethod
    def quit():
        if Page.shared is not None:
            Page.shared.quit()
        Page.shared = None

    def js(self, text, *arguments):
        return self.driver.execute_script(text, *arguments)

    def until(self, text, what):
        """Wait until an expression is true, and return it."""
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            found = self.js("return " + text)
            if found:
                return found
            time.sleep(0.1)
        raise SystemExit(f"web_page.py: {what}: not within {PATIENCE_S} s; log: {self.driver.get_log('browser')[:5]}")

    def text(self, name):
        return self.js("return document.getElementById(arguments[0]).textContent", name)

    def downloads(self):
        """From now on, into the folder."""
        self.driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": folder})

    def await_file(self, name, size):
        until = time.monotonic() + PATIENCE_S
        path = os.path.join(folder, name)
        while not (os.path.exists(path) and os.path.getsize(path) == size):
            assert time.monotonic() < until, f"{name}: not downloaded"
            time.sleep(0.05)

    def end_network_log(self):
        """The log of the network holds each frame of a websocket: passing it on takes as much time as the page itself."""
        self.driver.execute_cdp_cmd("Network.disable", {})
        self.driver.get_log("performance")

    def see(self, name):
        """Bring an element into view."""
        self.js("document.getElementById(arguments[0]).scrollIntoView({ block: 'center' })", name)

    def size(self, width=None, height=None):
        """Of the window; without arguments its own."""
        if width is None:
            self.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
            return
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                                    {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500})


def check_accessible(page):
    import axe_core_python
    script = os.path.join(os.path.dirname(axe_core_python.__file__), "axe.min.js")
    with open(script, encoding="utf-8") as file:
        page.js(file.read())
    found = page.driver.execute_async_script("const done = arguments[0]; axe.run({ resultTypes: ['violations'] }).then((result) => done(result.violations))")
    bad = [(rule["id"], [node["html"][:120] for node in rule["nodes"]]) for rule in found if rule["impact"] in ("serious", "critical")]
    assert not bad, bad


def check_console(page):
    wrong = [entry for entry in page.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")
             and entry["source"] != "rendering"]  # which is about this test's reading of pixels
    assert not wrong, wrong


def check_box(page):
    """A box's edges, whose first pixel's outer edge is half a pixel before its centre, are where the message says; it is compared with the
    recording later. An object that leaves the picture has edges outside it: the box is one with all edges, and what is looked at beside
    them, inside. Choosing and drawing it are one call, as the next message brings other boxes."""
    found = page.until("""(() => {
        const { live } = fovea, k = live.k, inside = (at, size) => at >= 6 && at < size / k - 6;
        const box = live.hasObjects && live.boxes.find(({ faint, box }) => !faint &&
          [box.x_min_px, box.x_max_px].every((x) => inside(x, live.canvas.width)) &&
          [box.y_min_px, box.y_max_px].every((y) => inside(y, live.canvas.height)));
        if (!box) return null;
        live.boxes = [box];
        for (const layer in live.layers) live.layers[layer] = layer === "boxes";
        live.draw();
        const at = (x, y) => [...live.context.getImageData(Math.floor(x * k), Math.floor(y * k), 1, 1).data];
        const { x_min_px: left, y_min_px: top, x_max_px: right, y_max_px: bottom } = box.box, high = (top + bottom) / 2;
        const result = { stamp: live.boxesStamp, id: Number(box.id), box: box.box, on: [at(left, high), at(right, high),
          at((left + right) / 2, bottom)], off: [at(left - 5, high), at(left + 5, high), at((left + right) / 2, bottom + 5)] };
        for (const layer in live.layers) live.layers[layer] = true;
        return result;
      })()""", "an object inside the picture")
    colour = max(set(map(tuple, found["on"])), key=found["on"].count)
    for pixel in found["on"]:
        assert max(abs(a - b) for a, b in zip(pixel, colour)) < 40 and max(pixel[:3]) - min(pixel[:3]) > 60, found
    for pixel in found["off"]:
        assert max(pixel[:3]) - min(pixel[:3]) < 30, found  # the picture is grey
    return found


def check_against_recording(found, path):
    recorded = reader()
    types = dict(recorded.read_types(recorded.RECORDING))
    for _, _, channel, data in recorded.events(path):
        if channel.endswith("RECORDING"):
            parts = recorded.Reader(types, data).struct("fovea.recording_t")["parts"]
            types.update(recorded.read_types(next(part["data"] for part in parts if part["name"] == "types").decode()))
        if not channel.endswith("_OBJECTS"):
            continue
        message = recorded.Reader(types, data).struct("fovea.objects_t")
        if message["stamp"]["time_ns"] != found["stamp"]:
            continue
        box = next(o["box"] for o in message["objects"] if o["id"] == found["id"])
        assert all(abs(box[side] - found["box"][side]) < 1e-6 for side in box), (box, found)
        return
    raise SystemExit("web_page.py: the recording has no objects of the page's stamp")
