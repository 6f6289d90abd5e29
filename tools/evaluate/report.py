"""The report of a sweep as one HTML file: totals, the worst maps drawn, two versions side by side."""
import base64
import html as escape
import json
import os
import subprocess
import tempfile

import numpy as np

import one
import plan
import svg
import tables

STYLE = """body{font:14px/1.45 sans-serif;max-width:1250px;margin:2em auto;padding:0 1em;color:#222}table{border-collapse:collapse;margin:1em 0}
td,th{padding:.25em .7em;border-bottom:1px solid #ddd;text-align:right}td:first-child,th:first-child{text-align:left}.bad{color:#b3261e}
.case{display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start;border-top:1px solid #ccc;padding:1em 0}code{background:#f3f3f3;padding:0 .2em}
img{max-width:100%}h3{width:100%;margin:0}"""
STATE_NAMES = ("starting", "tracking", "weak", "lost", "paused", "coasting")

# The settings that two versions of a run share.
SAME = '"source", "data_hash", "start", "step", "frames_max", "reverse", "crop", "set"'


def table(head, lines):
    cell = lambda text, tag: f"<{tag}>{escape.escape(str(text))}</{tag}>"
    return ("<table><tr>" + "".join(cell(h, "th") for h in head) + "</tr>"
            + "".join("<tr>" + "".join(cell(c, "td") for c in line) + "</tr>" for line in lines) + "</table>")


def from_markdown(text):
    lines = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in text.splitlines()]
    return table(lines[0], lines[2:])


def described(run):
    """A run in words."""
    words = [tables.name_of(run["source"]), f"start {run['start']}", f"step {run['step']}"] + (["reverse"] if run["reverse"] else [])
    words += [f"{run['frames_max']} frames"] if run["frames_max"] else []
    words += [f"crop {run['crop']}"] if run["crop"] != "0,0,0,0" else []
    words += [f"{key}={value}" for key, value in json.loads(run["set"]).items()]
    return ", ".join(words)


def spec_of(run, folder):
    return {"binary": os.path.join(folder, "binaries", run["binary_hash"][:16], "fovea"), "source": run["source"], "start": run["start"],
            "step": run["step"], "frames": run["frames_max"], "reverse": run["reverse"], "set": json.loads(run["set"]),
            "crop": [int(n) for n in run["crop"].split(",")], "size": (run["width"], run["height"])}


def picture(run, folder):
    """That the run draws itself; it is made again for it. Empty where it cannot be."""
    with tempfile.TemporaryDirectory() as scratch:
        path = os.path.join(scratch, "run.png")
        try:
            words = one.command(spec_of(run, folder), scratch, ["--picture", path, "--quiet"])
            subprocess.run(words, capture_output=True, check=True, timeout=one.TIMEOUT_S)
            with open(path, "rb") as file:
                return f'<img alt="" src="data:image/png;base64,{base64.b64encode(file.read()).decode()}">'
        except (OSError, subprocess.SubprocessError) as why:
            return f"<p>no picture: {escape.escape(str(why))}</p>"


def frames_of(db, key):
    found = db.execute("SELECT * FROM frames WHERE run = ? ORDER BY i", [key]).fetchnumpy()
    return {name: np.ma.filled(values.astype(float), np.nan) if np.ma.isMaskedArray(values) and values.dtype.kind == "f" else np.asarray(values)
            for name, values in found.items()}


def points(frames, prefix="", map_id=None):
    found = np.stack([frames[prefix + axis] for axis in "xyz"], 1).astype(float)
    if map_id is not None:
        found[frames["map"] != map_id] = np.nan
    return found


def drawn(db, run, map_id):
    """Path, states, local scale and error of one map."""
    frames = frames_of(db, run["run"])
    of_map = lambda name: np.where(frames["map"] == map_id, frames[name].astype(float), np.nan)
    inside = frames["map"] == map_id
    truth = points(frames, "truth_")
    truth[~inside] = np.nan
    return (svg.path(truth, {f"map {map_id}": points(frames, map_id=map_id)}) + "<div>" + svg.ribbon(frames["state"]) + "<br>"
            + svg.curves(frames["frame"], {"local scale": of_map("local_scale")}, "local scale (estimated over true length, 10 frames)", logarithmic=True)
            + "<br>" + svg.curves(frames["frame"], {"error": of_map("error_m"), "sigma": of_map("sigma_m")}, "error, and stated sigma, m", logarithmic=True)
            + "</div>")


def worst(db, folder, count, pictures):
    """The maps that are furthest beyond a bar, or nearest to one."""
    found = tables.rows(db, f"""SELECT r.*, m.* EXCLUDE (run, part) FROM maps m JOIN runs r USING (run) WHERE m.rmse_m IS NOT NULL AND r.frames >= {plan.FRAMES_LEFT}
        ORDER BY (NOT m.good_error OR NOT m.good_scale) DESC, m.rmse_m / m.path_m DESC LIMIT {int(count)}""")
    parts = ["<h2>Worst maps</h2><p>States: " + ", ".join(f'<span style="background:{colour}">&nbsp;&nbsp;</span> {name}' for name, colour
                                                         in zip(STATE_NAMES, svg.STATE_COLOURS)) + ".</p>"]
    for i, row in enumerate(found):
        line = (f"{row['poses']} poses on {row['path_m']:.1f} m: RMSE {row['rmse_m']:.3f} m ({100 * row['rmse_m'] / row['path_m']:.2f} %), largest {row['max_m']:.3f} m; "
                f"scale ratio {tables.number(row['scale_ratio'], '.2f')}, of steps {tables.number(row['step_ratio'], '.2f')}; least quality at first {row['quality_first']:.2f}")
        parts.append(f"<div class=case><h3>{escape.escape(described(row))}, map {row['map']} ({escape.escape(row['version'])})</h3><p>{line}</p>"
                     + drawn(db, row, row["map"]) + (picture(row, folder) if i < pictures else "") + "</div>")
    return "".join(parts)


def failures(db):
    found = tables.rows(db, "SELECT * FROM runs WHERE status <> 0 ORDER BY source, start LIMIT 50")
    if not found:
        return ""
    return "<h2>Runs that failed</h2>" + table(["run", "version", "status", "first line"],
                                               [[described(r), r["version"], r["status"], r["complaint"]] for r in found])


def version_hash(db, name):
    """The hash of the version that a label or the beginning of a hash names."""
    found = [each for each, in db.execute("SELECT DISTINCT binary_hash FROM runs WHERE version = ? OR starts_with(binary_hash, ?)", [name, name]).fetchall()]
    if len(found) != 1:
        have = ", ".join(f"{version} ({each[:12]})" for version, each in db.execute("SELECT DISTINCT version, binary_hash FROM runs ORDER BY ALL").fetchall())
        raise plan.Wrong(f"--compare: found {len(found)} versions {name!r}, expected one of {have}")
    return found[0]


def pairs(db, old, new):
    """Runs that both versions made, with the first frame in which they differ (NULL: in none) and the worst map of each."""
    db.execute(f"""CREATE OR REPLACE TEMP TABLE pairs AS
        WITH worst AS (SELECT run, max(100 * rmse_m / path_m) rmse, max(step_ratio) ratio, count(*) maps, count_if(NOT good_error OR NOT good_scale) bad FROM maps GROUP BY run),
        a AS (SELECT * FROM runs WHERE binary_hash = $old), b AS (SELECT * FROM runs WHERE binary_hash = $new)
        SELECT a.* EXCLUDE (part), b.run new_run, wa.rmse old_rmse, wb.rmse new_rmse, wa.ratio old_ratio, wb.ratio new_ratio, coalesce(wa.bad, 0) old_bad, coalesce(wb.bad, 0) new_bad,
               a.frames_tracking + a.frames_weak old_posed, b.frames_tracking + b.frames_weak new_posed, a.digest = b.digest AND a.status = b.status equal
        FROM a JOIN b USING ({SAME}) LEFT JOIN worst wa ON wa.run = a.run LEFT JOIN worst wb ON wb.run = b.run""", {"old": old, "new": new})
    db.execute("""CREATE OR REPLACE TEMP TABLE differing AS
        SELECT p.run, min(x.i) i, arg_min(x.frame, x.i) frame, arg_min(x.state, x.i) old_state, arg_min(y.state, x.i) new_state
        FROM pairs p JOIN frames x ON x.run = p.run JOIN frames y ON y.run = p.new_run AND y.i = x.i WHERE NOT p.equal AND x.digest <> y.digest GROUP BY p.run""")
    return tables.rows(db, """SELECT p.*, d.i differ_i, d.frame differ_frame, d.old_state, d.new_state FROM pairs p LEFT JOIN differing d USING (run)
        ORDER BY p.equal, p.new_bad - p.old_bad DESC, coalesce(p.new_rmse, 1e9) - coalesce(p.old_rmse, 1e9) DESC""")


def side_by_side(db, names, count):
    old, new = (version_hash(db, name) for name in names)
    found = pairs(db, old, new)
    changed = [p for p in found if not p["equal"]]
    number = lambda value: tables.number(value, ".2f")
    parts = [f"<h2>{escape.escape(names[0])} and {escape.escape(names[1])}</h2><p>{len(found)} runs of both, {len(found) - len(changed)} with the same bits. "
             f"Maps beyond a bar: {sum(p['old_bad'] for p in found)} and {sum(p['new_bad'] for p in found)}.</p>"]
    if not changed:
        return "".join(parts)
    first = lambda p: ("in no pose" if p["differ_i"] is None else
                       f"{p['differ_frame']} (the {p['differ_i'] + 1}th), {STATE_NAMES[p['old_state']]} / {STATE_NAMES[p['new_state']]}")
    parts.append("<p>Runs that differ, those that became worse first. They are the same to the bit up to the first differing frame.</p>" + table(
        ["run", "first differing frame, states", "maps beyond a bar", "RMSE % of the worst map", "step ratio", "posed"],
        [[described(p), first(p), f"{p['old_bad']} / {p['new_bad']}", f"{number(p['old_rmse'])} / {number(p['new_rmse'])}",
          f"{number(p['old_ratio'])} / {number(p['new_ratio'])}", f"{p['old_posed']} / {p['new_posed']}"] for p in changed[:200]]))
    for p in [each for each in changed if each["differ_i"] is not None][:count]:
        a, b = frames_of(db, p["run"]), frames_of(db, p["new_run"])
        mark = p["differ_frame"]
        parts.append(f"<div class=case><h3>{escape.escape(described(p))}: first differing frame {mark}</h3>"
                     + svg.path(points(a, "truth_"), {names[0]: points(a), names[1]: points(b)}) + "<div>" + svg.ribbon(a["state"]) + "<br>" + svg.ribbon(b["state"])
                     + "<br>" + svg.curves(a["frame"], {names[0]: a["error_m"], names[1]: b["error_m"]}, "error, m", mark) + "</div></div>")
    return "".join(parts)


def html(db, folder, compare=None, count=12, pictures=4):
    keys = [key for key, in db.execute("SELECT run FROM runs").fetchall()]
    parts = ["<!doctype html><meta charset=utf-8><title>Fovea: a sweep</title><style>" + STYLE + "</style><h1>A sweep of "
             + f"{len(keys)} runs</h1>", from_markdown(tables.summary(db, keys))]
    if compare:
        parts.append(side_by_side(db, compare, min(count, 12)))
    return "".join(parts + [failures(db), worst(db, folder, count, pictures)])
