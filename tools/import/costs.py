"""What work takes on each kernel set, over what its formula (`cost` in lower_*.py) says: the table costs.txt, measured by
`tests/import/units.py --renew`. Units are cut by the slowest set, so that cuts are the same on all of them."""
import os

from layout import UNIT_COST

SETS = ("sse4", "avx2", "avx512")
PATH = os.path.join(os.path.dirname(os.path.abspath(__file__)), "costs.txt")
MARGIN = 125  # percent: of what was measured, for other shapes, and as a machine that others use is slower at times
TITLE = "# work"


def read(path=PATH):
    """{work: percent of the formula by set}, 0: not measured."""
    with open(path, encoding="utf-8") as file:
        lines = [line.split() for line in file if not line.startswith("#")]
    return {work: {s: 0 if figure == "-" else int(figure) for s, figure in zip(SETS, figures)} for work, *figures in lines}


def comment(path=PATH):
    """The lines that the table begins with, but for its title."""
    with open(path, encoding="utf-8") as file:
        return [line for line in file if line.startswith("#") and not line.startswith(TITLE)]


def write(table, lines, path=PATH):
    """`lines`: what stands before the table."""
    rows = [(work, *(table[work][s] or "-" for s in SETS)) for work in sorted(table)]
    with open(path, "w", encoding="utf-8") as file:
        file.writelines(lines)
        for work, *figures in [(TITLE, *SETS), *rows]:
            file.write(f"{work:24}{''.join(f'{figure:>8}' for figure in figures)}\n")


TABLE = read()


def room(work):
    """What a formula may say of a unit."""
    return UNIT_COST * 10000 // (max(TABLE[work].values()) * MARGIN)


def parts(work, cost):
    """Into how many a row of this cost is cut; 0: none, it is no more than a unit."""
    count = -(-scaled(work, cost) // UNIT_COST)
    return count if count > 1 else 0


def scaled(work, cost):
    """A formula's cost as time of the slowest set, in sixteenths of a nanosecond."""
    return -(-int(cost) * max(TABLE[work].values()) * MARGIN // 10000)
