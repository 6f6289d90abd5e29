"""Several robots on one page, and a light that blinks. Used by web_page.py."""
import json
import os
import subprocess

from selenium.webdriver.common.by import By
from web_browser import ADDRESS, Page, begin, build, check_accessible, check_box, check_console, end, folder, module, run, until_served, web


def check_blinks(page):
    """A light that blinks is seen on the canvas, dark and light in turns, and the latency shown holds the 5 ms that its frames take to come."""
    page.until("fovea.live.picture && fovea.live.picture.width === 640", "a picture of the light")
    page.js(module("..", "campaign", "blinks").WATCH)
    seen = page.until("seen.length >= 4 && seen", "blinks of the light")
    assert all(a[1] != b[1] and a[0] < b[0] for a, b in zip(seen, seen[1:])) and all(5 <= said < 60_000 for _, _, said, *_ in seen), seen


def check_cameras(page):
    """Two of them, of which the second shows another picture."""
    before = page.until("document.getElementById('camera-choice').options.length === 2 && fovea.live.picture && fovea.live.context.getImageData(0, 0, 320, 60).data.join()",
                        "a picture of the first camera")
    page.js("const choice = document.getElementById('camera-choice'); choice.selectedIndex = 1; choice.dispatchEvent(new Event('change'))")
    page.until("fovea.live.camera === 1 && fovea.live.picture && fovea.live.context.getImageData(0, 0, 320, 60).data.join()"
               f" !== {json.dumps(before)}", "a picture of the second camera")


def check_robots():
    """Several robots on one page: one of this host with its frames, which alone is paused; two that are heard over LCM by previews at the
    size of their frames, of all cameras that send them, and a word that this is all; one that is silent."""
    small = os.path.join(folder, "small.sock")

    def small_run(more):
        return begin([os.path.join(build, "fovea"), "run", "--source", "sim:orbit?frames=1000000&rate=5&width=320&height=240" + more, "--rate",
                                 "real", "--quiet", "--picture", "none", "--set", "channel_prefix=SMALL", "--set", "web.socket=" + small, "--set", "features.count_max=500", "--set", "preview.cameras=4", "--set", "preview.period_frames=2", "--set", "preview.level=0"])

    robots = [run("--set", "preview.level=1", "--set", "preview.period_frames=3"), small_run("&baseline=0.1")]
    blink = os.path.join(folder, "light.sock")
    robots.append(begin([os.path.join(build, "tests", "campaign", "blinks"), blink], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL))
    server = web("--feed", os.path.join(folder, "feed"), "--feed", small, "--feed", blink, "--lcm", "udpm://239.255.76.67:7667", "--prefix", "FOVEA",
                 "--prefix", "SILENT", "--prefix", "SMALL")
    until_served()
    page = Page()
    page.driver.get(ADDRESS)
    said = "[...document.getElementById('robot-choice').options].map((option) => option.text).join(', ')"
    page.until(f"globalThis.fovea && {said} === 'feed: tracking, small: tracking, light: no pose yet, FOVEA: tracking, SILENT: no run, SMALL: tracking'", "what the robots do")

    def choose(name):
        page.js("const choice = document.getElementById('robot-choice'), wanted = arguments[0] + ':';"
                "choice.selectedIndex = [...choice.options].findIndex((option) => option.text.startsWith(wanted));"
                "choice.dispatchEvent(new Event('change'))", name)

    page.until("fovea.live.picture && fovea.live.picture.width === 640", "a picture of the first robot")
    choose("small")
    page.until("fovea.live.picture && fovea.live.picture.width === 320", "a picture of the second robot")
    page.driver.find_element(By.CSS_SELECTOR, "[data-command=pause]").click()
    page.until("document.getElementById('answer').textContent === 'pause: done'", "the answer of the second robot")
    page.until(f"{said} === 'feed: tracking, small: paused, light: no pose yet, FOVEA: tracking, SILENT: no run, SMALL: paused'", "the pause of the second robot alone")
    check_cameras(page)
    page.driver.find_element(By.CSS_SELECTOR, "[data-command=resume]").click()
    page.until("document.getElementById('answer').textContent === 'resume: done'", "that the second robot goes on")
    choose("SMALL")
    page.until("document.getElementById('link').textContent === 'live, preview rate only' && fovea.live.picture && fovea.live.picture.width === 320",
               "a preview of the second robot")
    check_cameras(page)
    choose("small")
    page.until("document.getElementById('link').textContent === 'live' && fovea.live.picture", "the frames of the second robot again")
    check_accessible(page)
    end(robots[1])
    robots[1] = small_run("")
    page.until("document.getElementById('camera-choice').hidden && fovea.live.camera === 0 && fovea.live.picture",
               "a picture of the one camera that the next run has")
    choose("light")
    check_blinks(page)
    choose("FOVEA")
    page.until("document.getElementById('link').textContent === 'live, preview rate only' && fovea.live.picture"
               " && document.getElementById('state').dataset.state === 'tracking'", "a preview")
    assert page.js("return fovea.live.picture.width === 640 && fovea.live.picture.height === 480")
    first = page.js("return fovea.live.picture.sequence")
    page.until(f"fovea.live.picture.sequence > {first + 6}", "previews that follow")
    found = check_box(page)
    assert found["box"]["x_max_px"] <= 640
    assert page.js("return document.getElementById('actions').hidden")
    assert page.driver.current_url == ADDRESS + "#robot=FOVEA"
    page.driver.refresh()
    page.until("globalThis.fovea && document.getElementById('link').textContent === 'live, preview rate only'", "the same robot again")
    if os.environ.get("FOVEA_SCREENSHOTS"):
        page.js("scrollTo(0, 0)")
        page.driver.save_screenshot(os.path.join(os.environ["FOVEA_SCREENSHOTS"], "page-robots.png"))
    choose("SILENT")
    page.until("document.getElementById('link').textContent === 'no run'", "the silent robot")
    choose("FOVEA")
    end(robots[0])
    page.until("document.getElementById('link').textContent === 'no run'", "the silence of the robot")
    check_console(page)
    page.close()
    end(robots[1])
    end(server)
