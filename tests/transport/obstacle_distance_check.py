"""What tools/examples/obstacle_distance.py makes of scans, heard by pymavlink: of scans made here, and of a simulated run that loses its pose.

Usage: obstacle_distance_check.py BUILD (made | run | arguments). It sends by multicast, so in a network of its own.
"""
import atexit
import math
import os
import random
import signal
import subprocess
import sys
import time

os.environ["MAVLINK20"] = "1"
here = os.path.dirname(os.path.abspath(__file__))
build, part = sys.argv[1:]
types = os.path.join(build, "python")
example = os.path.join(here, "..", "..", "tools", "examples", "obstacle_distance.py")
sys.path[:0] = [types, os.path.dirname(example), os.path.join(here, "..", "common")]
import lcm  # noqa: E402
from fovea import grid_t, pose_t, scan_t  # noqa: E402
from pymavlink import mavutil  # noqa: E402
from tool_copy import run_copy  # noqa: E402

URL, PORT, PATIENCE_S = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=8388608", 14550, 60
UNKNOWN = 65535


def expect(holds, what):
    if not holds:
        sys.exit(f"obstacle_distance_check: {what}")


def expected(scan, sector_deg=5):
    """By unit vectors: a ray is in the sector whose middle is within half a sector of it. Forward is x, right is -y."""
    most = int(scan.range_max_m * 100)
    distances, least = [], math.cos(math.radians(sector_deg / 2))
    angles = (scan.angle_first + k * scan.angle_step for k in range(len(scan.range_m)))
    rays = [(math.cos(angle), math.sin(angle), r) for angle, r in zip(angles, scan.range_m)]
    for sector in range(360 // sector_deg):
        forward, right = math.cos(math.radians(sector * sector_deg)), math.sin(math.radians(sector * sector_deg))
        inside = [r for x, y, r in rays if forward * x - right * y > least]
        obstacles = [max(r, scan.range_min_m) for r in inside if not math.isnan(r) and r < math.inf]
        if obstacles:
            distances.append(max(math.floor(min(obstacles) * 100), 1))
        else:
            distances.append(UNKNOWN if not inside or any(map(math.isnan, inside)) else most + 1)
    return distances + [UNKNOWN] * (72 - len(distances))


def scan_of(ranges, first=0.0, step=None, least=0.0, stamp_us=0, frame="body"):
    scan = scan_t()
    scan.frame, scan.range_m, scan.count = frame, ranges, len(ranges)
    scan.angle_first, scan.angle_step = first, 2 * math.pi / len(ranges) if step is None else step
    scan.range_min_m, scan.range_max_m, scan.stamp.time_ns = least, 5.0, stamp_us * 1000
    return scan_t.decode(scan.encode())  # with the floats of the wire


class Example:
    """It runs, and what it sends is heard."""

    def __init__(self, *options):
        self.heard = mavutil.mavlink_connection(f"udpin:127.0.0.1:{PORT}", dialect="common")
        self.process = subprocess.Popen([sys.executable, example, "--url", URL, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                        text=True, env=dict(os.environ, FOVEA_TYPES=types))
        atexit.register(self.process.kill)
        expect(self.process.stdout.readline() == "listening\n", "the example does not listen")

    def next(self, kind, wait_s=PATIENCE_S):
        return self.heard.recv_match(type=kind, blocking=True, timeout=wait_s)

    def end(self):
        self.process.send_signal(signal.SIGTERM)
        said, complaint = self.process.communicate(timeout=PATIENCE_S)
        expect(self.process.returncode == 0, f"exit code {self.process.returncode}: {complaint}")
        self.heard.close()
        return said, complaint


def same(message, scan, sector_deg=5):
    least, most = int(scan.range_min_m * 100), int(scan.range_max_m * 100)
    expect((message.increment, message.increment_f, message.angle_offset, message.frame) == (sector_deg, sector_deg, 0, 12), f"{message}")
    expect((message.min_distance, message.max_distance, message.sensor_type) == (least, most, 4), f"{message}")
    expect(message.time_usec == (scan.stamp.time_ns + scan.stamp.utc_offset_ns) // 1000, f"{message}")
    expect(list(message.distances) == expected(scan, sector_deg), f"found {message.distances}, expected {expected(scan, sector_deg)}")


def made_scans():
    """The scans, and what some of their sectors must say."""
    inf, nan = math.inf, math.nan
    around = [inf] * 360
    left, ahead_left, right, behind = list(around), list(around), list(around), list(around)
    left[90] = ahead_left[10] = right[270] = behind[180] = 1.234
    yield scan_of(around), {k: 501 for k in range(72)}
    yield scan_of([nan] * 360), {k: UNKNOWN for k in range(72)}  # as when the pose is lost
    yield scan_of(left), {54: 123, 18: 501, 0: 501, 36: 501}  # 270 degrees clockwise is left
    yield scan_of(ahead_left), {70: 123, 2: 501}
    yield scan_of(right), {18: 123, 54: 501}
    yield scan_of(behind), {36: 123, 0: 501}
    yield scan_of([nan, 3.0, 2.0, nan] + [inf] * 355 + [nan]), {0: 200, 71: UNKNOWN, 1: 501}  # rays 3 to 7 are in sector 71
    yield scan_of([0.1, 0.0] + [inf] * 358, least=0.25), {0: 25}
    yield scan_of([0.0] * 360), {0: 1}
    yield scan_of([2.0] * 61, first=math.radians(-30), step=math.radians(1)), {0: 200, 6: 200, 66: 200, 7: UNKNOWN, 65: UNKNOWN, 36: UNKNOWN}
    yield scan_of([1.5] + [inf] * 360, first=math.radians(60), step=math.radians(-1)), {60: 150, 59: 501, 61: 501}  # clockwise, all round
    yield scan_of([2.0] * 16), {0: 200, 1: UNKNOWN, 36: 200, 54: 200}
    chance = random.Random(5)
    for count in (360, 361, 500, 1440):
        for _ in range(5):
            yield scan_of([chance.choice((nan, inf, inf, inf, inf, chance.uniform(0, 5))) for _ in range(count)], first=chance.uniform(-7, 7),
                          least=chance.choice((0.0, 0.3))), {}


def made(options, channel, sector_deg=5):
    run, bus, sectors = Example(*options), lcm.LCM(URL), 0
    for number, (scan, sure) in enumerate(made_scans()):
        scan.stamp.time_ns, scan.stamp.utc_offset_ns = 1_000_000 * (number + 1), number % 2 * 1_700_000_000_000_000_000
        bus.publish(channel, scan.encode())
        message = run.next("OBSTACLE_DISTANCE")
        expect(message is not None, f"no message for scan {number}")
        same(message, scan, sector_deg)
        if sector_deg == 5:
            for sector, distance in sure.items():
                expect(message.distances[sector] == distance, f"scan {number}, sector {sector}: {message.distances[sector]}, expected {distance}")
        sectors += 360 // sector_deg
    bus.publish(channel, b"no scan")
    bus.publish(channel, scan_of([1.0] * 360, frame="odom").encode())
    bus.publish(channel, scan_of([1.0] * 360, step=math.nan).encode())
    for _ in range(20):  # those that waited while this program had no processor are read at once
        seconds = []
        while len(seconds) < 4:
            beat = run.next("HEARTBEAT")
            expect(beat is not None and (beat.type, beat.autopilot, beat.get_srcSystem(), beat.get_srcComponent()) == (18, 8, 1, 196), f"{beat}")
            seconds.append(time.monotonic())
        if seconds[-1] - seconds[0] > 1.5:
            break
    else:
        expect(False, f"heartbeats at {seconds} seconds")
    expect(run.next("OBSTACLE_DISTANCE", 0.2) is None, "a message that belongs to no scan")
    said, complaint = run.end()
    expect(said == f"{number + 1} scans sent, 3 left out\n" and complaint.count("\n") == 1, said + complaint)
    print(f"{number + 1} scans made here: {sectors} sectors of {sector_deg} degrees as expected")


def occupied_there(grid, pose, sector, distance_m):
    """Whether the grid has an occupied cell in this direction of the body, at this distance."""
    w, x, y, z = pose.orientation
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    cell = grid.resolution_m
    for tenth in range(-25, 26, 5):
        angle = yaw - math.radians(sector * 5 + tenth / 10)
        column = (pose.position[0] + distance_m * math.cos(angle) - grid.origin_position[0]) / cell
        row = (pose.position[1] + distance_m * math.sin(angle) - grid.origin_position[1]) / cell
        for i in (-1, 0, 1):
            for k in (-1, 0, 1):
                at = (math.floor(row) + i) * grid.width + math.floor(column) + k
                if 0 <= at < grid.cell_count and grid.cells[at] > 100 * grid.occupied_above:
                    return True
    return False


def run_of_the_program():
    """In a hall, until the camera sees nothing: each message is its scan's, obstacles are where the grid has them, and not on the other side."""
    example_run, bus, heard = Example(), lcm.LCM(URL), {"SCAN": {}, "GRID": {}, "POSE": {}}
    for suffix, kind in (("SCAN", scan_t), ("GRID", grid_t), ("POSE", pose_t)):
        def take(_, data, kind=kind, there=heard[suffix]):
            message = kind.decode(data)
            there.setdefault((message.stamp.time_ns + message.stamp.utc_offset_ns) // 1000, []).append(message)
        bus.subscribe("FOVEA_" + suffix, take).set_queue_capacity(1000)
    fovea = subprocess.Popen([
        os.path.join(build, "fovea"), "run", "--source",
        "fault:sim:drive?seed=7&width=320&height=240&rate=10&baseline=0.12?kind=black&first=60&shortest=60&longest=60&count=1&fraction=1",
        "--frames", "110", "--picture", "none", "--quiet", "--model", "src/detect/segmenter.fvm", "--set", "grid.enabled=true",
        "--set", "lcm_url=udpm://239.255.76.67:7667", "--set", "loop.priority=0",
        "--set", "features_every=0", "--set", "map_every=0", "--set", "preview.period_frames=0", "--set",
        "T_body_cam=[[0,-0.34202,0.939693,0.1],[-1,0,0,0],[0,-0.939693,-0.34202,0.8]]"])
    atexit.register(fovea.kill)
    messages, quiet, until = [], 0, math.inf

    def answered():
        return not heard["SCAN"] or any(message.time_usec == max(heard["SCAN"]) for message in messages)

    while quiet < 20 or (not answered() and time.monotonic() < until):
        if quiet == 1:
            until = time.monotonic() + PATIENCE_S
        ended = fovea.poll() is not None
        while bus.handle_timeout(20) > 0:
            pass
        quiet = quiet + 1 if ended else 0
        while (message := example_run.next("OBSTACLE_DISTANCE", 0.01)) is not None:
            messages.append(message)
            quiet = 0
    expect(fovea.returncode == 0, f"fovea run: exit code {fovea.returncode}")
    example_run.end()
    mirrored = found = obstacles = lost = 0
    for message in messages:
        scans = heard["SCAN"].get(message.time_usec, [])
        fits = [scan for scan in scans if expected(scan) == list(message.distances)]
        expect(fits, f"the message at {message.time_usec} us is that of none of {len(scans)} scans")
        same(message, fits[0])
        lost += all(distance == UNKNOWN for distance in message.distances)
        grids, poses = (heard[name].get(message.time_usec, []) for name in ("GRID", "POSE"))
        for sector, distance in enumerate(message.distances):
            if distance <= message.max_distance and len(grids) == 1 and poses:
                obstacles += 1
                found += occupied_there(grids[0], poses[0], sector, distance / 100)
                mirrored += occupied_there(grids[0], poses[0], -sector, distance / 100)
    print(f"{len(messages)} messages for {sum(map(len, heard['SCAN'].values()))} scans of a run, {lost} of them all unknown; "
          f"{obstacles} sectors with an obstacle, {found} where the grid has one, {mirrored} if left were right")
    expect(len(messages) >= 10 and list(messages[-1].distances) == [UNKNOWN] * 72, "the pose is lost at the end, and the last message says so")
    expect(obstacles > 100 and found == obstacles and mirrored < obstacles / 2, "obstacles are not where the grid has them")


def arguments():
    os.environ["FOVEA_TYPES"] = types
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for words in (["--to", "udpout:"], ["--to", "udpout:no..name:14550"], ["--to", "udpout:127.0.0.1:x"], ["--to", "/dev/null"],
                  ["--url", "here"], ["--system", "0"], ["--sector-deg", "3"], ["--what"]):
        run = run_copy(example, *words)
        expect(run.returncode in (1, 2) and run.stdout == "" and run.stderr.count("\n") == 1 and run.stderr.startswith("obstacle_distance.py: "),
               f"{words}: exit code {run.returncode}: {run.stdout}{run.stderr}")


signal.signal(signal.SIGTERM, lambda *_: sys.exit("obstacle_distance_check: ended before its time"))
if part == "made":
    made([], "FOVEA_SCAN")
    made(["--prefix", "R.2", "--channel", "S", "--sector-deg", "10"], "R.2_S", 10)
elif part == "run":
    run_of_the_program()
else:
    arguments()
