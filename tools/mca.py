#!/usr/bin/env python3
"""Estimate the inner loops of the NEON kernels with llvm-mca, on Cortex-A72, Cortex-A76 and Neoverse N1.

For each kernel: its vector loops (innermost ones; where several, the fattest), instructions, and cycles per pass on each
core; for matrix products also multiply-adds per cycle, and the fraction of what the core does when it is given nothing but
independent products of that kind. The model knows pipelines, not caches: loads hit, branches are
predicted.

LLVM (14, 16 and 19 looked at) has no model of the Cortex-A72 or A76 of their own: it schedules both as a Cortex-A57, so
their columns are equal. That is close for an A72, and much too slow for an A76. Neoverse N1 is the A76's core made for
servers, and LLVM 17 and later know it: read its column for an A76. Which model each column was made with stands in its
head, as the report of llvm-mca names its units. Instructions that a core lacks make a dash; i8mm needs a Neoverse N2.

Usage: tools/mca.py [NAME]      kernels whose name contains NAME; default all. Prints a Markdown table.
"""
import os
import re
import shutil
import subprocess
import sys

COMPILER = "aarch64-linux-gnu-gcc"
CORES = {"cortex-a72": "Cortex-A72", "cortex-a76": "Cortex-A76", "neoverse-n1": "Neoverse N1", "neoverse-n2": "Neoverse N2"}
MARCH = {"dotprod": "armv8.2-a+dotprod", "i8mm": "armv8.2-a+dotprod+i8mm"}
PRODUCTS = {"sdot": 16, "udot": 16, "usdot": 16, "smmla": 32, "ummla": 32, "usmmla": 32}  # multiply-adds of an instruction
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
    loops = [[l for l in body[a:b + 1] if re.match(r"^\t[a-z]", l)] for a, b in inner]
    return [loop for loop in loops if "\tret" not in loop]  # else: a jump back from code moved out of the way


def newest_mca():
    """The llvm-mca of the highest version; plain llvm-mca where no numbered one is there."""
    numbered = [name for version in range(40, 13, -1) if shutil.which(name := f"llvm-mca-{version}")]
    return (numbered + [name for name in ["llvm-mca"] if shutil.which(name)] + [None])[0]


def simulate(mca, cpu, loop):
    """Report of llvm-mca for 100 passes; empty where the core lacks an instruction."""
    text = re.sub(r"(movi\tv\d+\.16b, 0x)f{14}", r"\1", "\n".join(loop) + "\n")  # GCC writes negative bytes with 64 bits
    done = subprocess.run([mca, "-march=aarch64", "-mcpu=" + cpu, "-iterations=100"], input=text, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else ""


def cycles(report):
    found = re.search(r"^Total Cycles:\s+(\d+)", report, re.M)
    return float(found.group(1)) / 100 if found else None


def model_name(mca, cpu):
    """Of the processor whose units the report names: A57UnitB and the like."""
    found = re.search(r"^\[[\d.]+\]\s+- (\w+?)(?:Unit|Write|$)", simulate(mca, cpu, ["\tadd x0, x0, x1"]), re.M)
    return found.group(1) if found else "unknown"


def weight(loop):
    """What makes a loop the one that counts: its products, or else its vector instructions."""
    return (sum(PRODUCTS.get(l.split()[0], 0) for l in loop), sum(bool(VECTOR.search(l)) for l in loop))


def loops_of(path):
    """Yield (label, loop): the fattest loops of each kernel; static functions not inlined belong to the next kernel."""
    helpers = []
    for name, body in functions(assembly(path)):
        loops = innermost_loops(body)
        if not name.startswith("fv_k_"):
            helpers += [(f" ({name.split('.')[0]})", loop) for loop in loops]
            continue
        loops, helpers = [("", loop) for loop in loops] + helpers, []
        if not loops:
            continue
        kind = 0 if max(weight(loop)[0] for _, loop in loops) > 0 else 1
        most = max(weight(loop)[kind] for _, loop in loops)
        for where, loop in loops:
            if weight(loop)[kind] > 0 and weight(loop)[kind] * 2 >= most:
                yield name[5:] + where, loop


def peak(mca, cpu, loop):
    """Multiply-adds per cycle of the loop's kind of product alone, on 24 accumulators."""
    name = max((l.split()[0] for l in loop), key=lambda n: PRODUCTS.get(n, 0))
    took = cycles(simulate(mca, cpu, [f"\t{name} v{i}.4s, v30.16b, v31.16b" for i in range(24)]))
    return 24 * PRODUCTS[name] / took


def row(mca, label, loop):
    products, vectors = weight(loop)
    cells = []
    for cpu in CORES:
        took = cycles(simulate(mca, cpu, loop))
        cell = "–" if took is None else f"{took:.1f}"
        if took is not None and products:
            cell += f" ({products / took:.0f} MAC/cycle, {products / took / peak(mca, cpu, loop):.0%} of peak)"
        cells.append(cell)
    return f"| {label} | {len(loop)} | {vectors} | " + " | ".join(cells) + " |"


def main():
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    mca = newest_mca()
    if not mca or not shutil.which(COMPILER):
        sys.exit("tools/mca.py: needs llvm-mca and " + COMPILER + ": run tools/install.sh cross")
    heads = [f"{name}, as {model_name(mca, cpu)}" for cpu, name in CORES.items()]
    print("| kernel, inner loop | instructions | of them vector | " + " | ".join(heads) + " |")
    print("| --- | ---: | ---: |" + " ---: |" * len(heads))
    folder = "src/kernels/neon"
    for path in sorted(os.listdir(folder)):
        if path.endswith(".c"):
            for label, loop in loops_of(os.path.join(folder, path)):
                if wanted in label:
                    print(row(mca, label, loop))


if __name__ == "__main__":
    main()
