#!/usr/bin/env python3
"""Bounded work: derive and check the worst-case counts of instructions (tests/bounds), under qemu.

    tools/bounds.py            all runs at 640x480, with NEON and in plain C; writes the tables of docs/bounds.md
    tools/bounds.py --check    some runs at 320x240 with small capacities, with NEON only; writes nothing

Either ends with 1 where a run took more than its bound, and tells by how many times each bound is over the largest count. Needs the
program: make BUILD=build-aarch64 CROSS=aarch64-linux-gnu- build-aarch64/bounds, as `make bounds` does.
"""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build-aarch64"
DOCUMENT = ROOT / "docs" / "bounds.md"
SETS = {"neon": ("NEON", []), "c": ("plain C", ["--brief", "--frames", "30"])}  # plain C takes ten times as long
STEP = ("pyramid", "features", "stereo", "odometry", "encode", "the rest of the step")
UNIT = 375000  # instructions: 0.25 ms at 1.5 of them per ns
SMALL = "--brief --width 320 --height 240 --features 500 --keyframes 24 --landmarks 1000 --frames 50".split()


class Counts:
    """What a run of the program printed."""

    def __init__(self, text):
        self.capacities, self.ways, self.terms, self.bounds = {}, {}, {}, {}
        for line in text.splitlines():
            kind, name, *rest = line.split("\t")
            if kind == "capacity":
                self.capacities[name] = int(rest[0])
            elif kind == "way":
                self.ways[name, int(rest[0])] = rest[1]
            elif kind == "term":
                way, count, each, what, often = rest
                self.terms.setdefault(name, []).append((int(way), float(count), float(each), what, often))
            elif kind == "bound":
                total, way, most, times, run = rest
                self.bounds[name] = {"sum": float(total), "way": int(way), "most": int(most), "times": int(times), "run": run}


def count(kernel_set, options, folder):
    """Run the program with one set of kernels; its counts, and whether all are within their bounds."""
    plugin, counter = folder / "count.so", folder / "count"
    if not plugin.exists():
        subprocess.run(["cc", "-shared", "-fPIC", "-O2", ROOT / "tools/count/count.c", "-o", plugin], check=True)
    counter.write_bytes(bytes(4096))
    environment = dict(os.environ, FOVEA_CPU=kernel_set, FOVEA_COUNT_FILE=str(counter), QEMU_PLUGIN=str(plugin))
    done = subprocess.run([ROOT / "tools/emulate.sh", BUILD / "bounds", *options], cwd=ROOT, env=environment, text=True,
                          stdout=subprocess.PIPE, check=False)
    if done.returncode not in (0, 1):
        sys.exit(f"tools/bounds.py: {BUILD / 'bounds'} ended with {done.returncode}")
    return Counts(done.stdout), done.returncode == 0


def short(instructions):
    """A count in thousands or millions."""
    for unit, text in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if instructions >= unit:
            digits = 0 if instructions >= 100 * unit else 1 if instructions >= 10 * unit else 2
            return f"{instructions / unit:.{digits}f}{text}"
    return f"{instructions:.0f}"


def times_over(bound):
    """By how many times a bound is over the largest count."""
    return f"{bound['sum'] / bound['most']:.1f}" if bound["most"] else "-"


def step_of(counts):
    """The step: the sum of its stages, of their bounds and of their largest counts."""
    total = {key: sum(counts.bounds[name][key] for name in STEP) for key in ("sum", "most")}
    return f"{short(total['sum'])} | {short(total['most'])} | {times_over(total)}"


def overview(counts):
    """Every bound, with NEON and in plain C, beside the largest count."""
    neon, plain = counts["neon"], counts["c"]
    lines = ["| stage or unit | bound, NEON | counted | times | in the run | bound, plain C | counted | times |",
             "| --- | ---: | ---: | ---: | --- | ---: | ---: | ---: |",
             f"| the step: one camera, all stages together | {step_of(neon)} | sum of the runs' largest | {step_of(plain)} |"]
    for name, bound in neon.bounds.items():
        other = plain.bounds[name]
        counted = [short(b["most"]) if b["times"] else "never ran" for b in (bound, other)]
        run = bound["run"] if bound["times"] else ""
        lines.append(f"| {name} | {short(bound['sum'])} | {counted[0]} | {times_over(bound)} | {run} "
                     f"| {short(other['sum'])} | {counted[1]} | {times_over(other)} |")
    return lines


def derivation(counts):
    """The terms of every bound."""
    neon, plain = counts["neon"], counts["c"]
    lines = []
    for name, bound in neon.bounds.items():
        terms = neon.terms.get(name, [])
        other = {(way, what): each for way, _, each, what, _ in plain.terms.get(name, [])}
        if len(terms) < 2:
            continue
        lines += ["", f"### {name}", ""]
        for way in sorted({term[0] for term in terms}):
            mine = sorted((t for t in terms if t[0] == way), key=lambda t: -t[1] * t[2])
            total = sum(t[1] * t[2] for t in mine)
            title = neon.ways.get((name, way), "")
            dearest = ", the dearest way" if way and way == bound["way"] else ""
            if way:
                lines += [f"One way: {title}; {short(total)} instructions with NEON{dearest}.", ""]
            elif len({term[0] for term in terms}) > 1:
                lines += [f"In all ways: {short(total)} instructions with NEON.", ""]
            lines += ["| what | how often at most | times | each, NEON | each, C | product, NEON |",
                      "| --- | --- | ---: | ---: | ---: | ---: |"]
            for _, times, each, what, often in mine:
                if times:
                    lines.append(f"| {what} | {often} | {times:.0f} | {each:.0f} | {other[way, what]:.0f} | {short(times * each)} |")
            lines.append("")
    return lines


def write(counts):
    """Put the tables between their markers."""
    text = DOCUMENT.read_text()
    tables = {"capacities": [f"{name} {value}" for name, value in counts["neon"].capacities.items()],
              "overview": overview(counts), "derivation": derivation(counts)}
    tables["capacities"] = ["`" + "`, `".join(tables["capacities"]) + "`"]
    for name, lines in tables.items():
        begin, end = f"<!-- {name}:begin (written by make bounds) -->\n", f"<!-- {name}:end -->"
        if begin not in text or end not in text:
            sys.exit(f"{DOCUMENT}: found no '{begin.strip()}' and '{end}', expected both")
        before, rest = text.split(begin)
        text = before + begin + "\n".join(lines).strip("\n") + "\n" + end + rest.split(end)[1]
    DOCUMENT.write_text(text)


def tell(title, counts):
    """The bounds on the terminal."""
    print(f"{title}: bound, largest count, how many times over it")
    for name, bound in counts.bounds.items():
        over = f"  over {UNIT / 1e3:.0f} k" if bound["most"] > UNIT and ":" in name else ""
        print(f"  {name:42s} {short(bound['sum']):>9s} {short(bound['most']):>9s} {times_over(bound):>8s}{over}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="a brief check that writes nothing")
    check = parser.parse_args().check
    counts, good = {}, True
    with tempfile.TemporaryDirectory() as folder:
        for kernel_set, (title, options) in SETS.items():
            if check and kernel_set != "neon":
                continue
            counts[kernel_set], within = count(kernel_set, SMALL if check else options, pathlib.Path(folder))
            tell(title, counts[kernel_set])
            good = good and within
    if not check:
        write(counts)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
