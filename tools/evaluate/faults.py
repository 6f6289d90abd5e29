"""What odometry makes of pictures that are of no use: one fault per run, of a known kind, place and length.

While it lasts a pose must be `weak` or `lost` within DELAY frames, no frame become a keyframe, no error exceed LIMIT stated sigmas; after it the
camera must be found again within BACK frames, or a new map begin with another reset_counter.
"""
import plan

KINDS = ["black", "blur&sigma=8", "motion&length=41", "noise&amount=60", "freeze", "freeze,noise", "freeze,recompress"]
LENGTHS = (5, 12, 20, 30)
FIRST, DELAY, BACK, LIMIT, LEFT = 45, 3, 5, 5.0, 20  # LEFT: frames after the fault that are looked at
SOURCES = [("euroc_mh05_a", "euroc", 80), ("handheld_7scenes_a", "tum", 80), ("kitti00_a", "kitti", 0), ("kitti06_a", "kitti", 0), ("kitti01_a", "kitti", 0)]
SIMULATED = ["sim:road?objects=0&seed={1..2}", "sim:orbit?seed={1..2}"]
STARTS = {"kitti06_a": 25, "kitti01_a": 25}  # short ones: the fault begins earlier

HEAD = """# Pictures of no use

One fault per run, at frame {first} of the source ({short} of `kitti06_a` and `kitti01_a`), of {lengths} frames, on the recordings of `../shared/data` and on seeds of `sim:road` (without cars) and `sim:orbit`, of version
{version}, renewed by `python tools/evaluate faults`. Runs count that are posed when the fault begins. *Late*: `tracking` after more than {delay} frames of the fault. *Keyframes*: made of a frame of the fault. *Beyond {limit:g} sigma*: frames of the fault
whose error since the reference keyframe exceeds {limit:g} stated sigmas. *Sigma over error*: root mean squares over the frames of all faults that are posed. *Back*: posed in the same map within {back} frames; *new*: else, in a new map with another `reset_counter` within {left};
*late back*: later in the same map; *not*: not posed, or a new map without a new counter.

"""


def first_of(name):
    return STARTS.get(name, FIRST)


def specs(binary, arguments, sources):
    found = []
    for name, uri, limit in [(name, uri, dict((n, f) for n, _, f in SOURCES)[name]) for name, uri in sources(arguments, SOURCES)] + [
            ("", text, 0) for text in SIMULATED]:
        for kind in KINDS:
            for length in LENGTHS:
                fault = f"fault:{uri}?kind={kind}&first={first_of(name)}&shortest={length}&longest={length}&count=1"
                found += plan.specs([binary], [fault], frames=str(first_of(name) + length + LEFT + 5))
    return found


def judge(frames, first, length):
    """Of one run's frames, in order: what happened at the fault. None: it was not posed when the fault began."""
    before = [f for f in frames if f["frame"] < first]
    inside = [f for f in frames if first <= f["frame"] < first + length]
    after = [f for f in frames if first + length <= f["frame"] < first + length + LEFT]
    posed = lambda f: f["state"] in (1, 2)
    if not before or not inside or not after or not posed(before[-1]):
        return None
    last = before[-1]
    keyframe, made, ratios, errors, sigmas = last["keyframe"], 0, [], [], []
    for f in inside:
        if posed(f) and f["map"] == last["map"] and f["keyframe"] != keyframe:
            made, keyframe = made + 1, f["keyframe"]
        error, sigma = f["keyframe_error_m"], f["sigma_m"]
        if posed(f) and error is not None and error == error and sigma and sigma == sigma:
            ratios.append(error / sigma)
            errors.append(error)
            sigmas.append(sigma)
    found = next((i for i, f in enumerate(after) if posed(f)), None)
    if found is None:
        end = "not"
    elif after[found]["map"] == last["map"]:
        end = "back" if found < BACK else "late back"
    else:
        end = "new" if after[found]["reset"] != last["reset"] else "not"
    return {"late": sum(f["state"] == 1 for f in inside[DELAY:]), "made": made, "beyond": sum(r > LIMIT for r in ratios), "frames": len(inside), "posed": len(ratios),
            "errors": errors, "sigmas": sigmas, "end": end}


def text(db, rows, markdown, number, name_of):
    import re
    runs = rows(db, "SELECT run, source, version FROM chosen ORDER BY source")
    table = {}
    for run in runs:
        found = re.fullmatch(r"fault:(.*)\?kind=(.*)&first=(\d+)&shortest=(\d+)&longest=\d+&count=1", run["source"])
        frames = rows(db, "SELECT * FROM frames WHERE run = ? ORDER BY i", [run["run"]])
        judged = judge(frames, int(found[3]), int(found[4]))
        where = re.sub(r"&?seed=\d+", "", name_of(found[1])).rstrip("?")
        for key in ((0, where), (1, found[2].replace("&", ", "))):
            table.setdefault(key, []).append(judged)
    square = lambda values: (sum(v * v for v in values) / len(values)) ** 0.5 if values else float("nan")
    out = HEAD.format(first=FIRST, short=STARTS["kitti06_a"], lengths=", ".join(map(str, LENGTHS)), version=runs[0]["version"], delay=DELAY, limit=LIMIT, back=BACK, left=LEFT)
    for kind, title in ((0, "source"), (1, "fault")):
        lines = []
        for (of, name), every in sorted(table.items()):
            if of != kind:
                continue
            judged = [each for each in every if each]
            total = lambda what: sum(each[what] for each in judged)
            errors, sigmas = ([v for each in judged for v in each[what]] for what in ("errors", "sigmas"))
            ends = [sum(each["end"] == end for each in judged) for end in ("back", "new", "late back", "not")]
            lines.append([name, f"{len(judged)} of {len(every)}", str(total("frames")), str(total("posed")), f"{sum(each['late'] > 0 for each in judged)}", str(total("made")),
                          str(total("beyond")), number(square(sigmas) / square(errors) if errors else None, ".1f"), ", ".join(map(str, ends))])
        out += markdown([title, "runs", "frames", "with error known", "late", "keyframes", f"beyond {LIMIT:g} sigma", "sigma over error", "back, new, late back, not"], lines) + "\n"
    return out.rstrip("\n") + "\n"
