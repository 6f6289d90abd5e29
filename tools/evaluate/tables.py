"""Tables in Markdown of results: the summary of a sweep, and the tables that are committed beside this file."""
import json
import os

import faults
import plan

WRONG_RATIO = 3.0  # of step lengths, estimated over true, in a map: the map is plainly wrong
STARTS_ODOMETRY = "0-36/2"

# name, kind, frames
RECORDINGS = [("euroc_mh05_a", "euroc", 270), ("kitti00_a", "kitti", 80), ("kitti06_a", "kitti", 51), ("handheld_7scenes_a", "tum", 250)]
CAMERA_HEIGHT_M = {"kitti00_a": 1.65, "kitti06_a": 1.65}  # A. Geiger et al., IJRR 2013
ROAD = [("kitti01_a", "kitti"), ("kitti00_a", "kitti"), ("kitti06_a", "kitti")]

HELP = {"odometry": ("renew odometry.md: errors on recordings over start frames, memory", "build/evaluate"),
        "road": ("renew road.md: maps of drives, forward from start frames 0 to 30", "build/evaluate"),
        "operations": ("renew operations.md: what preprocessing does to odometry", "build/evaluate"),
        "faults": ("renew faults.md: pictures that are of no use", "build/evaluate"),
        "features_odometry": ("renew features_odometry.md: what the method of features does to odometry", "build/evaluate")}


def name_of(source):
    """The part of a URI that tells recordings apart, at a glance."""
    return source.rstrip("/").rsplit("/", 1)[-1]


def chosen(db, keys):
    """A table `chosen` of the runs with these keys."""
    db.execute("CREATE OR REPLACE TEMP TABLE keys (run VARCHAR)")
    if keys:
        import pyarrow
        db.register("given_keys", pyarrow.table({"run": keys}))
        db.execute("INSERT INTO keys SELECT DISTINCT run FROM given_keys")
    db.execute("CREATE OR REPLACE TEMP TABLE chosen AS SELECT r.* FROM runs r SEMI JOIN keys USING (run)")
    return db


def rows(db, query, parameters=()):
    found = db.execute(query, list(parameters))
    names = [each[0] for each in found.description]
    return [dict(zip(names, values)) for values in found.fetchall()]


def number(value, form):
    return "" if value is None or value != value else format(value, form)


def markdown(head, lines):
    return "\n".join(["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
                     + ["| " + " | ".join(line) + " |" for line in lines]) + "\n"


def summary(db, keys):
    """Of all runs of a source and a version with the same parameters; seeds of a source are one."""
    chosen(db, keys)
    found = rows(db, f"""
        SELECT regexp_replace(c.source, 'seed=[0-9]+', 'seed=*') source, c.version, c.binary_hash, c."set", count(DISTINCT c.run) runs,
               count(DISTINCT CASE WHEN c.status <> 0 THEN c.run END) failed, count(m.run) maps, count_if(NOT m.good_error) bad_error,
               count_if(NOT m.good_scale) bad_scale, count_if(m.step_ratio > {WRONG_RATIO}) wrong, median(100 * m.rmse_m / m.path_m) rmse,
               max(100 * m.rmse_m / m.path_m) rmse_worst, median(100 * m.metric_rmse_m / m.path_m) metric,
               max(100 * m.metric_rmse_m / m.path_m) metric_worst, max(abs(m.metric_scale_percent)) metric_scale, max(m.scale_ratio) ratio_worst, median(abs(m.drift_percent_100m)) drift,
               avg(m.nees6_keyframe) nees, 100 * avg(m.outside_keyframe) outside, avg(m.nees6_apart) nees_apart, 100 * avg(m.outside_apart) outside_apart
        FROM chosen c LEFT JOIN maps m ON m.run = c.run AND c.frames >= {plan.FRAMES_LEFT} GROUP BY ALL ORDER BY ALL""")
    head = ["source", "version", "runs (failed)", "maps", "error beyond the bar", "scale beyond 1.5", f"steps beyond {WRONG_RATIO:g}",
            "RMSE %, median (worst)", "in metres, not scaled: the same, scale off by %, worst", "scale ratio, worst", "drift % per 100 m", "keyframe: NEES/6, % outside 99.9 %", "50 frames: the same"]
    described = lambda r: name_of(r["source"]) + "".join(f", {key}={value}" for key, value in json.loads(r["set"]).items())
    return markdown(head, [[described(r), r["version"], f"{r['runs']} ({r['failed']})", str(r["maps"]), str(r["bad_error"] or 0), str(r["bad_scale"] or 0),
                            str(r["wrong"] or 0), f"{number(r['rmse'], '.2f')} ({number(r['rmse_worst'], '.2f')})",
                            "" if r["metric"] is None else f"{number(r['metric'], '.2f')} ({number(r['metric_worst'], '.2f')}), {number(r['metric_scale'], '.2f')}",
                            number(r["ratio_worst"], ".2f"),
                            number(r["drift"], ".1f"), f"{number(r['nees'], '.2f')}, {number(r['outside'], '.1f')}",
                            f"{number(r['nees_apart'], '.2f')}, {number(r['outside_apart'], '.1f')}"] for r in found])


# ---- odometry.md ----------------------------------------------------------------------------------------------

def sources(arguments, recordings):
    """[(name, URI)] of those that are there."""
    found = []
    for name, kind, *_ in recordings:
        folder = os.path.join(arguments.data, name)
        if os.path.isdir(folder):
            found.append((name, f"{kind}:{folder}"))
        else:
            print(f"SKIPPED {name}: not in {arguments.data}")
    return found


def odometry_plan(binary, arguments):
    found = []
    for name, uri in sources(arguments, RECORDINGS):
        found += plan.specs([binary], [uri], STARTS_ODOMETRY)
        if name in CAMERA_HEIGHT_M:
            height = {"scale.source": "camera_height", "scale.camera_height_m": str(CAMERA_HEIGHT_M[name])}
            found += plan.specs([binary], [uri], STARTS_ODOMETRY, sets=[height])
    return found


ODOMETRY_HEAD = """# Errors on recordings

Recordings of `../shared/data`, each from start frames {starts} (every second), default configuration, of version {version}. `make evaluate` renews this page. Of each run the map with
most poses counts, aligned with the truth by a similarity. Starts are varied and not seeds: seeds of one start agree to four digits. Times are those of one sweep on a shared machine, so compare
them with each other only.

"""


def odometry_text(db, keys):
    """Of each run the map with most poses."""
    chosen(db, keys)
    db.execute("CREATE OR REPLACE TEMP TABLE largest AS SELECT c.*, m.* EXCLUDE (run, part) FROM chosen c LEFT JOIN (SELECT * FROM maps "
               "QUALIFY row_number() OVER (PARTITION BY run ORDER BY poses DESC, map) = 1) m ON m.run = c.run")
    lines, scales = [], []
    version = db.execute("SELECT any_value(version) FROM largest").fetchone()[0]
    head = ODOMETRY_HEAD.format(starts=STARTS_ODOMETRY.partition("/")[0].replace("-", " to "), version=version)
    for name, _, frames in RECORDINGS:
        here = f"FROM largest WHERE source LIKE '%/{name}'"
        r = rows(db, f"""SELECT count(*) runs, median(posed / frames) * {frames} posed, min(posed / frames) * {frames} posed_worst, median(rmse_m) ate,
            max(rmse_m) ate_worst, median(final_rmse_m) final, max(final_rmse_m) final_worst, median(rpe_m) rpe_m, median(rpe_deg) rpe_deg,
            median(mean_ms) mean_ms, median(p99_ms) p99_ms, max(resident_mib) resident
            FROM (SELECT *, frames_tracking + frames_weak posed {here} AND "set" NOT LIKE '%scale.source%')""")[0]
        if r["runs"]:
            lines.append([name, str(r["runs"]), f"{r['posed']:.0f} ({r['posed_worst']:.0f}) of {frames}", f"{r['ate']:.4f} ({r['ate_worst']:.4f})",
                          f"{r['final']:.4f} ({r['final_worst']:.4f})", f"{r['rpe_m']:.3f}, {r['rpe_deg']:.2f}",
                          f"{r['mean_ms']:.2f}, {r['p99_ms']:.2f}", f"{r['resident']:.0f}"])
        off = lambda column: f"median(100 * (1 / {column} - 1)), arg_max(100 * (1 / {column} - 1), abs(1 / {column} - 1))"
        runs, live, live_worst, final, final_worst = db.execute(
            f"""SELECT count(*), {off('scale')}, {off('final_scale')} {here} AND "set" LIKE '%scale.source%'""").fetchone()
        if runs:
            scales.append([name, str(runs), str(CAMERA_HEIGHT_M[name]), f"{live:+.1f} ({live_worst:+.1f})", f"{final:+.1f} ({final_worst:+.1f})"])
    return (head + markdown(["recording", "runs", "posed, median (worst)", "ATE m, median (worst)", "after all optimisation", "RPE 1 s: m, deg",
                      "CPU ms, mean, p99", "resident MiB"], lines)
            + "\n" + markdown(["recording", "runs", "camera height m", "scale off by %, median (worst)", "after all optimisation"], scales))


# ---- road.md --------------------------------------------------------------------------------------------------

def road_plan(binary, arguments):
    return plan.specs([binary], [uri for _, uri in sources(arguments, ROAD)], "0-30")


ROAD_HEAD = """# Maps on drives

Forward drives of `../shared/data`, each from start frames 0 to 30, default configuration, of version {version}. `make evaluate` renews this page. Each map
of at least 10 poses is judged alone, aligned with the truth by a similarity. *Local scale* is estimated over true distance between frames 10
apart; its ratio is the largest over the smallest within a map. The *step ratio* is the same of single steps. The error bar is {rmse:g} % of the true path (root mean square) and {most:g} % (largest), plus 0.05 m, the
error of the truth.

"""


def road_text(db, keys):
    from metrics import MAX_SHARE, RMSE_SHARE
    chosen(db, keys)
    maps = rows(db, """SELECT c.source, c.version, c.start, c.frames, c.status, m.*, (SELECT median(sigma_m) FROM frames f WHERE f.run = m.run AND f.map = m.map) sigma,
        (SELECT count(*) FROM frames f WHERE f.run = m.run AND f.map = m.map AND f.state = 1) tracking
        FROM chosen c LEFT JOIN maps m USING (run) ORDER BY c.source, c.start, m.map""")
    text = ROAD_HEAD.format(version=maps[0]["version"], rmse=100 * RMSE_SHARE, most=100 * MAX_SHARE)
    lines = []
    for name, _ in ROAD:
        of = [m for m in maps if name_of(m["source"]) == name]
        judged = [m for m in of if m["rmse_m"] is not None]
        wrong = sorted({m["start"] for m in judged if m["step_ratio"] > WRONG_RATIO})
        shares = sorted(100 * m["rmse_m"] / m["path_m"] for m in judged)
        if judged:
            lines.append([name, str(len({m["start"] for m in of})), str(len(judged)), f"{shares[len(shares) // 2]:.2f} ({shares[-1]:.2f})",
                          str(sum(not m["good_error"] for m in judged)), str(sum(not m["good_scale"] for m in judged)), str(len(wrong)),
                          ", ".join(map(str, wrong)) or "none"])
    text += markdown(["recording", "starts", "maps", "RMSE % of the path, median (worst)", "beyond the error bar", "scale ratio beyond 1.5",
                      f"step ratio beyond {WRONG_RATIO:g}", "their starts"], lines)
    bad = [m for m in maps if m["rmse_m"] is not None and not (m["good_error"] and m["good_scale"])]
    text += "\n## Maps beyond a bar\n\n" + markdown(
        ["recording", "start", "map", "poses (`tracking`)", "true path m", "RMSE m", "largest m", "stated sigma m, median", "scale ratio", "step ratio",
         "least quality, second to tenth pose"],
        [[name_of(m["source"]), str(m["start"]), str(m["map"]), f"{m['poses']} ({m['tracking']})", f"{m['path_m']:.1f}", f"{m['rmse_m']:.3f}",
          f"{m['max_m']:.3f}", number(m["sigma"], ".4f"), number(m["scale_ratio"], ".2f"),
          number(m["step_ratio"], ".1f"), f"{m['quality_first']:.2f}"] for m in bad])
    return text


# ---- operations.md --------------------------------------------------------------------------------------------

STARTS_OPERATIONS = "0,3,7,11,15"

# name, what is set
CHAINS = [("none", {}), ("denoise", {}), ("denoise, median", {"denoise_method": "median"}), ("denoise, bilateral", {"denoise_method": "bilateral"}),
          ("normalize", {}), ("normalize, deviation", {"normalize_method": "deviation"}), ("sharpen", {}), ("histogram_equalization", {}),
          ("contrast_enhancement", {}), ("gamma 0.6", {"gamma": "0.6"}), ("gamma 1.6", {"gamma": "1.6"}),
          ("denoise + contrast_enhancement", {}), ("contrast_enhancement + sharpen", {})]

OPERATIONS_HEAD = """# What preprocessing does to odometry

Recordings of `../shared/data`, each from start frames {starts}, with one chain of operations that features alone see, default parameters but those named, of version
{version}. `make evaluate` renews this page. *Posed*: frames with a pose, of all processed. *Error*: of the largest map of each run, root mean square in % of the true path, median
over the starts, the worst in brackets. *Time*: processor time of a whole frame over that without a chain, median over the starts; times of one sweep on a shared machine.

"""


def chain_set(name, more):
    """What a chain sets, of its name: operations before the comma, joined by +."""
    words = [word.split()[0] for word in name.split(",")[0].split(" + ")] if name != "none" else []
    return {"image.operations": f"[{', '.join(words)}]", **{f"image.{key}": value for key, value in more.items()}}


def operations_plan(binary, arguments):
    sets = [chain_set(name, more) for name, more in CHAINS]
    return [spec for _, uri in sources(arguments, RECORDINGS) for spec in plan.specs([binary], [uri], STARTS_OPERATIONS, sets=sets)]


def operations_text(db, keys):
    chosen(db, keys)
    found = rows(db, """SELECT c.source, c.version, c."set", avg((frames_tracking + frames_weak) / frames) posed, median(100 * m.rmse_m / m.path_m) error,
        max(100 * m.rmse_m / m.path_m) worst, median(c.mean_ms) ms FROM chosen c LEFT JOIN (SELECT * FROM maps
        QUALIFY row_number() OVER (PARTITION BY run ORDER BY poses DESC, map) = 1) m ON m.run = c.run GROUP BY ALL""")
    text = OPERATIONS_HEAD.format(version=found[0]["version"], starts=STARTS_OPERATIONS.replace(",", ", "))
    for name, *_ in RECORDINGS:
        of = {tuple(sorted(json.loads(r["set"]).items())): r for r in found if name_of(r["source"]) == name}
        if not of:
            continue
        at = lambda chain: of[tuple(sorted(chain_set(*chain).items()))]
        lines = [[chain[0], f"{100 * at(chain)['posed']:.1f} %", f"{number(at(chain)['error'], '.3f')} ({number(at(chain)['worst'], '.3f')})",
                  f"{at(chain)['ms'] / at(CHAINS[0])['ms']:.2f}"] for chain in CHAINS]
        text += f"## {name}\n\n" + markdown(["chain", "posed", "error %, median (worst)", "time"], lines) + "\n"
    return text.rstrip("\n") + "\n"


# ---- features_odometry.md -------------------------------------------------------------------------------------

STARTS_METHODS = "0-18/2"
METHODS = ["fast", "orb", "harris", "shi_tomasi"]

METHODS_HEAD = """# What the method of features does to odometry

Recordings of `../shared/data`, each from start frames {starts}, with one `features.method`, all else by default, of version {version}. `make evaluate` renews this page.
*Posed*: frames with a pose, of all processed. *Error*: of the largest map of each run, root mean square in % of the true path, as published live and after all optimisation, median
over the starts, the worst in brackets. *Time*: processor time of a whole frame, mean and 99th percentile, medians over the starts, and the mean over that of `fast`; times of one sweep on a shared machine.

"""


def methods_plan(binary, arguments):
    sets = [{"features.method": method} for method in METHODS]
    return [spec for _, uri in sources(arguments, RECORDINGS) for spec in plan.specs([binary], [uri], STARTS_METHODS, sets=sets)]


def methods_text(db, keys):
    chosen(db, keys)
    found = rows(db, """SELECT c.source, c.version, c."set", avg((frames_tracking + frames_weak) / frames) posed, median(100 * m.rmse_m / m.path_m) error,
        max(100 * m.rmse_m / m.path_m) worst, median(100 * m.final_rmse_m / m.path_m) final, max(100 * m.final_rmse_m / m.path_m) final_worst,
        median(c.mean_ms) ms, median(c.p99_ms) p99 FROM chosen c LEFT JOIN (SELECT * FROM maps
        QUALIFY row_number() OVER (PARTITION BY run ORDER BY poses DESC, map) = 1) m ON m.run = c.run GROUP BY ALL""")
    text = METHODS_HEAD.format(version=found[0]["version"], starts=", ".join(map(str, plan.numbers(STARTS_METHODS, "starts"))))
    for name, *_ in RECORDINGS:
        of = {json.loads(r["set"])["features.method"]: r for r in found if name_of(r["source"]) == name}
        if not of:
            continue
        lines = [[f"`{method}`", f"{100 * r['posed']:.1f} %", f"{number(r['error'], '.3f')} ({number(r['worst'], '.3f')})",
                  f"{number(r['final'], '.3f')} ({number(r['final_worst'], '.3f')})", f"{r['ms']:.2f}, {r['p99']:.2f}", f"{r['ms'] / of['fast']['ms']:.2f}"]
                 for method, r in ((method, of[method]) for method in METHODS)]
        text += f"## {name}\n\n" + markdown(["method", "posed", "error %, live", "error %, final", "time ms", "over fast's"], lines) + "\n"
    return text.rstrip("\n") + "\n"


def faults_plan(binary, arguments):
    return faults.specs(binary, arguments, sources)


def faults_text(db, keys):
    return faults.text(chosen(db, keys), rows, markdown, number, name_of)


PLANS = {"faults": faults_plan, "odometry": odometry_plan, "road": road_plan, "operations": operations_plan, "features_odometry": methods_plan}
TEXTS = {"faults": faults_text, "odometry": odometry_text, "road": road_text, "operations": operations_text, "features_odometry": methods_text}
