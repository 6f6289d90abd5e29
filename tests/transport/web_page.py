"""The page of fovea-web in a headless Chromium, beside a simulated run. Used by test_web_page.

Usage: web_page.py BUILD FOLDER     FOVEA_SCREENSHOTS=DIR keeps the screenshots of the page at 360 and 1,440 pixels of width
"""
import json
import os
import re
import subprocess
import time
from xml.etree import ElementTree

from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from web_browser import (ADDRESS, PATIENCE_S, Page, begin, build, check_accessible, check_against_recording, check_box, check_console, end, folder, here, reader, run, until_served, web)
from web_robots import check_robots


TALL = 2400  # pixels of a window that shows all plots and the view in three dimensions

# Pixels of the view in three dimensions, drawn now, and where a place of the path is on it, for a page whose run has a pose (look).
LOOK = """
    const look = (space) => {
      space.draw();
      const gl = space.renderer.getContext(), { width, height } = space.canvas, data = new Uint8Array(4 * width * height);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
      return (x, y) => [...data.subarray(4 * ((height - 1 - Math.floor(y)) * width + Math.floor(x)), 4 * ((height - 1 - Math.floor(y)) * width + Math.floor(x)) + 3)];
    };
    const where = (space, [x, y, z]) => { // by the words of pose_t, from its frame to `map`
      const { map_orientation: [w, a, b, c], map_scale: s, map_position: t } = fovea.scene.pose;
      const place = [
        (1 - 2 * (b * b + c * c)) * x + 2 * (a * b - w * c) * y + 2 * (a * c + w * b) * z,
        2 * (a * b + w * c) * x + (1 - 2 * (a * a + c * c)) * y + 2 * (b * c - w * a) * z,
        2 * (a * c - w * b) * x + 2 * (b * c + w * a) * y + (1 - 2 * (a * a + b * b)) * z].map((value, i) => s * value + t[i]);
      const p = space.map.localToWorld(space.camera.position.clone().fromArray(place)).project(space.camera);
      return [(p.x + 1) / 2 * space.canvas.width, (1 - p.y) / 2 * space.canvas.height];
    };
"""


def look(page, text, *arguments):
    """What a script finds that begins with LOOK. A run that lacks the processor may be lost for some frames: its next pose is waited for."""
    page.until("fovea.scene.pose", "a pose")
    return page.js(LOOK + text, *arguments)


def check_load(page):
    """Small, from here alone."""
    urls, sizes = [], {}
    for entry in page.driver.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            urls.append(message["params"]["request"]["url"])
        if message["method"] == "Network.loadingFinished":
            sizes[message["params"]["requestId"]] = message["params"]["encodedDataLength"]
    strange = [url for url in urls if not url.startswith((ADDRESS, "ws://127.0.0.1:7680/", "data:", "chrome:"))]
    assert not strange, strange
    assert len(urls) >= 10, urls
    assert sum(sizes.values()) < 600_000, sizes
    times = page.js("const mark = (name) => performance.getEntriesByName(name)[0].startTime; "
                    "return [performance.getEntriesByType('navigation')[0].domContentLoadedEventEnd, mark('plots drawn'), mark('space drawn')]")
    print("page: {} bytes in {} requests; content loaded after {:.0f} ms, plots drawn after {:.0f}, the view in three dimensions after {:.0f}".format(sum(sizes.values()), len(urls), *times))
    page.end_network_log()


def check_in_view(page):
    """Libraries are loaded when what they draw comes into view; it is drawn as long as it is there and the tab is shown."""
    fetched = "performance.getEntriesByType('resource').map(({ name }) => new URL(name).pathname)"
    page.size(360, 400)  # filled by the first panels
    page.driver.refresh()
    page.until("globalThis.fovea && fovea.live.picture && fovea.scene.path.count > 3 && fovea.plots[0].lines.size > 0", "a small page")
    early = {"/space.js", "/three/build/three.module.js", "/charts.js", "/chart.js"} & set(page.js("return " + fetched))
    assert not early, early
    page.see("scene")
    drawn = "fovea.space.renderer.info.render.frame"
    page.until(f"fovea.space && {drawn} > 5", "the view in three dimensions")
    assert "/chart.js" not in page.js("return " + fetched)
    page.see("times")
    page.until("performance.getEntriesByName('plots drawn').length && fovea.plots[0].chart.data.datasets.length", "the plots")
    for _ in range(50):  # a browser that has little of the processor hears late what is in view
        before, places = page.js(f"return [{drawn}, fovea.scene.path.count]")
        page.until(f"fovea.scene.path.count > {places + 3}", "a longer path")
        if page.js("return " + drawn) == before:
            break
    else:
        raise SystemExit("web_page.py: what is out of view was drawn")
    page.see("scene")
    page.until(f"{drawn} > {before + 2}", "the view in three dimensions again")
    page.size()


def check_again(page):
    """What the browser has kept is asked about, and not sent again; without WebGL the page says so in one line, and the rest of it works."""
    script = page.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": """
        const get = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, ...more) { return kind.startsWith("webgl") ? null : get.call(this, kind, ...more); };"""})
    page.size(1440, TALL)
    page.driver.refresh()
    page.until("globalThis.fovea && !document.getElementById('no-scene').hidden && fovea.live.picture && performance.getEntriesByName('plots drawn').length",
               "the page without WebGL")
    assert page.text("no-scene") == "This browser has no WebGL: path and map are not drawn.", page.text("no-scene")
    page.until("fovea.scene.path.count > 3 && fovea.plots[0].lines.size > 0", "that the rest of the page works")
    sizes = page.js("return performance.getEntriesByType('resource').map(({ name, transferSize }) => [new URL(name).pathname, transferSize])")
    assert all(size < 1000 for name, size in sizes if name.endswith(".js")) and len(sizes) > 20, sizes
    assert not any(name.startswith(("/three/", "/space.js")) for name, _ in sizes), sizes
    check_console(page)
    page.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", {"identifier": script["identifier"]})
    page.driver.refresh()
    page.until("Boolean(globalThis.fovea && fovea.space)", "the page")
    page.size()


def check_picture(page):
    first = page.until("fovea.live.picture && fovea.live.picture.number", "a picture")
    page.until(f"fovea.live.picture.number > {first + 10}", "ten more pictures")
    levels = page.js("""
        const { canvas, context } = fovea.live, data = context.getImageData(0, 0, canvas.width, canvas.height).data, seen = new Set();
        for (let i = 0; i < data.length; i += 4) seen.add(data[i]);
        return seen.size;""")
    assert levels > 100, f"{levels} levels of red in the picture"
    assert page.js("return fovea.live.picture.points.length") > 300


def check_plots(page):
    text = "document.getElementById('legend-%s').textContent"
    page.until((text % "temperature") + " === 'processor 79 °C'", "the temperature in its plot")
    page.size(1440, TALL)
    page.see("times")  # all of it
    drawn = page.until("""(() => { const found = fovea.plots.map(({ canvas, lines }) => {
          const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
          const drawn = (colour) => {
            const wanted = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
            for (let i = 0; i < data.length; i += 4) { // thin lines let their background through, a grid's line at the worst
              if (data[i + 3] <= 100) continue;
              const pixel = [...data.subarray(i, i + 3)], part = Math.max(...pixel) / Math.max(...wanted);
              if (part > 0.6 && wanted.every((value, k) => Math.abs(pixel[k] - part * value) < 30)) return true;
            }
            return false;
          };
          return [...lines.values()].filter(({ points }) => points.length > 4).map(({ colour }) => drawn(colour));
        }); // of equal values one covers the others
        return found.every((lines) => lines.length > 0 && 2 * lines.filter(Boolean).length >= lines.length) && found; })()""", "all plots")
    assert len(drawn) == 4, drawn
    page.until("/^late \\d+\\.\\d \\/sdropped \\d+\\.\\d \\/s$/.test(" + (text % "deadlines") + ")", "missed deadlines in their plot")


def check_health(page):
    page.until("document.getElementById('health').textContent.startsWith('host degraded: ') "
               "&& !document.getElementById('health').hidden", "the heat of the machine")
    assert "79" in page.text("health"), page.text("health")


def check_path(page):
    page.until("fovea.scene.path.count > 10 && fovea.scene.landmarks.size > 50 && fovea.scene.keyframes.size > 2",
               "a path and a map")
    found = look(page, """
        const { space, scene } = fovea, { places, count } = scene.path, shown = { ...space.shown };
        // Another place of the map than that of the run, whose is often the same.
        scene.pose = { ...scene.pose, map_scale: 1.5, map_position: [0.2, -0.1, 0.3], map_orientation: [0.8, 0, 0.6, 0] };
        space.shown.landmarks = space.shown.keyframes = false;
        space.body.material.visible = false; // it covers the newest places
        const pixel = look(space), blue = (x, y) => { const [r, g, b] = pixel(x, y); return r < 140 && g > 120 && b > 170; };
        let all = 0, hit = 0;
        for (let y = 0; y < space.canvas.height; y++) for (let x = 0; x < space.canvas.width; x++) all += blue(x, y);
        for (let n = 0; n < count; n++) {
          const [x, y] = where(space, [...places.slice(3 * n, 3 * n + 3)]);
          hit += [-1, 0, 1].some((dx) => [-1, 0, 1].some((dy) => blue(x + dx, y + dy)));
        }
        Object.assign(space.shown, shown);
        space.body.material.visible = true;
        space.draw();
        const up = space.map.localToWorld(space.camera.position.clone().fromArray(scene.up)).y / Math.hypot(...scene.up);
        return { all, hit, count, up };""")
    assert found["up"] > 0.99, found
    assert found["all"] > 100, found
    assert found["hit"] >= 0.95 * found["count"], found


def check_hands(page):
    """The view follows the path until hands move it: a finger turns it, a wheel comes nearer, keys do both; buttons bring it back."""
    state = ("const { camera, controls, shown } = fovea.space, at = camera.position.clone().sub(controls.target); "
             "return [shown.follow, at.length(), Math.atan2(at.x, at.z), at.y / at.length(), document.querySelector('[data-view=follow]').getAttribute('aria-pressed')]")
    canvas = page.driver.find_element(By.ID, "scene")
    page.js("arguments[0].scrollIntoView({ block: 'center' })", canvas)
    before = page.js(state)
    assert before[0] and before[4] == "true", before
    box = page.js("const { x, y, width, height } = arguments[0].getBoundingClientRect(); return [x + width / 2, y + height / 2]", canvas)
    for kind, more in (("touchStart", 0), ("touchMove", 60), ("touchMove", 90), ("touchEnd", None)):
        points = [] if more is None else [{"x": box[0] + more, "y": box[1]}]
        page.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    turned = page.js(state)
    assert turned[0] and abs(turned[2] - before[2]) > 0.3, (before, turned)
    canvas.send_keys(Keys.ARROW_UP)
    raised = page.js(state)
    assert raised[3] > turned[3] + 0.03, (turned, raised)
    page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": "mouseWheel", "x": box[0], "y": box[1], "deltaX": 0, "deltaY": -200})
    page.until("!fovea.space.shown.follow", "that the wheel moved the eye")
    nearer = page.js(state)
    assert nearer[1] < raised[1] and nearer[4] == "false", (raised, nearer)
    page.driver.find_element(By.CSS_SELECTOR, "[data-view=top]").click()
    assert page.js(state)[3] > 0.999
    page.driver.find_element(By.CSS_SELECTOR, "[data-view=follow]").click()
    page.until("fovea.space.shown.follow", "the path again")
    page.js("scrollTo(0, 0)")


def check_commands(page):
    pause = page.driver.find_element(By.CSS_SELECTOR, "[data-command=pause]")
    page.js("arguments[0].focus()", pause)
    pause.send_keys(Keys.ENTER)
    page.until("document.getElementById('answer').textContent === 'pause: done'", "the answer to pause")
    page.until("document.getElementById('state').dataset.state === 'paused'", "the state paused")
    page.driver.find_element(By.CSS_SELECTOR, "[data-command=resume]").click()
    page.until("document.getElementById('answer').textContent === 'resume: done'", "the answer to resume")
    page.until("document.getElementById('state').dataset.state === 'tracking'", "the state tracking")
    page.driver.find_element(By.CSS_SELECTOR, "[data-command=save]").click()
    page.until("/^save: done/.test(document.getElementById('answer').textContent)", "the answer to save")
    assert os.path.getsize(os.path.join(folder, "maps", "map")) > 1000
    with open(os.path.join(folder, "maps", "other"), "wb") as file:  # shown as a map, and damaged
        with open(os.path.join(folder, "maps", "map"), "rb") as saved:
            file.write(saved.read()[:-9] + b"damaged!!")
    epoch = page.js("return fovea.scene.path.epoch")
    page.js("document.getElementById('map-file').focus()")
    page.until("document.getElementById('map-file').options.length === 2", "the list of maps")
    for name, said in (("other", "refused: other: byte "), ("map", "done")):
        page.js("document.getElementById('map-file').value = arguments[0]", name)
        page.driver.find_element(By.ID, "load-map").click()
        page.until(f"document.getElementById('answer').textContent.startsWith('load {name}: {said}')", "the answer to load")
    page.until(f"fovea.scene.path.epoch > {epoch}", "the path in the map that was loaded")
    reset = page.driver.find_element(By.CSS_SELECTOR, "[data-command=reset]")
    asked = page.js("arguments[0].click(); return arguments[0].textContent", reset)  # at once: it is asked for seconds alone
    assert asked == "Discard the map?", asked  # once is not enough


def check_layers(page):
    """A mask and a grid of known cells are drawn where they say; no network of the simulated run makes any."""
    found = look(page, """
        const { live, scene } = fovea, classes = [0, 255].map((red, i) => ({ class_id: i, class_name: ["floor", "wall"][i], red, green: 255 - red, blue: 0, fraction: 0.5 }));
        const layers = { ...live.layers };
        for (const layer in live.layers) live.layers[layer] = layer === "classes";
        const piece = (first_row) => live.segmentation({ stamp: { time_ns: 1n }, camera: 0, width: 4, height: 4, classes, first_row, row_count: 2, run_count: 3,
          run_class: [0, 255, 1], run_length: [3, 2, 3], raw_scale_x: live.picture.width / 4, raw_scale_y: live.picture.height / 4,
          raw_offset_x: live.picture.width / 8 - 0.5, raw_offset_y: live.picture.height / 8 - 0.5 }, 0);
        piece(0);
        piece(2);
        const before = document.createElement("canvas");
        live.layers.classes = false;
        live.draw();
        Object.assign(before, { width: live.canvas.width, height: live.canvas.height });
        before.getContext("2d").drawImage(live.canvas, 0, 0);
        live.layers.classes = true;
        live.draw();
        const at = (canvas, column, row) => [...canvas.getContext("2d").getImageData((column + 0.5) * canvas.width / 4, (row + 0.5) * canvas.height / 4, 1, 1).data];
        const change = (column, row) => at(live.canvas, column, row).map((value, i) => value - at(before, column, row)[i]);
        const mask = { green: change(0, 0), none: change(3, 0), red: change(3, 1), below: change(0, 2), legend: live.classes.textContent };
        Object.assign(live.layers, layers);
        live.masks[0].forget();
        live.classes.replaceChildren();
        // Two rows of four cells before the eye, in the frame of the path.
        const { space } = fovea, shown = { ...space.shown }, side = space.seen.distance / 8, { target } = space.controls;
        const corner = space.odometry.worldToLocal(target.clone()).toArray();
        for (const part of ["landmarks", "keyframes"]) space.shown[part] = false;
        for (const thing of [space.path, space.body, space.grid]) thing.material.visible = false;
        scene.addFloor({ stamp: { time_ns: 1n }, width: 4, height: 2, first_row: 1, row_count: 1, cells: [-1, 10, 90, 90],
          free_below: 0.35, occupied_above: 0.65, resolution_m: side, origin_position: corner, origin_orientation: [1, 0, 0, 0] });
        scene.addFloor({ stamp: { time_ns: 1n }, width: 4, height: 2, first_row: 0, row_count: 1, cells: [0, 0, 50, 100],
          free_below: 0.35, occupied_above: 0.65, resolution_m: side, origin_position: corner, origin_orientation: [1, 0, 0, 0] });
        const pixel = look(space), kind = ([r, g]) => r > g + 40 ? "occupied" : g > r + 30 ? "free" : "none";
        const cells = [0, 1].map((row) => [0, 1, 2, 3].map((column) =>
          kind(pixel(...where(space, [corner[0] + (column + 0.5) * side, corner[1] + (row + 0.5) * side, corner[2]])))));
        scene.floor.forget();
        for (const thing of [space.path, space.body, space.grid]) thing.material.visible = true;
        Object.assign(space.shown, shown);
        space.draw();
        return { mask, cells };""")
    mask, cells = found["mask"], found["cells"]
    assert mask["green"][1] > mask["green"][0] and mask["red"][0] > mask["red"][1] and mask["below"] != [0, 0, 0, 0], mask
    assert mask["none"][:3] == [0, 0, 0] and "floor 50 %" in mask["legend"] and "wall 50 %" in mask["legend"], mask
    assert cells == [["free", "free", "none", "occupied"], ["none", "free", "occupied", "occupied"]], cells


def check_parameters(page, kept):
    """The number of features is read, changed, seen in the next frames, kept; a wrong value is refused with the reason."""
    rows = "fovea.parameters.rows"
    page.js("document.querySelector('[for=\"key-features.count_max\"]').closest('details').open = true")
    before = page.until(rows + ".get('features.count_max').input.value", "the number in force")

    def change(value, what):
        field = page.driver.find_element(By.ID, "key-features.count_max")
        field.clear()
        field.send_keys(value + Keys.ENTER)
        return page.until(f"{rows}.get('features.count_max').said.textContent !== 'sent' && {rows}.get('features.count_max').said.textContent",
                          what)

    said = change("150", "the answer to a new number")
    assert said == "in force: 150", said
    page.until("fovea.live.picture.points.length <= 3 * 150", "pictures with fewer features")  # x, y, level
    said = change("0", "the answer to a wrong number")
    assert said.startswith("refused: features.count_max: found") and said.endswith("In force: 150"), said
    page.driver.find_element(By.ID, "keep").click()
    said = change(before, "the answer to a number to keep")
    assert said == "in force: " + before, said
    page.until("fovea.live.picture.points.length > 3 * 250", "pictures with features")
    with open(kept, encoding="utf-8") as file:
        assert "count_max: " + before in file.read()
    page.driver.find_element(By.ID, "all-keys").click()
    page.js("for (const group of document.getElementById('keys').children) group.open = true")  # all at once
    page.until(f"[...{rows}.values()].every((row) => row.known && row.input.value !== '')", "the values of all keys")
    strange = page.js(f"return [...{rows}.values()].map((row) => row.said.textContent).filter((text) => text && !text.startsWith('in force'))")
    assert not strange, strange
    assert page.js(f"return {rows}.get('seed').input.value") == "1"
    assert page.js(f"return {rows}.get('seed').input.disabled")
    page.driver.find_element(By.ID, "all-keys").click()


def restore(page, path, what):
    page.js("document.getElementById('settings-said').textContent = ''")
    page.driver.find_element(By.ID, "restored").send_keys(path)
    return page.until("document.getElementById('settings-said').textContent", what)


def check_settings(page, kept):
    """All settings as one file, saved and given back: refused whole when one line is wrong, in force and kept when all are right."""
    page.downloads()
    page.driver.find_element(By.ID, "back-up").click()
    name = page.until("(document.getElementById('settings-said').textContent.match(/^saved as (.*)/) || [])[1]", "the saved settings")
    path = os.path.join(folder, name)
    until = time.monotonic() + PATIENCE_S
    while not os.path.exists(path) and time.monotonic() < until:
        time.sleep(0.05)
    page.driver.find_element(By.ID, "save-log").click()
    until = time.monotonic() + PATIENCE_S
    while not (logs := [name for name in os.listdir(folder) if name.startswith("fovea-log-") and name.endswith(".txt")]) and time.monotonic() < until:
        time.sleep(0.05)
    with open(os.path.join(folder, logs[0]), encoding="utf-8") as file:
        lines = file.read().split("\n")
    assert lines[0].split()[1] == "run" and any("pose: " in line for line in lines) and any(" host degraded: " in line for line in lines), lines
    with open(path, encoding="utf-8") as file:
        text = file.read()
    assert "\n# source: " in text and "\nsource: " not in text and "\nfeatures.count_max: " in text and "command_key: (not" in text, text
    before = text.split("\nfeatures.count_max: ")[1].split("\n")[0]
    with open(kept, encoding="utf-8") as file:
        as_kept = file.read()
    other = os.path.join(folder, "other.yaml")

    def write(*changes):
        changed = text
        for key, value in changes:
            changed = "\n".join(f"{key}: {value}" if line.startswith(key + ": ") else line for line in changed.split("\n"))
        with open(other, "w", encoding="utf-8") as file:
            file.write(changed)

    write(("features.count_max", "160"), ("features.threshold", "many"))
    said = restore(page, other, "the answer to wrong settings")
    assert said.startswith("refused: settings:") and "features.threshold: found 'many'" in said, said
    write()
    with open(other, "a", encoding="utf-8") as file:
        file.write("record_keep: 1\n")
    said = restore(page, other, "the answer to a key of the host")
    assert "record_keep: found a key of the host" in said, said
    with open(other, "w", encoding="utf-8") as file:
        file.write(text + "---\nimage_width: 640\n")
    said = restore(page, other, "the answer to a calibration of no file")
    assert said.startswith("refused: calibration: found one, expected none"), said
    with open(kept, encoding="utf-8") as file:
        assert file.read() == as_kept
    write(("features.count_max", "160"), ("odometry.keyframes", "77"))
    said = restore(page, other, "the answer to right settings")
    assert said == "restored other.yaml: 1 took hold, 1 with the next start", said
    page.until("fovea.live.picture.points.length <= 3 * 160", "pictures with fewer features")
    with open(kept, encoding="utf-8") as file:
        lines = file.read().split("\n")
    assert "features.count_max: 160" in lines and "odometry.keyframes: 77" in lines and len(lines) == 4, lines
    said = restore(page, path, "the answer to what was saved")
    assert said == "restored " + name + ": 1 took hold, 0 with the next start", said
    with open(kept, encoding="utf-8") as file:
        assert "features.count_max: " + before in file.read()


def check_recording(page, records):
    """Begun and ended by the buttons, in the middle of the run, with the disk's space; it replays bit for bit."""
    press = lambda word: page.driver.find_element(By.CSS_SELECTOR, f"[data-command={word}]").click()
    said = "document.getElementById('recording').textContent"
    page.until(said + ".startsWith('not recording; ') && " + said + ".endsWith(' GB free')", "the state of the recorder")
    press("record-stop")
    page.until("document.getElementById('answer').textContent === 'record-stop: refused: found no recording to end'", "the refusal")
    press("record")
    page.until(said + ".startsWith('recording 000001-') && Number(" + said + ".match(/([0-9.]+) MB/)[1]) > 12", "a recording that grows")
    press("record-stop")
    page.until(said + ".startsWith('recorded 000001-')", "the end of the recording")
    file = page.js("return " + said + ".match(/ (0000.*?lcm)/)[1]")
    assert os.listdir(records) == [file], (os.listdir(records), file)
    page.until(f"document.getElementById('recording-file').value === '{file}'", "the recording among those to download")
    page.driver.find_element(By.ID, "download-recording").click()
    page.await_file(file, os.path.getsize(os.path.join(records, file)))
    with open(os.path.join(records, file), "rb") as there, open(os.path.join(folder, file), "rb") as here_:
        assert there.read() == here_.read(), "what was downloaded is another file"
    done = subprocess.run([os.path.join(build, "fovea"), "replay", os.path.join(records, file), "--verify", "--trust-state"],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "equal bit for bit" in done.stdout, done


def check_widths(page):
    keep = os.environ.get("FOVEA_SCREENSHOTS")
    page.js("for (const group of document.getElementById('keys').children) group.open = group.textContent.startsWith('features')")
    for width, height in ((1440, 1000), (360, 800)):
        page.size(width, height)
        page.until("document.documentElement.scrollWidth <= innerWidth", f"nothing beyond {width} pixels")
        before = page.js("return fovea.live.picture.number")
        page.until(f"fovea.live.picture.number > {before + 3}", "pictures at another size")
        full = page.js("return document.documentElement.scrollHeight")
        page.size(width, full)
        time.sleep(0.5)
        shot = os.path.join(keep or folder, f"page-{width}.png")
        assert page.driver.save_screenshot(shot) and os.path.getsize(shot) > 20000
    page.size(1440, 1000)


def check_announced():
    """What avahi-daemon would announce is this page at its port, and well-formed."""
    group = ElementTree.parse(os.path.join(here, "..", "..", "tools", "service", "fovea-web.avahi")).getroot()
    assert group.tag == "service-group" and [service.findtext("type") for service in group.findall("service")] == ["_fovea._tcp"]
    assert f":{group.findtext('service/port')}/" in ADDRESS, "the port of a page without options"


def check_login(token):
    """By the name of a host, as from another one: the page says that it is not encrypted."""
    page = Page()
    try:
        page.driver.get(ADDRESS)
        assert not page.driver.find_element(By.ID, "readable").is_displayed()
        page.driver.get(ADDRESS.replace("127.0.0.1", "robot.local"))
        page.until("!document.getElementById('readable').hidden", "a word that the token can be read")
        with open(token, encoding="ascii") as file:
            view = file.read().split()[1]
        page.driver.find_element(By.ID, "token").send_keys(view + Keys.ENTER)
        page.until("globalThis.fovea && fovea.live.picture", "a picture after the login")
        assert page.driver.find_element(By.ID, "readable").is_displayed()
        assert page.js("return document.cookie") == "" and view not in page.driver.current_url
        assert page.driver.find_element(By.CSS_SELECTOR, "[data-command=pause]").get_property("disabled")
        assert page.driver.find_element(By.CSS_SELECTOR, "[data-command=record]").get_property("disabled")
        assert page.driver.find_element(By.ID, "back-up").get_property("disabled")
        answer = page.driver.execute_async_script("const done = arguments[0]; fetch('/settings', { method: 'POST', body: '\\n' })"
                                                  ".then(async (answer) => done([answer.status, await answer.text()]))")
        assert answer == [403, "this token may only look"], answer
        wrong = [entry for entry in page.driver.get_log("browser") if entry["level"] == "SEVERE" and not re.search(" 40[13] ", entry["message"])]
        assert not wrong, wrong  # but for what was to be refused
    finally:
        page.close()


def await_frames(recording, count):
    until = time.monotonic() + PATIENCE_S
    while os.path.getsize(recording) < count * 640 * 480:
        assert time.monotonic() < until, "the recording does not grow"
        time.sleep(0.1)


def check_playback(recording):
    """A recording on the same page: its own frames at the right positions, paused, at another speed, to its end; cut off, up to there."""
    with open(recording, "rb") as file:
        data = file.read()
    os.chmod(recording, 0o444)
    times = [time_us for _, time_us, channel, _ in reader().events(recording) if channel.endswith("_FRAME")]
    server, page = web("--play", recording), None
    try:
        until_served()
        page = Page()
        page.driver.get(ADDRESS)
        shown = "fovea.live.picture.sequence"
        page.until("globalThis.fovea && fovea.live.picture && fovea.live.picture.points.length > 300", "a picture of the recording")
        assert page.text("link") == "recording" and page.js("return document.getElementById('actions').hidden")
        first = page.js("return " + shown)
        page.until(f"{shown} > {first + 5}", "pictures that follow")
        page.until("document.getElementById('state').dataset.state === 'tracking'", "the recorded pose")
        page.driver.find_element(By.ID, "play").click()
        page.until("document.getElementById('play').textContent === 'Play'", "the pause")
        still = page.js("return " + shown)

        def seek(place):
            page.js("const slider = document.getElementById('position'); slider.value = arguments[0];"
                    "slider.dispatchEvent(new Event('change'))", (times[place] - times[0]) // 1000 + 1)

        for place in (40, 10):  # forwards and back; sequences count from 0 here
            seek(place)
            page.until(f"{shown} === {place}", f"frame {place} while paused")
        time.sleep(0.5)
        assert page.js("return " + shown) == 10 and still != 10
        page.js("const speed = document.getElementById('speed'); speed.value = '8'; speed.dispatchEvent(new Event('change'))")

        def seconds_to_the_end():
            begin = time.monotonic()
            page.driver.find_element(By.ID, "play").click()
            page.until("document.getElementById('play').textContent === 'Play' && document.getElementById('position').value"
                       " === document.getElementById('position').max", "the end of the recording")
            return time.monotonic() - begin

        for _ in range(20):  # one time is enough, while other programs use the processor
            if seconds_to_the_end() < (times[-1] - times[10]) * 1e-6:
                break
            seek(10)
            page.until(f"{shown} === 10", "frame 10 again")
        else:
            raise SystemExit("web_page.py: not faster at 8 times the speed")
        check_accessible(page)
        check_console(page)
        if os.environ.get("FOVEA_SCREENSHOTS"):
            page.driver.save_screenshot(os.path.join(os.environ["FOVEA_SCREENSHOTS"], "page-playback.png"))
        page.close()
        end(server)
        with open(recording, "rb") as file:
            assert file.read() == data
        cut = os.path.join(folder, "cut.lcm")
        with open(cut, "wb") as file:
            file.write(data[:len(data) * 2 // 3])
        server = begin([os.path.join(build, "fovea-web"), "--play", cut], stderr=subprocess.PIPE, text=True)
        lines = [server.stderr.readline() for _ in range(2)]
        assert lines[0].startswith("fovea-web: " + cut + ": byte ") and lines[0].endswith("; it is played up to there\n"), lines
        end(server)
        with open(cut, "wb") as file:
            file.write(data[:1000])
        done = subprocess.run([os.path.join(build, "fovea-web"), "--play", cut], capture_output=True, text=True, check=False)
        assert done.returncode == 2 and done.stderr.startswith("fovea-web: " + cut + ": byte ") and done.stderr.count("\n") == 1, done
    finally:
        server.kill()


def main():
    recording, shorter = (os.path.join(folder, name) for name in ("run.lcm", "again.lcm"))
    kept, records, maps = (os.path.join(folder, name) for name in ("kept.yaml", "records", "maps"))
    os.mkdir(maps)
    robot = run("--set", "record_folder=" + records, "--record", recording, "--save-map", os.path.join(maps, "map"), "--set", "map.folder=" + maps, "--set", "parameters.file=" + kept)
    server = web("--recordings", records)
    page = Page()
    try:
        until_served()
        page.driver.get("about:blank")
        page.driver.get_log("performance")  # of the browser's own first page
        page.size(1440, TALL)
        page.driver.get(ADDRESS)
        page.until("globalThis.fovea && fovea.space && performance.getEntriesByName('plots drawn').length", "the page")
        check_picture(page)
        check_load(page)
        check_in_view(page)
        check_again(page)
        check_health(page)
        check_announced()
        found = check_box(page)
        check_path(page)
        check_hands(page)
        check_layers(page)
        check_commands(page)  # while the map is small: the camera is found in it sooner
        check_parameters(page, kept)
        check_settings(page, kept)
        check_recording(page, records)
        check_plots(page)
        check_widths(page)
        check_accessible(page)
        check_console(page)
        end(robot)
        page.until("document.getElementById('link').textContent === 'no run'", "the end of the run")
        check_against_recording(found, recording)
        robot = run("--record", shorter)
        page.until("document.getElementById('link').textContent === 'live' && document.getElementById('state').dataset.state === 'tracking'",
                   "the run that began again")
        first = page.until("fovea.live.picture && fovea.live.picture.number", "a picture of the run that began again")
        page.until(f"fovea.live.picture.number > {first + 5}", "pictures of the run that began again")
        check_console(page)
        page.close()
        end(server)
        token = os.path.join(folder, "token")
        server = web("--token", token, "--name", "robot.local")
        until_served()
        check_login(token)
        await_frames(shorter, 50)
        end(robot)
        end(server)
        check_playback(shorter)
        check_robots()
    finally:
        Page.quit()


main()
