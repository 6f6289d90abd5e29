"""Run the odometry over recordings with truth, over sampling seeds and start frames, and write one table.

Usage: evaluate.py [--fovea build/fovea] [--data DIR] [--seeds N] [--starts 0,7,15] [--output FILE] [--only NAME]
A row: frames posed, ATE (RMSE after Sim(3) alignment) of the live poses and after all optimisation, RPE over one second, CPU
time, memory. Per figure the median over all runs, and the worst. Where the camera's height over the floor is known, a second
table says how far the length of the path is off when scale.source is camera_height.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
from evo.core import metrics, sync
from evo.tools import file_interface

import truth

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

import progress  # noqa: E402

# name, kind, frames, frames per second, largest difference of stamps to the truth in seconds
RECORDINGS = [
    ("euroc_mh05_a", "euroc", 270, 20, 0.01),
    ("kitti00_a", "kitti", 80, 10, 0.01),
    ("kitti06_a", "kitti", 51, 10, 0.01),
    ("handheld_7scenes_a", "tum", 250, 30, 0.02),
]
CAMERA_HEIGHT_M = {"kitti00_a": 1.65, "kitti06_a": 1.65}  # A. Geiger et al., IJRR 2013


def run_once(fovea, uri, seed, start, folder, extra):
    trajectory, final, stats = (os.path.join(folder, name) for name in ("live.tum", "final.tum", "stats.json"))
    for path in (trajectory, final, stats):
        if os.path.exists(path):
            os.remove(path)
    command = [fovea, "run", "--source", uri, "--start", str(start), "--trajectory", trajectory, "--trajectory-final", final,
               "--stats", stats, "--set", f"seed={seed}"] + extra
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit {done.returncode}: {done.stderr.strip()}")
    return trajectory, final, json.load(open(stats))


def measure(reference, path, rate_hz, tolerance_s):
    """Posed frames, ATE and the median one-second errors of a TUM file against the truth."""
    posed = sum(1 for line in open(path) if line.strip() and not line.startswith("#"))
    if posed < 10:
        return {"posed": posed, "ate": float("nan"), "rpe_m": float("nan"), "rpe_deg": float("nan"), "scale_off": float("nan")}
    estimate = file_interface.read_tum_trajectory_file(path)
    ref, est = sync.associate_trajectories(reference, estimate, max_diff=tolerance_s)
    scale = est.align(ref, correct_scale=True)[2]
    result = {"posed": posed, "scale_off": 100 * (1 / scale - 1)}
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((ref, est))
    result["ate"] = ape.get_statistic(metrics.StatisticsType.rmse)
    for key, relation in (("rpe_m", metrics.PoseRelation.translation_part),
                          ("rpe_deg", metrics.PoseRelation.rotation_angle_deg)):
        rpe = metrics.RPE(relation, delta=rate_hz, delta_unit=metrics.Unit.frames, all_pairs=True)
        try:
            rpe.process_data((ref, est))
            result[key] = rpe.get_statistic(metrics.StatisticsType.rmse)
        except Exception:  # fewer poses than a second holds
            result[key] = float("nan")
    return result


def evaluate(arguments, name, kind, frames, rate_hz, tolerance_s):
    folder = os.path.join(arguments.data, name)
    if not os.path.isdir(folder):
        print(f"SKIPPED {name}: not in {arguments.data}", file=sys.stderr)
        return None
    reference = truth.READERS[kind](folder)
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        for start in arguments.starts:
            for seed in range(1, arguments.seeds + 1):
                progress.show(f"evaluate {name}", len(rows), arguments.seeds * len(arguments.starts), f"start {start}, seed {seed}")
                path, final, stats = run_once(arguments.fovea, f"{kind}:{folder}", seed, start, scratch, arguments.extra)
                row = measure(reference, path, rate_hz, tolerance_s)
                row["ate_final"] = measure(reference, final, rate_hz, tolerance_s)["ate"]
                row["share"] = row["posed"] / (frames - start)
                row["mean_ms"] = stats["frame"]["mean_ns"] / 1e6
                row["p99_ms"] = stats["frame"]["p99_ns"] / 1e6
                row["resident_mib"] = stats["memory"]["resident_bytes"] / 2**20
                rows.append(row)
    progress.clear()
    column = lambda key: np.array([row[key] for row in rows], dtype=float)
    return {
        "name": name, "runs": len(rows), "frames": frames,
        "posed": np.median(column("share")) * frames, "posed_worst": column("share").min() * frames,
        "ate": np.nanmedian(column("ate")), "ate_worst": np.max(column("ate")),
        "final": np.nanmedian(column("ate_final")), "final_worst": np.max(column("ate_final")),
        "rpe_m": np.nanmedian(column("rpe_m")), "rpe_deg": np.nanmedian(column("rpe_deg")),
        "mean_ms": np.median(column("mean_ms")), "p99_ms": np.median(column("p99_ms")),
        "resident_mib": column("resident_mib").max(),
    }


def table(results):
    lines = ["| recording | runs | posed, median (worst) | ATE m, median (worst) | after all optimisation | RPE 1 s: m, deg | CPU ms, mean, p99 | resident MiB |",
             "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for r in results:
        lines.append(f"| {r['name']} | {r['runs']} | {r['posed']:.0f} ({r['posed_worst']:.0f}) of {r['frames']} | "
                     f"{r['ate']:.4f} ({r['ate_worst']:.4f}) | {r['final']:.4f} ({r['final_worst']:.4f}) | {r['rpe_m']:.3f}, {r['rpe_deg']:.2f} | "
                     f"{r['mean_ms']:.2f}, {r['p99_ms']:.2f} | {r['resident_mib']:.0f} |")
    return "\n".join(lines) + "\n"


def evaluate_scale(arguments, name, kind, frames, rate_hz, tolerance_s):
    """How far published and final paths are off in length, percent, by seed and start."""
    folder = os.path.join(arguments.data, name)
    if name not in CAMERA_HEIGHT_M or not os.path.isdir(folder):
        return None
    reference = truth.READERS[kind](folder)
    height = ["--set", "scale.source=camera_height", "--set", f"scale.camera_height_m={CAMERA_HEIGHT_M[name]}"]
    live, final = [], []
    with tempfile.TemporaryDirectory() as scratch:
        for start in arguments.starts:
            for seed in range(1, arguments.seeds + 1):
                progress.show(f"evaluate scale of {name}", len(live), arguments.seeds * len(arguments.starts), f"start {start}, seed {seed}")
                paths = run_once(arguments.fovea, f"{kind}:{folder}", seed, start, scratch, arguments.extra + height)
                live.append(measure(reference, paths[0], rate_hz, tolerance_s)["scale_off"])
                final.append(measure(reference, paths[1], rate_hz, tolerance_s)["scale_off"])
    progress.clear()
    worst = lambda values: values[int(np.argmax(np.abs(values)))]
    return (f"| {name} | {len(live)} | {CAMERA_HEIGHT_M[name]} | {np.median(live):+.1f} ({worst(live):+.1f}) | "
            f"{np.median(final):+.1f} ({worst(final):+.1f}) |")


SCALE_HEAD = ["| recording | runs | camera height m | scale off by %, median (worst) | after all optimisation |",
              "| --- | --- | --- | --- | --- |"]


def count(text):
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"found {number}, expected at least 1")
    return number


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fovea", default="build/fovea")
    parser.add_argument("--data", default=os.environ.get("FOVEA_DATA", "../shared/data"))
    parser.add_argument("--seeds", type=count, default=20)
    parser.add_argument("--starts", type=lambda text: [int(n) for n in text.split(",")], default=[0, 7, 15])
    parser.add_argument("--output")
    parser.add_argument("--only", choices=[recording[0] for recording in RECORDINGS])
    parser.add_argument("extra", nargs="*", help="more arguments for fovea run, after --")
    arguments = parser.parse_args()
    results, scales = [], []
    for recording in RECORDINGS:
        if arguments.only and recording[0] != arguments.only:
            continue
        result = evaluate(arguments, *recording)
        if result:
            results.append(result)
            print(table([result]).splitlines()[-1], flush=True)
        scale = evaluate_scale(arguments, *recording)
        if scale:
            scales.append(scale)
            print(scale, flush=True)
    if arguments.output and results:
        with open(arguments.output, "w") as out:
            out.write(table(results))
            if scales:
                out.write("\n" + "\n".join(SCALE_HEAD + scales) + "\n")


if __name__ == "__main__":
    main()
