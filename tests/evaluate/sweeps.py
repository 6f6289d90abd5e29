#!/usr/bin/env python3
"""tools/evaluate as its users call it: sweeps of a few simulated runs, interrupted, resumed, with a worker killed, two versions side by side.
Needs the Python of build/venv-sweep and build/fovea; half a minute.

Usage: tests/evaluate/sweeps.py
"""
import glob
import os
import signal
import stat
import subprocess
import sys
import tempfile
import threading
import time
import unittest

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))
TOOL = os.path.join(ROOT, "tools", "evaluate")
sys.path[:0] = [TOOL, os.path.join(ROOT, "tools")]
FOVEA = os.path.abspath(os.path.join(os.environ.get("BUILD", os.path.join(ROOT, "build")), "fovea"))
SOURCE = "sim:orbit?width=320&height=240&objects=0&seed={1..2}"
TIMES = ("wall_s", "mean_ms", "p99_ms", "resident_mib", "part", "version")

import execute  # noqa: E402
import one  # noqa: E402
import plan  # noqa: E402
import store  # noqa: E402


def command(*words):
    return [sys.executable, TOOL, *words]


def call(*words):
    return subprocess.run(command(*words), capture_output=True, text=True, timeout=300)


def sweep(folder, *more, workers="0"):
    return call("sweep", folder, "--source", SOURCE, "--frames", "30", "--starts", "0,4", "--binary", f"first={FOVEA}", "--workers", workers, *more)


def contents(folder):
    """Rows of all tables without what may differ, as text: unknown numbers are equal there."""
    db = store.read(folder)
    found = {}
    for name, schema in store.TABLES.items():
        columns = ", ".join(f'"{field.name}"' for field in schema if field.name not in TIMES)
        found[name] = repr(db.execute(f"SELECT {columns} FROM {name} ORDER BY ALL").fetchall())
    return found


def specs(frames):
    binary = {"label": "first", "path": FOVEA, "hash": one.hash_file(FOVEA), "plugins": os.path.dirname(FOVEA)}
    return plan.specs([binary], [SOURCE], "0-5", frames=str(frames))


def program(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR)
    return path


class Sweeps(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.folder = os.path.join(self.place.name, "results")
        self.addCleanup(self.place.cleanup)

    def kept(self, specs, workers, started=None):
        results = store.Store(self.folder)
        failed = []
        execute.all_of(specs, workers, None, lambda spec, result, error: failed.append(error) if error else results.add(result), started)
        results.flush()
        self.assertEqual(failed, [])

    def test_runs_that_are_there_are_not_made_again(self):
        first = sweep(self.folder)
        self.assertEqual(first.returncode, 0, first.stderr)
        self.assertIn("sweep: 4 runs, 0 of them there", first.stderr)
        self.assertIn("| sim:orbit?width=320&height=240&objects=0&seed=* | first | 4 (0) | 4 |", first.stdout)
        before = contents(self.folder)
        again = sweep(self.folder, "--starts", "0,4,6")
        self.assertIn("sweep: 6 runs, 4 of them there", again.stderr)
        self.assertEqual(len(store.known(self.folder)), 6)
        # A part without its runs, as an interruption leaves it, counts for nothing.
        for path in glob.glob(os.path.join(self.folder, "runs", "*.parquet")):
            os.remove(path)
        third = sweep(self.folder)
        self.assertIn("sweep: 4 runs, 0 of them there", third.stderr)
        self.assertEqual(contents(self.folder), before)

    def test_what_is_asked_for_twice_is_made_once(self):
        twice = sweep(self.folder, "--starts", "0-2,1-3", workers="1")
        self.assertEqual(twice.returncode, 0, twice.stderr)
        self.assertIn("sweep: 8 runs, 0 of them there", twice.stderr)
        self.assertEqual(len(store.known(self.folder)), 8)

    def test_results_of_another_binary_are_never_taken(self):
        sweep(self.folder)
        other = os.path.join(self.place.name, "other")
        with open(FOVEA, "rb") as file:
            program(other, "")
            with open(other, "wb") as out:
                out.write(file.read() + b"\0")
        second = sweep(self.folder, "--binary", f"second={other}")
        self.assertIn("sweep: 8 runs, 4 of them there", second.stderr)
        report = call("report", self.folder, "--compare", "first", "second", "--pictures", "0")
        self.assertEqual(report.returncode, 0, report.stderr)
        with open(report.stdout.strip(), encoding="utf-8") as file:
            self.assertIn("4 runs of both, 4 with the same bits", file.read())

    def test_a_change_is_named_by_its_first_frame(self):
        # A version that takes no features in half of each picture.
        mask = os.path.join(self.place.name, "mask.png")
        with open(mask, "wb") as file:
            file.write(one.png(320, 240, [b"\xff" * 160 + bytes(160)] * 240))
        other = program(os.path.join(self.place.name, "other"), f'#!/bin/sh\nexec {FOVEA} "$@" --set mask={mask}\n')
        self.assertEqual(sweep(self.folder, "--binary", f"second={other}", "--starts", "0").returncode, 0)
        report = call("report", self.folder, "--compare", "first", "second", "--pictures", "1", "--worst", "2")
        self.assertEqual(report.returncode, 0, report.stderr)
        with open(report.stdout.strip(), encoding="utf-8") as file:
            text = file.read()
        self.assertIn("2 runs of both, 0 with the same bits", text)
        db = store.read(self.folder)
        frames = {version: db.execute("SELECT f.frame, f.digest FROM frames f JOIN runs r USING (run) WHERE version = ? AND source LIKE '%seed=1' ORDER BY i",
                                      [version]).fetchall() for version in ("first", "second")}
        differing = next(a[0] for a, b in zip(frames["first"], frames["second"]) if a != b)
        self.assertIn(f"start 0, step 1, 30 frames: first differing frame {differing}<", text)
        self.assertIn("data:image/png;base64,", text)
        wrong = call("report", self.folder, "--compare", "first", "third")
        self.assertEqual(wrong.returncode, 2)
        self.assertRegex(wrong.stderr, r"^tools/evaluate: --compare: found 0 versions 'third', expected one of first \([0-9a-f]{12}\), second .*\n$")

    def test_a_killed_worker_changes_nothing_but_times(self):
        self.kept(specs(60), 0)
        alone = contents(self.folder)
        self.folder += "-killed"
        killed = []

        def started(client):
            def kill():
                time.sleep(0.7)  # the first runs are under way
                process = list(client.run(os.getpid).values())[0]
                os.kill(process, signal.SIGKILL)
                killed.append(process)
            threading.Thread(target=kill, daemon=True).start()

        self.kept(specs(60), 2, started)
        self.assertEqual(len(killed), 1)
        self.assertEqual(contents(self.folder), alone)

    def test_an_interrupted_sweep_goes_on(self):
        words = ("sweep", self.folder, "--source", SOURCE, "--frames", "30", "--binary", FOVEA)
        running = subprocess.Popen(command(*words, "--starts", "0-499", "--workers", "2"), stderr=subprocess.PIPE, text=True, start_new_session=True)
        self.assertIn("1000 runs, 0 of them there", running.stderr.readline())
        end = time.monotonic() + 120
        while not glob.glob(os.path.join(self.folder, "runs", "*.parquet")) and time.monotonic() < end:
            time.sleep(0.1)
        os.killpg(running.pid, signal.SIGINT)
        self.assertIn("the same command goes on from here", running.communicate(timeout=60)[1])
        self.assertEqual(running.returncode, 130)
        there = len(store.known(self.folder))
        self.assertLess(there, 1000)
        self.assertGreater(there, 0)
        again = call(*words, "--workers", "0")
        self.assertIn("2 runs, 1 of them there", again.stderr)  # the first run was among the first results, the 501st was not
        self.assertEqual(len(store.known(self.folder)), there + 1)

    def test_wrong_words_are_one_line(self):
        for words, expected in ((("sweep", self.folder, "--source", "sim:", "--starts", "x"), "--starts: found 'x'"),
                                (("sweep", self.folder, "--source", "sim:", "--binary", "/none"), "--binary: /none: found no program"),
                                (("report", self.folder), "found no results")):
            done = call(*words)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertIn(expected, done.stderr)


if __name__ == "__main__":
    unittest.main()
