#!/usr/bin/env python3
"""What browsers cost the loop: nothing in its results, and how many instructions.

Usage: browsers.py BUILD [FRAMES]
The same run three times: without a page, with one that a headless Chromium looks at, and with twenty pages more (tools/web_load.py). Their
recordings must be the same, frame by frame (fovea compare). Then the instructions of each iteration of the loop, counted by callgrind, in three runs
of FRAMES frames (60), without the Chromium: every frame is copied there, since a run under callgrind is slow, where at 30 Hz and 15 pictures a second one of two is.
The second half of the frames is compared, in which fovea-web has surely found the run: when it does so is chance, and until then it costs nothing.
Exit 0: the same bits; at most 2 % more instructions with the page, and none more for each browser (5 in a million for times, whose digits differ).
"""
import os
import re
import subprocess
import sys
import tempfile
import time

here = os.path.dirname(os.path.abspath(__file__))
sys.path.append(os.path.join(here, "..", "common"))
from chromium import browser  # noqa: E402

PORT = 7687


class Lookers:
    """fovea-web with so many pages, of which the first is a Chromium's where there is to be one."""

    def __init__(self, build, folder, pages, chromium):
        self.processes, self.driver = [], None
        if pages == 0:
            return
        self.processes.append(subprocess.Popen([os.path.join(build, "fovea-web"), "--feed", os.path.join(folder, "feed"), "--lcm-url", "",
                                                "--port", str(PORT)], stderr=subprocess.DEVNULL))
        time.sleep(1)
        if chromium:
            self.driver = browser(folder)
            self.driver.get(f"http://127.0.0.1:{PORT}/")
            pages -= 1
        if pages > 0:
            self.processes.append(subprocess.Popen([sys.executable, os.path.join(here, "..", "..", "tools", "web_load.py"), "--port", str(PORT), "--pages",
                                                    str(pages), "--seconds", "100000", "--process", str(self.processes[0].pid)], stderr=subprocess.DEVNULL))
        time.sleep(1)

    def end(self):
        pictures = self.driver.execute_script("return fovea.live.picture ? fovea.live.picture.number : 0") if self.driver else 0
        if self.driver:
            self.driver.quit()
        for process in self.processes:
            process.terminate()
            process.wait()
        return pictures


def run(build, folder, pages, frames, chromium, before=(), more=()):
    """The run, with so many pages; how many pictures the Chromium was shown."""
    lookers = Lookers(build, folder, pages, chromium)
    try:
        subprocess.run([*before, os.path.join(build, "fovea"), "run", "--source", f"sim:orbit?frames={frames}", "--rate", "max", "--quiet", "--picture",
                        "none", "--set", "lcm_url=", "--set", "listen=none", *(("--set", "web.socket=" + os.path.join(folder, "feed")) if pages else ()),
                        *more], check=True)
        time.sleep(1)
    finally:
        pictures = lookers.end()
    assert pictures > 0 or not chromium, f"no picture on {pages} pages"
    return pictures


def instructions(build, folder, pages, frames):
    """Of each iteration of the loop."""
    inside = os.path.join(folder, f"counts.{pages}")
    os.mkdir(inside)
    run(build, folder, pages, frames, False, ("valgrind", "-q", "--fair-sched=yes", "--tool=callgrind", "--separate-threads=yes", "--toggle-collect=iteration", "--dump-before=iteration",
                                              "--callgrind-out-file=" + os.path.join(inside, "callgrind")))
    threads = {}
    for name in os.listdir(inside):
        _, part, thread = re.split("[.-]", name) if re.fullmatch(r"callgrind\.\d+-\d+", name) else ("", "", "")
        if part:
            with open(os.path.join(inside, name), encoding="utf-8") as file:
                threads.setdefault(thread, {})[int(part)] = sum(int(count) for count in re.findall(r"^totals: (\d+)", file.read(), re.MULTILINE))
    loop = max(threads.values(), key=lambda counts: sum(counts.values()))
    assert len(loop) == frames, f"{len(loop)} iterations of {frames}"
    return [loop[part] for part in sorted(loop)]


def main():
    build, frames = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 60
    with tempfile.TemporaryDirectory() as folder:
        files = {}
        for pages in (0, 1, 21):
            files[pages] = os.path.join(folder, f"{pages}.lcm")
            pictures = run(build, folder, pages, 400, pages > 0, (), ("--set", "lockstep_every=5", "--record", files[pages]))
            print(f"{pages} pages: 400 frames, {pictures} pictures", flush=True)
        same = [subprocess.run([os.path.join(build, "fovea"), "compare", files[0], files[pages]], capture_output=True, text=True, check=False)
                for pages in (1, 21)]
        for done in same:
            print(done.stdout.strip() or done.stderr.strip(), flush=True)
        counts = {pages: sum(instructions(build, folder, pages, frames)[frames // 2:]) for pages in (0, 1, 21)}
    page, each = counts[1] / counts[0] - 1, (counts[21] / counts[1] - 1) / 20
    print(f"instructions of the loop's last {frames - frames // 2} iterations: {counts[0]} without a page, {counts[1]} with one ({100 * page:.3f} % more), {counts[21]} with "
          f"twenty further browsers ({100 * each:.7f} % more for each)")
    return 0 if all(done.returncode == 0 for done in same) and page <= 0.02 and each <= 0.000005 else 1


sys.exit(main())
