"""The page of fovea-calibrate camera in a headless Chromium, from the first picture to the verdict, with a simulated board. Used by
test_web_calibrate.

Usage: calibrate_page.py BUILD FOLDER     FOVEA_SCREENSHOTS=DIR keeps screenshots at 360 and 1,440 pixels of width
"""
import os
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

build, folder = sys.argv[1:3]
PATIENCE_S = 600  # other programs may use the processor


def browser():
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--no-proxy-server",
                 "--disable-background-networking", "--disable-component-update", "--host-resolver-rules=MAP robot.two 127.0.0.1", "--user-data-dir=" + os.path.join(folder, "profile")):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    made = webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))
    made.command_executor.client_config.timeout = 700  # a step of the page may take long while others use the processor
    made.set_script_timeout(600)
    made.set_page_load_timeout(600)
    return made


def until(driver, text, what):
    """Wait until an expression is true, and return it."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        found = driver.execute_script("return " + text)
        if found:
            return found
        time.sleep(0.1)
    raise SystemExit(f"calibrate_page.py: {what}: not within {PATIENCE_S} s; log: {driver.get_log('browser')[:5]}")


def screenshot(driver, name):
    to = os.environ.get("FOVEA_SCREENSHOTS")
    if to:
        for width in (360, 1440):
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500})
            wide = driver.execute_script("return document.documentElement.scrollWidth")
            assert wide <= width, f"{wide} pixels wide at {width}"
            time.sleep(0.5)
            driver.save_screenshot(os.path.join(to, f"calibrate-{name}-{width}.png"))


def text(driver, name):
    return driver.execute_script("return document.getElementById(arguments[0]).textContent", name)


def status_of(address, host):
    request = urllib.request.Request(address + "state.json", headers={"Host": host})
    try:
        return urllib.request.urlopen(request, timeout=PATIENCE_S).status
    except urllib.error.HTTPError as error:
        return error.code


def start(out):
    """Calibrate, and return the process and the address of its page. It prints to a pipe, all into one."""
    words = [os.path.join(build, "fovea-calibrate"), "camera", "--source", "sim:board?rate=4&seed=4&width=320&height=240", "--target", "chessboard:9x6:0.03",
             "--model", "radtan", "--page", "0", "--out", os.path.join(folder, out)]
    process = subprocess.Popen(words, stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True)
    started.append(process)
    found = re.search(r"http://127\.0\.0\.1:\d+/", process.stdout.readline())
    assert found, "the address of the page"
    return process, found.group(0)


def keep(address, until_set):
    """Look at the page until the browser is done with it: however long it takes to start, the page stays."""
    while not until_set.wait(1):
        try:
            status_of(address, address[7:-1])
        except OSError:
            return


def until_served(address):
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        try:
            return status_of(address, address[7:-1])
        except OSError:
            time.sleep(0.1)
    raise SystemExit("calibrate_page.py: nothing is served at " + address)


def camera_file(name):
    with open(os.path.join(folder, name), encoding="utf-8") as file:
        return file.read()


def interrupt_while_it_waits():
    """Ctrl-C while somebody looks at the verdict, without which the page stays: the verdict is printed, and the exit status is that of the verdict."""
    process, address = start("alone.yaml")
    threading.Thread(target=keep, args=(address, threading.Event()), daemon=True).start()
    said = ""
    while "page: it ends" not in said:
        line = process.stdout.readline()
        assert line, "it ended before: " + said
        said += line
    process.send_signal(signal.SIGINT)
    said += process.communicate(timeout=PATIENCE_S)[0]
    assert process.returncode == 0, process.returncode
    assert re.search(r"^verdict +pass", said, re.MULTILINE), said
    assert "camera_matrix" in camera_file("alone.yaml")


def follow_in_a_browser(driver):
    """From any time on to the verdict; what is printed has the instructions from the first on."""
    process, address = start("camera.yaml")
    done = threading.Event()
    threading.Thread(target=keep, args=(address, done), daemon=True).start()
    try:
        driver.get(address)
        until(driver, "document.getElementById('picture').naturalWidth > 0", "a picture")
        until(driver, "/^[1-9][0-9]* of at most 40$/.test(document.getElementById('pictures').textContent)", "a picture that is taken")
        painted = "(() => { const c = document.getElementById('coverage'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; " \
                  "let n = 0; for (let i = 2; i < d.length; i += 4) n += d[i] > 240; return n > 100; })()"
        until(driver, painted, "the coverage")
        screenshot(driver, "looking")
        assert status_of(address, "evil.example") == 403, "another Host is refused"
        assert status_of(address, address[7:-1]) == 200
        grade = until(driver, "!document.getElementById('verdict-section').hidden && document.getElementById('verdict').textContent", "a verdict")
        assert grade == "pass", grade
        assert text(driver, "next") == "done: the verdict is pass", text(driver, "next")
        assert "fx" in text(driver, "parameters") and "RMS" in text(driver, "parameters"), text(driver, "parameters")
        assert re.fullmatch(r"± 0\.0\d\d %", text(driver, "focal")), text(driver, "focal")
        screenshot(driver, "verdict")
        errors = [line for line in driver.get_log("browser") if line["level"] == "SEVERE"]
        assert not errors, errors
    finally:
        done.set()
        driver.get("about:blank")
    said = process.communicate(timeout=PATIENCE_S)[0]  # nobody looks any more
    assert process.returncode == 0, process.returncode
    instructions = re.findall(r"next: board to the (.* of the picture.* nearer to the camera.*)", said)
    assert len(set(instructions)) > 3, said
    assert "camera_matrix" in camera_file("camera.yaml")
    print("page: " + grade + ", " + instructions[0])


CAMERA = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [400, 0, 320, 0, 400, 240, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""


def start_run():
    """A run whose camera looks at a board, and its page, by the second of its names."""
    camera, feed = os.path.join(folder, "start.yaml"), os.path.join(folder, "feed")
    with open(camera, "w", encoding="utf-8") as file:
        file.write(CAMERA)
    started.append(subprocess.Popen([os.path.join(build, "fovea"), "run", "--source", "sim:board?rate=4&frames=1000000", "--rate", "real", "--quiet", "--picture", "none", "--set", "camera=" + camera, "--set", "web.socket=" + feed,
                                     "--set", "parameters.file=" + os.path.join(folder, "kept.yaml"), "--set", "odometry.enabled=false"]))
    os.mkdir(os.path.join(folder, "results"))
    process = subprocess.Popen([os.path.join(build, "fovea-web"), "--feed", feed, "--port", "0", "--calibrations", os.path.join(folder, "results"), "--name", "robot.one", "--name", "robot.two"],
                               stderr=subprocess.PIPE, text=True)
    started.append(process)
    return re.search(r"http://127\.0\.0\.1:\d+/", process.stderr.readline()).group(0).replace("127.0.0.1", "robot.two")


def begin(driver, live):
    """Press the button of the live page; the address that it leads to."""
    driver.get(live)
    until(driver, "!document.getElementById('calibration').hidden && !document.getElementById('calibrate').disabled", "the button")
    said = "document.getElementById('calibration-said')"
    driver.execute_script("document.getElementById('board').value = '--out'")
    driver.execute_script("document.getElementById('calibrate').click()")
    until(driver, said + ".textContent === 'refused: found no board, expected one as chessboard:9x6:0.025'", "the refusal of what is no board")
    errors = [line for line in driver.get_log("browser") if line["level"] == "SEVERE"]
    assert len(errors) == 1 and "409" in errors[0]["message"], errors  # the refusal
    driver.execute_script("document.getElementById('board').value = 'chessboard:9x6:0.03'")
    driver.execute_script("document.getElementById('calibrate').click()")
    return until(driver, said + ".textContent.startsWith('goes on: ') && " + said + ".querySelector('a').href", "the address of the calibration")


def result_of_process():
    """The file that the one process of fovea-calibrate is to make."""
    for process in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{process}/cmdline", encoding="utf-8") as file:
                words = file.read().split("\0")
        except OSError:
            continue
        if words[0].endswith("/fovea-calibrate") and "--out" in words:
            return words[words.index("--out") + 1]
    raise SystemExit("calibrate_page.py: no process of fovea-calibrate")


def from_the_page_of_a_run(driver):
    """Begun and ended there, and its result to the run. How far it comes is the machine's matter: the result is this test's."""
    live = start_run()
    address = begin(driver, live)
    until_served(address.replace("robot.two", "127.0.0.1"))
    path = result_of_process()
    assert os.path.dirname(path) == os.path.join(folder, "results"), path
    driver.get(address)
    until(driver, "document.getElementById('picture').naturalWidth > 0", "a picture of the run")
    driver.get(live)
    until(driver, "!document.getElementById('end-calibration').disabled", "the button for the end")
    driver.execute_script("document.getElementById('end-calibration').click()")
    said = "document.getElementById('calibration-said').textContent"
    until(driver, said + ".startsWith('ended with status ') || " + said + ".startsWith('made ')", "the end of the calibration")
    with open(path, "w", encoding="utf-8") as file:
        file.write(CAMERA.replace("400", "401"))
    driver.get(live)
    until(driver, "!document.getElementById('use-calibration').disabled", "the result")
    driver.execute_script("document.getElementById('use-calibration').click()")
    answer = until(driver, "(" + said + ".match(/^(?!made ).+/) || [])[0]", "the answer of the run")
    assert answer == os.path.basename(path) + ": 0 took hold, 0 and the calibration with the next start", answer
    with open(os.path.join(folder, "kept.yaml"), encoding="utf-8") as file:
        assert "401" in file.read().split("---\n")[1]
    errors = [line for line in driver.get_log("browser") if line["level"] == "SEVERE"]
    assert not errors, errors


def main():
    driver = None
    try:
        interrupt_while_it_waits()
        driver = browser()
        follow_in_a_browser(driver)
        from_the_page_of_a_run(driver)
    finally:
        if driver is not None:
            driver.quit()
        for one in started:
            one.kill()
            one.wait()


started = []
main()
