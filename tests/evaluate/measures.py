#!/usr/bin/env python3
"""tools/evaluate: what is measured of a run, against cases whose answer is known, and two runs of fovea. Needs numpy and build/fovea.

Usage: tests/evaluate/measures.py
"""
import functools
import os
import shutil
import sys
import tempfile
import unittest

import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
sys.path.insert(0, os.path.join(ROOT, "tools", "evaluate"))
FOVEA = os.path.abspath(os.path.join(os.environ.get("BUILD", os.path.join(ROOT, "build")), "fovea"))

import faults  # noqa: E402
import metric  # noqa: E402
import metrics  # noqa: E402
import one  # noqa: E402
import plan  # noqa: E402
import reliability  # noqa: E402

RANDOM = np.random.default_rng(1)


def turn(vector):
    """Rotation by a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    K = metrics.skew(vector / angle)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def exponential(xi):
    """Motion of (rho, omega), by its series: another way than metrics.logarithm goes."""
    A = np.zeros((4, 4))
    A[:3, :3], A[:3, 3] = metrics.skew(xi[3:]), xi[:3]
    T = term = np.eye(4)
    for k in range(1, 25):
        term = term @ A / k
        T = T + term
        if np.abs(term).max() < 1e-20:
            break
    return T[:3, :3], T[:3, 3]


@functools.cache
def bend(n):
    """Places and orientations of n frames with 1 m steps."""
    angle = np.linspace(0, 1.5, n)
    return (np.stack([40 * np.sin(angle), 40 * (1 - np.cos(angle)), 0.3 * np.sin(5 * angle)], 1),
            np.array([turn(np.array([0, 0, a])) for a in angle]))


def drive(n=60, scale=0.25, maps=None):
    """A bend of n frames with 1 m steps, as odometry without errors would see it in a unit and world of its own per map."""
    truth, truth_R = (array.copy() for array in bend(n))
    maps = np.zeros(n, int) if maps is None else np.array(maps)
    position, R = np.zeros((n, 3)), np.zeros((n, 3, 3))
    for number in set(maps) - {-1}:
        W, shift, unit = turn(RANDOM.normal(size=3)), RANDOM.normal(size=3), scale * (1 + number)
        of = maps == number
        position[of] = unit * truth[of] @ W.T + shift
        R[of] = W @ truth_R[of]
    stamps = np.arange(n) * 100_000_000 + 5
    return {"metric": np.zeros(n, bool), "frame": np.arange(n) + 7, "stamp_ns": stamps, "state": np.where(maps < 0, 3, 1), "map": maps, "reset": np.zeros(n, int),
            "velocity": np.full((n, 3), np.nan), "velocity_covariance": np.full((n, 6, 6), np.nan), "gravity": np.full((n, 3), np.nan),
            "gravity_sigma": np.full(n, np.nan), "scale_sigma": np.full(n, np.nan),
            "quality": np.full(n, 0.5), "inliers": np.full(n, 90), "position": position, "R": R,
            "covariance": np.tile(np.diag([1e-4] * 3 + [1e-6] * 3), (n, 1, 1)), "keyframe": np.zeros(n, int), "keyframe_stamp_ns": np.zeros(n, int),
            "keyframe_position": np.zeros((n, 3)), "keyframe_R": np.tile(np.eye(3), (n, 1, 1)), "change_count": np.zeros(n, int),
            "change": [(1.0, np.eye(3), np.zeros(3))] * n, "has_truth": np.ones(n, bool), "truth_position": truth, "truth_R": truth_R,
            "final": np.full((n, 3), np.nan), "digest": np.arange(n)}


def stretch(run, j, i):
    """The unit of length of the way from pose j to pose i is another, which all links share."""
    way = run["position"][i] - run["position"][j]
    run["position"][i] = run["position"][j] + (1 + metrics.UNIT_SIGMA * RANDOM.normal()) * way


class Measures(unittest.TestCase):
    def test_logarithm_undoes_the_exponential(self):
        for length in (1e-9, 1e-3, 0.5, 2.5):
            xi = RANDOM.normal(size=6)
            xi[3:] *= length / np.linalg.norm(xi[3:])
            self.assertTrue(np.allclose(metrics.logarithm(*exponential(xi)), xi, atol=1e-9))

    def test_a_perfect_map_in_another_world_has_no_error(self):
        run = drive()
        run["final"] = 0.5 * run["position"] + [0, 0.1, 0] * (-1.0) ** np.arange(60)[:, None]
        row, = metrics.judge(run, "sim:")
        self.assertAlmostEqual(row["final_scale"], 8, delta=0.05)
        self.assertAlmostEqual(row["final_rmse_m"], 0.8, delta=0.01)
        self.assertAlmostEqual(row["rmse_m"], 0, places=9)
        self.assertAlmostEqual(row["scale"], 4, places=9)
        self.assertAlmostEqual(row["scale_ratio"], 1, places=9)
        self.assertAlmostEqual(row["step_ratio"], 1, places=9)
        self.assertAlmostEqual(row["rpe_m"], 0, places=9)
        self.assertAlmostEqual(row["path_m"], 60, delta=0.5)
        self.assertAlmostEqual(row["drift_percent_100m"], 0, places=6)
        self.assertTrue(row["good_error"] and row["good_scale"])

    def test_metres_are_judged_without_a_scale(self):
        run = drive(scale=1.02)
        run["metric"][:] = True
        row = metrics.judge(run, "sim:")[0]
        self.assertLess(row["rmse_m"], 1e-9)
        spread = metrics.root_mean_square(np.linalg.norm(run["truth_position"] - run["truth_position"].mean(0), axis=1))
        self.assertAlmostEqual(row["metric_rmse_m"], 0.02 * spread, delta=1e-6 * spread)
        self.assertAlmostEqual(row["metric_scale_percent"], 2, places=6)
        run["metric"][:] = False
        self.assertTrue(np.isnan(metrics.judge(drive(), "sim:")[0]["metric_rmse_m"]))

    def test_maps_are_never_put_together(self):
        maps = [0] * 25 + [-1] * 4 + [1] * 26 + [2] * 5
        rows = metrics.judge(drive(maps=maps), "sim:")
        self.assertEqual([row["map"] for row in rows], [0, 1])  # the third has too few poses
        self.assertEqual([row["poses"] for row in rows], [25, 26])
        self.assertEqual([row["first_frame"] for row in rows], [7, 36])
        for row in rows:
            self.assertAlmostEqual(row["rmse_m"], 0, places=9)

    def test_a_map_whose_steps_change_is_not_good(self):
        run = drive()
        run["position"][30:] = run["position"][29] + 5 * (run["position"][30:] - run["position"][29])
        row, = metrics.judge(run, "sim:")
        self.assertAlmostEqual(row["step_ratio"], 5, delta=0.05)
        self.assertGreater(row["scale_ratio"], 4.9)
        self.assertFalse(row["good_scale"] or row["good_error"])

    def test_drift_of_scale_is_measured_per_100_m(self):
        run = drive()
        steps = np.diff(run["truth_position"], axis=0)
        way = np.concatenate([[0], np.cumsum(np.linalg.norm(steps, axis=1))])
        factor = 1.1 ** ((way[1:] + way[:-1]) / 200)  # 10 % per 100 m
        run["position"] = np.concatenate([np.zeros((1, 3)), np.cumsum(steps * factor[:, None], axis=0)])
        run["R"] = run["truth_R"].copy()
        row, = metrics.judge(run, "sim:")
        self.assertAlmostEqual(row["drift_percent_100m"], 10, delta=0.3)

    def test_the_truth_has_an_error_of_its_own(self):
        def good(source):
            run = drive(200)
            run = {name: values[:13] for name, values in run.items()}  # 4 m: 1.5 % are 6 cm
            run["position"][:, 2] += 0.25 * 0.085 * (-1.0) ** np.arange(13)
            return bool(metrics.judge(run, source)[0]["good_error"])
        self.assertEqual(metrics.truth_error_m("sim:orbit"), 0)
        self.assertEqual(metrics.truth_error_m("fault:kitti:/x?kind=blur"), 0.05)
        self.assertEqual([good("sim:orbit"), good("kitti:/x")], [False, True])

    def test_a_change_of_unit_within_a_map_is_undone(self):
        run = drive()
        s, W, t = 3.0, turn(np.array([0.3, -0.2, 0.1])), np.array([1.0, 2, 3])
        run["position"][30:] = s * run["position"][30:] @ W.T + t
        run["R"][30:] = W @ run["R"][30:]
        run["change_count"][30:] = 1
        run["change"][30:] = [(s, W, t)] * 30
        row, = metrics.judge(run, "sim:")
        self.assertAlmostEqual(row["rmse_m"], 0, places=9)
        self.assertTrue(np.allclose(run["R"], W @ (W.T @ run["R"])))
        self.assertTrue(np.allclose(run["covariance"][0, :3, :3], 9e-4 * np.eye(3)))

    def test_stated_covariance_that_is_right_gives_a_nees_of_1(self):
        many = []
        for _ in range(60):
            run = drive(40)
            half = np.diag([3e-3, 1e-3, 2e-3, 1e-3, 2e-3, 5e-4])
            run["covariance"][:] = half @ half.T
            run["keyframe_stamp_ns"][:] = run["stamp_ns"][0]
            for i in range(40):
                R, t = metrics.relative(run["truth_R"][0], run["truth_position"][0], run["truth_R"][i], run["truth_position"][i])
                E, e = exponential(-half @ RANDOM.normal(size=6))  # T_true = T exp(error)
                t = 0.25 * t
                run["keyframe_R"][i], run["keyframe_position"][i] = R @ E, t + R @ e
            many.append(metrics.judge(run, "sim:")[0])
        self.assertAlmostEqual(np.mean([row["nees6_keyframe"] for row in many]), 1, delta=0.06)
        self.assertLess(np.mean([row["outside_keyframe"] for row in many]), 0.004)

    def test_motion_since_earlier_uses_both_covariances(self):
        values = []
        for _ in range(200):
            run = drive(52)
            half = np.diag([3e-3, 1e-3, 2e-3, 1e-3, 2e-3, 5e-4])
            run["covariance"][:] = half @ half.T
            stretch(run, 0, 50)
            for i in (0, 50):
                E, e = exponential(-half @ RANDOM.normal(size=6))
                run["position"][i] = run["position"][i] + run["R"][i] @ e
                run["R"][i] = run["R"][i] @ E
            values.append(metrics.against_earlier(run, 0, 50, 4.0, np.zeros(52, bool))[2] / 6)
        self.assertAlmostEqual(np.mean(values), 1, delta=0.13)

    def test_keyframes_in_between_are_links_of_a_chain(self):
        values = []
        for _ in range(200):
            run, links = drive(52), np.zeros(52, bool)
            links[5::5] = True
            half = np.diag([3e-3, 1e-3, 2e-3, 1e-3, 2e-3, 5e-4])
            run["covariance"][:] = half @ half.T
            drift = np.eye(3), np.zeros(3)  # what the map has bent since frame 0
            for k in range(1, 51):
                R, t = metrics.relative(run["R"][0], run["position"][0], run["R"][k], run["position"][k])
                E, e = exponential(-half @ RANDOM.normal(size=6)) if links[k] else (np.eye(3), np.zeros(3))
                if links[k]:  # T_true = T exp(error): all that follows moves with the keyframe
                    D, d = R @ E @ R.T, t + R @ e - R @ E @ R.T @ t
                    drift = D @ drift[0], D @ drift[1] + d
            R, t = metrics.relative(run["R"][0], run["position"][0], run["R"][50], run["position"][50])
            R, t = drift[0] @ R, drift[0] @ t + drift[1]
            run["R"][50], run["position"][50] = run["R"][0] @ R, run["position"][0] + run["R"][0] @ t
            stretch(run, 0, 50)
            links[0] = True  # frame 50 is a keyframe, and frame 0 has no error of its own
            values.append(metrics.against_earlier(run, 0, 50, 4.0, links)[2] / 6)
        self.assertAlmostEqual(np.mean(values), 1, delta=0.13)


class InMetres(unittest.TestCase):
    """A flight of 20 frames per second, 200 of them, as an inertial sensor and a camera would see it without errors from frame 80 on."""

    def flight(self, scale=1.0):
        n, s = 200, np.arange(200) / 20
        run = drive(n, scale)
        truth = np.stack([3 * np.sin(s), 2 * np.cos(1.3 * s), 0.5 * np.sin(2 * s)], 1)
        speed = np.stack([3 * np.cos(s), -2.6 * np.sin(1.3 * s), np.cos(2 * s)], 1)
        W = turn(np.array([0.2, -0.4, 1.5]))
        run["stamp_ns"] = np.arange(n) * 50_000_000 + 5
        run["truth_position"], run["position"] = truth, scale * truth @ W.T
        run["R"] = W @ run["truth_R"]
        run["metric"] = np.arange(n) >= 80
        run["velocity"] = np.where(run["metric"][:, None], scale * speed @ W.T, np.nan)
        run["velocity_covariance"][:] = np.diag([1e-4] * 3 + [1e-6] * 3)
        run["gravity"] = np.where(run["metric"][:, None], 9.8 * W @ [0, 0, -1], np.nan)
        run["gravity_sigma"][:], run["scale_sigma"][:] = 0.01, 0.02
        return run, W

    def test_a_perfect_flight_has_no_error(self):
        row, = metrics.judge(self.flight()[0], "sim:")
        self.assertAlmostEqual(row["metric_since_s"], 4)
        self.assertAlmostEqual(row["metric_first_sigma_percent"], 2)
        for name in ("metric_first_error_sigmas", "gravity_5s_deg", "gravity_10s_deg", "gravity_rms_deg", "gravity_nees2"):
            self.assertAlmostEqual(row[name], 0, places=6, msg=name)
        self.assertLess(row["velocity_nees3"], 1e-3)  # what the derivative of five positions is not

    def test_scale_and_velocity_are_judged_by_what_is_stated(self):
        run, _ = self.flight(1.03)
        row, = metrics.judge(run, "sim:")
        self.assertAlmostEqual(row["metric_first_error_sigmas"], 1.5, places=6)
        run, _ = self.flight()
        for i in range(80, 200):
            run["velocity"][i] += RANDOM.normal(size=3) * 1e-2
        self.assertAlmostEqual(metrics.judge(run, "sim:")[0]["velocity_nees3"], 1, delta=0.35)

    def test_gravity_is_judged_where_the_truth_is_upright(self):
        tilted = turn(np.array([np.radians(0.5), 0, 0]))
        for source, known in (("sim:orbit", True), ("euroc:x", True), ("kitti:x", False), ("sequence:sim: then tum:x", False)):
            run, W = self.flight()
            run["gravity"] = run["gravity"] @ (W @ tilted @ W.T).T
            row, = metrics.judge(run, source)
            self.assertEqual(np.isfinite(row["gravity_rms_deg"]), known)
            if known:
                self.assertAlmostEqual(row["gravity_5s_deg"], 0.5, places=6)
                self.assertAlmostEqual(row["gravity_nees2"], (np.radians(0.5) / 0.01) ** 2 / 2, places=6)

    def test_poses_in_metres_are_not_scaled(self):
        for scale in (1, 1.1):
            run, _ = self.flight(scale)
            run["covariance"][:] = np.eye(6) * 1e-4
            run["keyframe_stamp_ns"][:] = run["stamp_ns"][0]
            for i in range(200):
                R, t = metrics.relative(run["R"][0], run["position"][0], run["R"][i], run["position"][i])
                run["keyframe_R"][i], run["keyframe_position"][i] = R, t
            row, = metrics.judge(run, "sim:")
            self.assertAlmostEqual(row["nees6_keyframe"], 0, places=6)
            if scale == 1:
                self.assertEqual((row["tracking_outside"], round(row["metric_nees6"], 6)), (0, 0))
            else:
                self.assertGreater(row["tracking_outside"], 0.9)

    def test_stays_in_a_map_are_judged_apart(self):
        run, _ = self.flight()
        run["reset"][100:] = 1
        run["change_count"][:100] = 2
        run["change"][:100] = [(3.0, turn(np.array([1.0, 0, 0])), np.ones(3))] * 100
        rows = metrics.judge(run, "sim:")
        self.assertEqual([(row["reset"], row["poses"]) for row in rows], [(0, 100), (1, 100)])
        for row in rows:  # the change of the first stay is none of the second's
            self.assertAlmostEqual(row["scale"], 1, places=6)


class Faults(unittest.TestCase):
    """A run of 60 frames with a fault at frames 20 to 29."""

    def run_of(self, **changes):
        frames = [{"frame": i, "state": 1, "map": 0, "reset": 0, "keyframe": i // 10, "keyframe_error_m": 0.01, "sigma_m": 0.01} for i in range(60)]
        for i in range(20, 30):
            frames[i].update(keyframe=1, state=1 if i < 23 else 2)
        for name, values in changes.items():
            for i, value in values.items():
                frames[i][name] = value
        return faults.judge(frames, 20, 10)

    def test_what_happens_at_a_fault(self):
        good = self.run_of()
        self.assertEqual([good[name] for name in ("late", "made", "beyond", "frames", "posed", "end")], [0, 0, 0, 10, 10, "back"])
        bad = self.run_of(state={27: 1}, keyframe_error_m={25: 0.06, 26: None}, keyframe={24: 2, 25: 2, 26: 2, 27: 3, 28: 3, 29: 3})
        self.assertEqual([bad[name] for name in ("late", "made", "beyond")], [1, 2, 1])
        self.assertIsNone(self.run_of(state={19: 3}))

    def test_what_follows_it(self):
        lost = {i: 3 for i in range(25, 60)}
        self.assertEqual(self.run_of(state=lost)["end"], "not")
        self.assertEqual(self.run_of(state={**lost, 38: 1})["end"], "late back")
        self.assertEqual(self.run_of(state={**lost, 38: 1}, map={38: 1}, reset={38: 1})["end"], "new")
        self.assertEqual(self.run_of(state={**lost, 38: 1}, map={38: 1})["end"], "not")


class Reliability(unittest.TestCase):
    """Errors drawn by a stated sigma, and by a larger one."""

    def drawn(self, factor):
        sigma = 10 ** RANDOM.uniform(-3, 0, 4000)
        error = factor * sigma * np.sqrt(RANDOM.chisquare(3, 4000) / 3)
        return reliability.judge(error, sigma, RANDOM.chisquare(6, 4000) * factor ** 2, RANDOM.uniform(size=4000))

    def test_right_sigmas_are_flat(self):
        m = self.drawn(1)
        self.assertTrue(all(0.7 < r < 1.4 for *_, r in m["by_quality"] + m["by_sigma"]))
        self.assertTrue(abs(m["nees6"] - 1) < 0.05 and m["outside"] < 0.005 and m["rank"] > 0.5)
        self.assertEqual([len(m[name]) for name in ("by_quality", "by_sigma")], [10, 10])

    def test_sigmas_too_small_by_half_show(self):
        m = self.drawn(2)
        self.assertTrue(all(1.6 < r < 2.4 for *_, r in m["by_quality"]))
        self.assertTrue(abs(m["nees6"] - 4) < 0.2 and m["outside"] > 0.2)

    def test_ties_share_their_rank_and_few_frames_say_nothing(self):
        self.assertEqual(reliability.ranks(np.array([5.0, 1, 5, 9])).tolist(), [2.5, 1, 2.5, 4])
        few = np.ones(19)
        self.assertIsNone(reliability.judge(few, few, few, few))


class Plans(unittest.TestCase):
    binary = {"label": "x", "path": FOVEA, "hash": "1" * 64, "plugins": "."}

    def test_numbers(self):
        self.assertEqual(plan.numbers("0-3,9,20-30/5", "--starts"), [0, 1, 2, 3, 9, 20, 25, 30])
        for wrong in ("", "3-1", "a", "1-2/0", "1,,2"):
            with self.assertRaisesRegex(plan.Wrong, "--starts: found"):
                plan.numbers(wrong, "--starts")

    def test_braces_and_values(self):
        self.assertEqual(plan.braces("sim:road?seed={9..11}"), ["sim:road?seed=9", "sim:road?seed=10", "sim:road?seed=11"])
        self.assertEqual(plan.parameters(["a=1|2", "b=[1, 2]"]), [{"a": "1", "b": "[1, 2]"}, {"a": "2", "b": "[1, 2]"}])
        self.assertEqual(plan.crop("8"), (8, 8, 8, 8))
        self.assertEqual(plan.crop("1,2,3,4"), (1, 2, 3, 4))
        for wrong in (lambda: plan.parameters(["a"]), lambda: plan.crop("1,2"), lambda: plan.crop("-1")):
            self.assertRaises(plan.Wrong, wrong)

    def test_the_product_and_its_keys(self):
        make = lambda **more: plan.specs([{**self.binary, **more.pop("binary", {})}], ["sim:orbit?seed={1..2}"], "0-2", "1-2", (False, True), **more)
        specs = make(sets=plan.parameters(["seed=1|2"]))
        self.assertEqual(len(specs), 2 * 3 * 2 * 2 * 2)
        self.assertEqual(len({spec["run"] for spec in specs}), len(specs))
        keys = [spec["run"] for spec in make()]
        self.assertEqual([spec["run"] for spec in make(binary={"path": "/elsewhere", "label": "y"})], keys)
        self.assertFalse(set(keys) & {spec["run"] for spec in make(binary={"hash": "2" * 64})})

    def test_a_recording_that_changed_is_another(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "times.txt")
            hashes = []
            for text in ("0\n", "1\n", "0\n"):
                with open(path, "w", encoding="ascii") as file:
                    file.write(text)
                hashes.append(plan.data_hash(f"fault:kitti:{folder}?kind=blur"))
            self.assertEqual(hashes[0], hashes[2])
            self.assertNotEqual(hashes[0], hashes[1])


class Runs(unittest.TestCase):
    source = "sim:orbit?width=320&height=240&objects=0"

    @classmethod
    def setUpClass(cls):
        cls.binary = {"label": "x", "path": FOVEA, "hash": one.hash_file(FOVEA), "plugins": os.path.dirname(FOVEA)}

    def spec(self, **more):
        return {**plan.specs([self.binary], [self.source], "3", "2", frames="30")[0], **more}

    def test_a_run_is_a_function_of_its_specification(self):
        first, second = one.run(self.spec()), one.run(self.spec())
        times = ("wall_s", "mean_ms", "p99_ms", "resident_mib")
        self.assertEqual(first["run"]["status"], 0, first["run"]["complaint"])
        for result in (first, second):
            for name in times:
                result["run"].pop(name)
        self.assertEqual(repr(first), repr(second))  # NaN is not equal to itself
        self.assertEqual(first["frames"]["frame"], list(range(3, 63, 2)))
        self.assertEqual(first["run"]["frames"], 30)
        row, = first["maps"]
        self.assertGreater(row["poses"], 20)
        self.assertLess(row["rmse_m"], 0.1 * row["path_m"])
        truth = np.array([first["frames"]["truth_" + axis] for axis in "xyz"])
        self.assertTrue(np.isfinite(truth).all())  # of each frame, those without a pose too
        self.assertAlmostEqual(np.linalg.norm(np.diff(truth[:, -row["poses"]:], axis=1), axis=0).sum(), row["path_m"], places=6)

    def test_a_crop_takes_no_features_at_the_sides(self):
        self.assertEqual(one.run(self.spec(crop=[60, 0, 60, 0], size=[320, 240]))["run"]["status"], 0)
        blind = one.run(self.spec(crop=[150, 110, 150, 110], size=[320, 240]))
        self.assertEqual(blind["run"]["frames_starting"], 30)

    def test_a_run_that_fails_says_why(self):
        failed = one.run(self.spec(set={"features.count_max": "7"}))
        self.assertEqual(failed["run"]["status"], 2)
        self.assertIn("features.count_max", failed["run"]["complaint"])
        self.assertEqual(failed["maps"], [])

    def test_another_binary_is_not_run(self):
        with tempfile.TemporaryDirectory() as folder:
            other = shutil.copy(FOVEA, folder)
            with open(other, "ab") as file:
                file.write(b"\0")
            with self.assertRaisesRegex(one.Broken, "found a binary of hash"):
                one.run(self.spec(binary=other))


if __name__ == "__main__":
    unittest.main()
