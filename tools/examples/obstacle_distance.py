#!/usr/bin/env python3
"""Fovea's SCAN for an autopilot (PX4, ArduPilot): each scan as one OBSTACLE_DISTANCE of MAVLink, and a heartbeat every second.

    obstacle_distance.py [--to udpout:127.0.0.1:14550] [--url URL] [--prefix FOVEA] [--channel SCAN] [--system 1]
                         [--sector-deg 5]

Needs the packages lcm and pymavlink (pip install lcm pymavlink; pyserial for a serial port) and the types (make python-types; their
folder is build/python, or $FOVEA_TYPES). It receives through liblcm, which a forged fragment ends (docs/security.md)."""
import argparse
import math
import os
import re
import select
import signal
import socket
import struct
import sys
import time

UNKNOWN, PLACES = 65535, 72  # a distance that says so, and the distances of a message


def convert(scan, sector_deg=5):
    """Distances of the sectors, the least and the greatest that can be measured, in cm. Sector k is `sector_deg` wide about k times as much,
    clockwise from above, 0 ahead; the body's z axis points up, so a scan's angles go the other way. Where a scan has no ray, nothing is
    known. (Sectors of less than 5 degrees, or another angle of the first, make PX4 read beyond its array.)"""
    numbers = (scan.angle_first, scan.angle_step, scan.range_min_m, scan.range_max_m)
    if scan.frame != "body" or not all(map(math.isfinite, numbers)) or scan.range_max_m <= 0:
        raise ValueError(f"found a scan in the frame '{scan.frame}', angles and ranges {numbers}, expected 'body' and finite numbers")
    sectors = 360 // sector_deg
    nearest, known = [math.inf] * sectors, [None] * sectors
    for k, range_m in enumerate(scan.range_m):
        clockwise_deg = -math.degrees(scan.angle_first + k * scan.angle_step)
        at = math.floor(clockwise_deg / sector_deg + 0.5) % sectors
        if math.isnan(range_m):
            known[at] = False
        else:
            known[at] = known[at] is not False
            nearest[at] = min(nearest[at], max(range_m, scan.range_min_m))
    max_cm = min(int(scan.range_max_m * 100), UNKNOWN - 2)
    min_cm = min(max(int(scan.range_min_m * 100), 0), max_cm)

    def distance(range_m, all_known):
        if range_m * 100 < max_cm + 1:
            return max(int(range_m * 100), min_cm, 1)  # ArduPilot takes 0 for no measurement
        return max_cm + 1 if all_known else UNKNOWN

    distances = [distance(*sector) for sector in zip(nearest, known)]
    return distances + [UNKNOWN] * (PLACES - sectors), min_cm, max_cm


def options_of(words):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--to", default="udpout:127.0.0.1:14550", help="where the autopilot listens, as pymavlink names it")
    parser.add_argument("--url", default="udpm://239.255.76.67:7667?ttl=0", help="LCM URL")
    parser.add_argument("--prefix", default="FOVEA", help="channel_prefix of the runtime")
    parser.add_argument("--channel", default="SCAN", help="channel of the scans, without the prefix")
    parser.add_argument("--system", type=int, default=1, help="MAVLink system of the autopilot, 1 to 255")
    parser.add_argument("--sector-deg", type=int, default=5, choices=(5, 10), help="10 for a PX4 whose own map has sectors of 10 degrees")
    parser.error = lambda text: parser.exit(2, f"obstacle_distance.py: {text}\n")
    options = parser.parse_args(words)
    if not 1 <= options.system <= 255:
        parser.error(f"argument --system: found {options.system}, expected 1 to 255")
    if "://" not in options.url:
        parser.error(f"argument --url: found '{options.url}', expected such as udpm://239.255.76.67:7667?ttl=0")
    return options


class Bridge:
    def __init__(self, link, mavlink, sector_deg):
        self.link, self.mavlink, self.sector_deg, self.sent, self.dropped = link, mavlink, sector_deg, 0, 0

    def heartbeat(self):
        self.link.mav.heartbeat_send(self.mavlink.MAV_TYPE_ONBOARD_CONTROLLER, self.mavlink.MAV_AUTOPILOT_INVALID, 0, 0,
                                     self.mavlink.MAV_STATE_ACTIVE)

    def on_scan(self, _, data):
        from fovea import scan_t
        try:
            scan = scan_t.decode(data)
            distances, min_cm, max_cm = convert(scan, self.sector_deg)
        except (ValueError, struct.error) as wrong:
            self.dropped += 1
            if self.dropped == 1:
                print(f"obstacle_distance.py: left out a scan: {wrong}", file=sys.stderr, flush=True)
            return
        time_us = max((scan.stamp.time_ns + scan.stamp.utc_offset_ns) // 1000, 0)
        self.link.mav.obstacle_distance_send(time_us, self.mavlink.MAV_DISTANCE_SENSOR_UNKNOWN, distances, self.sector_deg, min_cm, max_cm,
                                             self.sector_deg, 0, self.mavlink.MAV_FRAME_BODY_FRD)
        self.sent += 1


def open_link(options):
    """What goes to the autopilot; a heartbeat has gone."""
    from pymavlink import mavutil
    kind, *address = options.to.split(":")
    if kind == "udpout" and len(address) == 2:
        socket.gethostbyname(address[0])  # pymavlink is silent about a name that nobody knows
    link = mavutil.mavlink_connection(options.to, source_system=options.system, dialect="common", autoreconnect=True, retries=1,
                                      source_component=mavutil.mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE)
    bridge = Bridge(link, mavutil.mavlink, options.sector_deg)
    bridge.heartbeat()
    return bridge


def run(bridge, bus):
    beat = time.monotonic() + 1
    while True:
        if select.select([bus], [], [], max(beat - time.monotonic(), 0))[0]:
            bus.handle()
        if time.monotonic() >= beat:
            beat = time.monotonic() + 1
            bridge.heartbeat()
        while bridge.link.recv_msg() is not None:  # what the autopilot says is not needed, and must not fill its way here
            pass


def main():
    options = options_of(sys.argv[1:])
    here = os.path.dirname(os.path.abspath(__file__))
    sys.path.insert(0, os.environ.get("FOVEA_TYPES", os.path.join(here, "..", "..", "build", "python")))
    os.environ["MAVLINK20"] = "1"  # MAVLink 1 has no message of this number
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    doing = "load what it needs"
    try:
        import lcm
        import fovea  # noqa: F401
        doing = f"send to {options.to}"
        bridge = open_link(options)
        doing = f"hear {options.url}"
        bus = lcm.LCM(options.url)
        channel = f"{options.prefix}_{options.channel}" if options.prefix else options.channel
        bus.subscribe(re.escape(channel), bridge.on_scan)  # to LCM it is a regular expression
        print("listening", flush=True)
        doing = f"hear {options.url} or send to {options.to}"
        run(bridge, bus)
    except KeyboardInterrupt:
        print(f"{bridge.sent} scans sent, {bridge.dropped} left out")
    except Exception as wrong:  # of pymavlink, of what it opens, or of liblcm
        sys.exit(f"obstacle_distance.py: cannot {doing}: {wrong}")


if __name__ == "__main__":
    main()
