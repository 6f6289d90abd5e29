"""tools/evaluate: thousands of runs of `fovea run`, compared with the truth.

    python tools/evaluate sweep DIR --source URI... [--starts 0-30] [--steps 1-3] [--reverse both] [--set 'KEY=V|V']
    python tools/evaluate report DIR [--compare OLD NEW] [--output FILE.html]
    python tools/evaluate reliability DIR [--output FILE.md] [--svg FILE.svg]
    python tools/evaluate odometry          renews odometry.md
    python tools/evaluate road              renews road.md
    python tools/evaluate faults            renews faults.md
    python tools/evaluate operations        renews operations.md
    python tools/evaluate features_odometry renews features_odometry.md

Needs the packages of `make build/venv-sweep/ready`. See README.md beside this file."""
import argparse
import os
import shutil
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
sys.path.append(os.path.join(HERE, ".."))

for package in ("numpy", "pyarrow", "duckdb", "distributed"):
    try:
        __import__(package)
    except ImportError:
        sys.exit(f"tools/evaluate: found no Python package {package}, expected those of: make build/venv-sweep/ready")

import execute  # noqa: E402
import one  # noqa: E402
import plan  # noqa: E402
import progress  # noqa: E402
import reliability  # noqa: E402
import report  # noqa: E402
import store  # noqa: E402
import tables  # noqa: E402


def label_of(path):
    """The commit of the tree that a binary was built in, with + where it has changes; else its file's name."""
    folder = os.path.dirname(os.path.abspath(path))
    done = subprocess.run(["git", "-C", folder, "describe", "--always", "--dirty=+", "--exclude", "*"], capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else os.path.basename(path)


def binary_of(text, folder):
    """[LABEL=]PATH as a version, its program kept in the results' folder: a build meanwhile changes no run."""
    label, equals, path = text.partition("=")
    label, path = (label, path) if equals else (label_of(text), text)
    if not os.access(path, os.X_OK) or not os.path.isfile(path):
        raise plan.Wrong(f"--binary: {path}: found no program, expected fovea")
    found = one.hash_file(path)
    kept = os.path.abspath(os.path.join(folder, "binaries", found[:16]))
    if not os.path.exists(os.path.join(kept, "fovea")):
        os.makedirs(kept, exist_ok=True)
        shutil.copy2(path, os.path.join(kept, "fovea.part"))
        os.replace(os.path.join(kept, "fovea.part"), os.path.join(kept, "fovea"))
    return {"label": label, "path": os.path.join(kept, "fovea"), "hash": found, "plugins": os.path.dirname(os.path.abspath(path))}


def left(seconds):
    minutes, seconds = divmod(int(seconds + 0.5), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02} left" if hours else f"{minutes}:{seconds:02} left"


def bar(done, total, width=20):
    return "[" + "#" * (width * done // total) + "-" * (width - width * done // total) + "]"


def make(specs, folder, workers, scheduler, started=None):
    """Make the runs that the folder lacks. The number that could not be made."""
    keys = store.known(folder) if os.path.isdir(folder) else set()
    missing = [spec for spec in specs if spec["run"] not in keys]
    results = store.Store(folder)
    begin, broken = time.monotonic(), []

    def done(spec, result, error):
        if error:
            broken.append((spec, error))
        else:
            results.add(result)
        count[0] += 1
        spent = time.monotonic() - begin
        progress.show(f"sweep {bar(count[0], len(missing))}", count[0], len(missing),
                      left(spent / count[0] * (len(missing) - count[0])) + (f", {len(broken)} broken" if broken else ""))

    count = [0]
    print(f"sweep: {len(specs)} runs, {len(specs) - len(missing)} of them there", file=sys.stderr)
    try:
        if missing:
            execute.all_of(missing, workers, scheduler, done, started)
    finally:
        progress.clear()
        results.flush()
    for spec, error in broken[:5]:
        print(f"sweep: {spec['source']} start {spec['start']}: {error}", file=sys.stderr)
    if missing:
        spent = time.monotonic() - begin
        print(f"sweep: {count[0]} runs in {spent:.1f} s, {count[0] / spent:.2f} per second", file=sys.stderr)
    return len(broken)


def sweep(arguments):
    directions = {"no": (False,), "yes": (True,), "both": (False, True)}[arguments.reverse]
    binaries = [binary_of(text, arguments.folder) for text in arguments.binary or ["build/fovea"]]
    specs = plan.specs(binaries, arguments.source, arguments.starts, arguments.steps, directions, arguments.frames,
                       [plan.crop(text) for text in arguments.crop or ["0"]], plan.parameters(arguments.set or []))
    broken = make(specs, arguments.folder, arguments.workers, arguments.scheduler)
    print(tables.summary(store.read(arguments.folder), [spec["run"] for spec in specs]), end="")
    return 1 if broken else 0


def read_results(folder):
    if not os.path.isdir(os.path.join(folder, "runs")):
        raise plan.Wrong(f"{folder}: found no results, expected the folder of a sweep")
    return store.read(folder)


def write_report(arguments):
    db = read_results(arguments.folder)
    output = arguments.output or os.path.join(arguments.folder, "report.html")
    text = report.html(db, arguments.folder, arguments.compare, arguments.worst, arguments.pictures)
    with open(output, "w", encoding="utf-8") as file:
        file.write(text)
    print(output)
    return 0


def write_reliability(arguments):
    db = read_results(arguments.folder)
    text = reliability.text(db)
    for path, content in ((arguments.output or os.path.join(arguments.folder, "reliability.md"), text),
                          (arguments.svg or os.path.join(arguments.folder, "reliability.svg"), reliability.diagram(db))):
        with open(path, "w", encoding="utf-8") as file:
            file.write(content)
    print(text, end="")
    return 0


def standing(arguments):
    """Renew one of the committed tables: its plan, its runs, its text."""
    binary = binary_of(arguments.binary, arguments.folder)
    specs = tables.PLANS[arguments.command](binary, arguments)
    if make(specs, arguments.folder, arguments.workers, arguments.scheduler):
        return 1
    text = tables.TEXTS[arguments.command](store.read(arguments.folder), [spec["run"] for spec in specs])
    with open(arguments.output or os.path.join(HERE, f"{arguments.command}.md"), "w", encoding="utf-8") as file:
        file.write(text)
    print(text, end="")
    return 0


def how_to_run(parser):
    parser.add_argument("--workers", type=int, default=execute.processors(), help="processes of this machine; 0: in this one")
    parser.add_argument("--scheduler", help="of a Dask cluster, tcp://HOST:PORT, in place of processes of this machine")


def read_arguments():
    parser = argparse.ArgumentParser(prog="tools/evaluate", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    each = commands.add_parser("sweep", help="make runs, and add their results to a folder")
    each.set_defaults(work=sweep)
    each.add_argument("folder", help="of the results; runs that are there are not made again")
    each.add_argument("--source", action="append", required=True, help="URI; {1..100} in it: each of these numbers; may be repeated")
    each.add_argument("--starts", default="0", help="start frames: 0-30, 0-60/5, 3,7 or all (that leave 15 frames)")
    each.add_argument("--steps", default="1", help="of --step: 1-3")
    each.add_argument("--frames", default="0", help="most frames of a run; 0: all")
    each.add_argument("--reverse", choices=("no", "yes", "both"), default="no")
    each.add_argument("--crop", action="append", metavar="PIXELS", help="take no features this near the sides: N or LEFT,TOP,RIGHT,BOTTOM; may be repeated")
    each.add_argument("--set", action="append", metavar="KEY=V|V", help="values of a key of the configuration; may be repeated: all combinations")
    each.add_argument("--binary", action="append", metavar="[LABEL=]PATH", help="a version (build/fovea); may be repeated")
    how_to_run(each)
    each = commands.add_parser("report", help="write results as HTML")
    each.set_defaults(work=write_report)
    each.add_argument("folder")
    each.add_argument("--compare", nargs=2, metavar=("OLD", "NEW"), help="labels or hashes of two versions")
    each.add_argument("--worst", type=int, default=12, help="maps that are drawn")
    each.add_argument("--pictures", type=int, default=4, help="of these: runs that are made again for their picture")
    each.add_argument("--output")
    each = commands.add_parser("reliability", help="stated uncertainty against true error, as tables and a diagram")
    each.set_defaults(work=write_reliability)
    each.add_argument("folder")
    each.add_argument("--output", help="the tables (reliability.md in the folder)")
    each.add_argument("--svg", help="the diagram (reliability.svg in the folder)")
    for name, (text, folder) in tables.HELP.items():
        each = commands.add_parser(name, help=text)
        each.set_defaults(work=standing)
        each.add_argument("--binary", "--fovea", default="build/fovea", metavar="[LABEL=]PATH")
        each.add_argument("--data", default=os.environ.get("FOVEA_DATA", "../shared/data"))
        each.add_argument("--folder", default=folder, help=f"of the results ({folder})")
        each.add_argument("--output", help=f"({name}.md beside this program)")
        how_to_run(each)
    return parser.parse_args()


def main():
    arguments = read_arguments()
    try:
        return arguments.work(arguments)
    except plan.Wrong as wrong:
        print(f"tools/evaluate: {wrong}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("tools/evaluate: interrupted; the same command goes on from here", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
