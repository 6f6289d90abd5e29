#!/usr/bin/env python3
"""Drives through unseen halls by the whole program: `fovea run` on sim:drive with two cameras, masks of the shipped network and the grid, and
`navigate`, which sends velocity commands over LCM, in lock-step. A hall that is in RECORD is not driven again.

Usage: halls.py BUILD RECORD FIRST HALLS NEEDED [FRAMES]     exit 0: in NEEDED of the halls FIRST, FIRST + 1 ... the goal was reached within 3 times the shortest
way's time, and in no hall the robot's own motion brought it into contact with anything. FRAMES (6000): the run ends then, wherever the robot is.
"""
import ctypes
import os
import re
import subprocess
import sys
import time

LATE = 3
CLONE_NEWNET, CLONE_NEWUSER = 0x40000000, 0x10000000
OPTIONS = ["--model", "src/detect/segmenter.fvm", "--set", "grid.enabled=true", "--set", "preview.period_frames=0", "--picture", "none",
           "--set", "T_body_cam=[[0,-0.34202,0.939693,0.1],[-1,0,0,0],[0,-0.939693,-0.34202,0.8]]"]
GOAL = re.compile(r"the goal is (-?[\d.]+) m ahead of the start and (-?[\d.]+) m to its left")
END = re.compile(r"(not )?at the goal after ([\d.]+) s, contacts (\d+); the shortest way takes ([\d.]+) s")


def enter_network():
    """Nothing but a loopback that takes multicast: halls do not depend on the machine's routes, and nobody else hears them."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET) != 0 and libc.unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0:
        sys.exit(f"halls.py: found no right to a network namespace ({os.strerror(ctypes.get_errno())}), expected root or user namespaces")
    subprocess.run(["ip", "link", "set", "lo", "up", "multicast", "on"], check=True)
    subprocess.run(["ip", "route", "replace", "224.0.0.0/4", "dev", "lo"], check=True)


def goal_of(log, run):
    """X and Y of the goal, which the run's first line states."""
    for _ in range(1200):
        with open(log, encoding="utf-8") as file:
            found = GOAL.search(file.read())
        if found:
            return found.groups()
        if run.poll() is not None:
            break
        time.sleep(0.1)
    with open(log, encoding="utf-8") as file:
        sys.exit(f"halls.py: {log}: found no goal, expected the run's first line to state it: {file.read()[-300:]}")


def drive(build, seed, frames, log):
    """One hall, as a line of RECORD: its seed, the seconds to the goal ("none": it was not reached) and of the shortest way, and contacts."""
    source = f"sim:drive?commands=1&baseline=0.12&rate=10&patience=200&seed={seed}"
    with open(log, "w", encoding="utf-8") as file:
        run = subprocess.Popen([f"{build}/fovea", "run", "--source", source, *OPTIONS, "--frames", str(frames)],
                               stdout=subprocess.DEVNULL, stderr=file)
    planner = subprocess.Popen([f"{build}/examples/navigate", *goal_of(log, run), "--patience", "60"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    run.wait()
    planner.terminate()
    planner.wait()
    with open(log, encoding="utf-8") as file:
        found = END.search(file.read())
    if not found:
        sys.exit(f"halls.py: {log}: found no summary of the drive, expected the run to end with it")
    return f"{seed} {'none' if found[1] else found[2]} {found[4]} {found[3]}\n"


def main():
    if len(sys.argv) not in (6, 7):
        sys.exit(__doc__)
    build, record = sys.argv[1:3]
    first, halls, needed = map(int, sys.argv[3:6])
    frames = int(sys.argv[6]) if len(sys.argv) == 7 else 6000
    enter_network()
    done = {}
    if os.path.exists(record):
        with open(record, encoding="utf-8") as file:
            done = {int(line.split()[0]): line for line in file}
    for seed in range(first, first + halls):
        if seed not in done:
            done[seed] = drive(build, seed, frames, f"{record}.run")
            with open(record, "a", encoding="utf-8") as file:
                file.write(done[seed])
        print(done[seed], end="", flush=True)
    ends = [done[seed].split()[1:] for seed in range(first, first + halls)]
    reached = [(float(took), float(shortest)) for took, shortest, _ in ends if took != "none"]
    in_time = sum(took <= LATE * shortest for took, shortest in reached)
    touched = sum(contacts != "0" for _, _, contacts in ends)
    print(f"{halls} halls: {len(reached)} at the goal, {in_time} of these in time, expected {needed}; a contact in {touched}, expected none")
    sys.exit(0 if in_time >= needed and touched == 0 else 1)


if __name__ == "__main__":
    main()
