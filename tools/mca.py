#!/usr/bin/env python3
"""Estimate the inner loops of the NEON kernels on Cortex-A76 and Cortex-A72 with llvm-mca.

For each kernel: its vector loops (innermost ones; where several, the fattest), instructions, cycles per pass on either core, and
the work of one pass where the kernel's loop step is known from its stores. The model knows pipelines, not caches: loads
hit, branches are predicted. LLVM before 15 models both cores as Cortex-A57, which makes the columns equal.

Usage: tools/mca.py [NAME]      kernels whose name contains NAME; default all. Prints a Markdown table.
"""
import os
import re
import shutil
import subprocess
import sys

COMPILER = "aarch64-linux-gnu-gcc"
MARCH = {"dotprod": "armv8.2-a+dotprod", "i8mm": "armv8.2-a+dotprod+i8mm"}
VECTOR = re.compile(r"\b(v\d+\.|q\d+\b)")
BRANCH = re.compile(r"^\t(?:b|b\.?[a-z]{2}|cbn?z|tbn?z)\t(?:.*, *)?(\.L\w+)$")


def assembly(path):
    isa = os.path.basename(path)[:-2].rsplit("_", 1)[1]
    command = [COMPILER, "-std=c11", "-O3", "-ffp-contract=off", "-fsigned-char", "-march=" + MARCH.get(isa, "armv8-a"), "-Iinclude",
               "-Isrc", "-S", path, "-o", "-"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()


def functions(lines):
    """Yield (name, lines) in order."""
    name, body = None, []
    for line in lines:
        found = re.match(r"^([A-Za-z_][\w.]*):$", line)
        if found:
            name, body = found.group(1), []
        elif name and re.match(r"^\t\.size\t" + re.escape(name) + ",", line):
            yield name, body
            name = None
        elif name:
            body.append(line)


def innermost_loops(body):
    labels, ranges = {}, []
    for i, line in enumerate(body):
        if re.match(r"^\.L\w+:", line):
            labels[line.split(":")[0]] = i
        branch = BRANCH.match(line)
        if branch and branch.group(1) in labels:
            ranges.append((labels[branch.group(1)], i))
    inner = [r for r in ranges if not any(o != r and r[0] <= o[0] and o[1] <= r[1] for o in ranges)]
    return [[l for l in body[a:b + 1] if re.match(r"^\t[a-z]", l)] for a, b in inner]


def cycles(mca, cpu, loop):
    done = subprocess.run([mca, "-march=aarch64", "-mcpu=" + cpu, "-iterations=100"], input="\n".join(loop) + "\n", capture_output=True,
                          text=True)
    found = re.search(r"^Total Cycles:\s+(\d+)", done.stdout, re.M)
    return float(found.group(1)) / 100 if found else None


def main():
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    mca = shutil.which("llvm-mca") or shutil.which("llvm-mca-14")
    if not mca or not shutil.which(COMPILER):
        sys.exit("tools/mca.py: needs llvm-mca and " + COMPILER + ": run tools/install.sh cross")
    print("| kernel | instructions | of them vector | cycles per pass, Cortex-A76 | Cortex-A72 |")
    print("| --- | ---: | ---: | ---: | ---: |")
    folder = "src/kernels/neon"
    for path in sorted(os.listdir(folder)):
        if not path.endswith(".c"):
            continue
        helpers = []  # static functions that were not inlined belong to the next kernel
        for name, body in functions(assembly(os.path.join(folder, path))):
            loops = innermost_loops(body)
            if not name.startswith("fv_k_"):
                helpers += [(name, loop) for loop in loops]
                continue
            loops = [(None, loop) for loop in loops] + helpers
            helpers = []
            count = [sum(bool(VECTOR.search(l)) for l in loop) for _, loop in loops]
            if wanted not in name or not count or max(count) == 0:
                continue
            for where, loop in loops:
                vectors = sum(bool(VECTOR.search(l)) for l in loop)
                if vectors * 2 < max(count):
                    continue
                a76, a72 = cycles(mca, "cortex-a76", loop), cycles(mca, "cortex-a72", loop)
                label = name if where is None else f"{name} ({where.split('.')[0]})"
                print(f"| {label} | {len(loop)} | {vectors} | {a76:.1f} | {a72:.1f} |" if a76 else f"| {label} | ? | | | |")


if __name__ == "__main__":
    main()
