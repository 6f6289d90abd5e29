"""Drawings of a run as SVG: its path from above beside the truth, and its measures over the frames."""
import html

import numpy as np

COLOURS = ("#0b6e99", "#b3541e", "#5b7f00", "#7a3e9d", "#9d1d3c", "#006d5b")
TRUTH = "#888888"
STATE_COLOURS = ("#d0d0d0", "#4c9f70", "#e0b050", "#c0392b", "#9aa5b1", "#7a5cff")


def finite(values):
    return np.isfinite(values).all(axis=-1) if values.ndim > 1 else np.isfinite(values)


def pieces(points):
    """Of a path, the stretches without a gap."""
    known = np.concatenate([[False], finite(points), [False]])
    starts, ends = np.flatnonzero(known[1:] & ~known[:-1]), np.flatnonzero(~known[1:] & known[:-1])
    return [points[a:b] for a, b in zip(starts, ends)]


def lines(points, colour, width=1.6, dashes=""):
    more = f' stroke-dasharray="{dashes}"' if dashes else ""
    return "".join(f'<polyline fill="none" stroke="{colour}" stroke-width="{width}"{more} points="'
                   + " ".join(f"{x:.1f},{y:.1f}" for x, y in piece) + '"/>' for piece in pieces(points))


def label(x, y, text, colour="#333", anchor="start"):
    return f'<text x="{x:.0f}" y="{y:.0f}" fill="{colour}" font-size="11" text-anchor="{anchor}">{html.escape(text)}</text>'


def frame(width, height, inside):
    return f'<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" font-family="sans-serif">{inside}</svg>'


def nice(length):
    """The largest of 1, 2, 5 times a power of ten that is at most `length`."""
    power = 10.0 ** np.floor(np.log10(length))
    return max(step * power for step in (1, 2, 5) if step * power <= length)


def path(truth, estimates, width=420, height=300):
    """`truth` and each of {name: positions} as arrays of (n, 3), NaN where not known, in the plane in which the truth moves most."""
    known = truth[finite(truth)]
    if len(known) < 2:
        return ""
    middle = known.mean(0)
    axes = np.linalg.svd(known - middle, full_matrices=False)[2][:2]
    flat = lambda points: (points - middle) @ axes.T
    drawn = np.concatenate([flat(points)[finite(flat(points))] for points in (truth, *estimates.values())])
    low, high = drawn.min(0), drawn.max(0)
    scale = min((width - 30) / max(high[0] - low[0], 1e-6), (height - 60) / max(high[1] - low[1], 1e-6))
    place = lambda points: (flat(points) - (low + high) / 2) * [scale, -scale] + [width / 2, height / 2 - 10]
    parts = [lines(place(truth), TRUTH, 3)]
    for (name, points), colour, dashes in zip(estimates.items(), COLOURS, ("", "5 3")):  # where two agree both are seen
        parts.append(lines(place(points), colour, dashes=dashes))
    metres = nice(120 / scale)
    parts.append(f'<path d="M10,{height - 24} h{metres * scale:.1f}" stroke="#333" stroke-width="2"/>'
                 + label(10, height - 30, f"{metres:g} m"))
    x = 10
    for (name, colour) in [("truth", TRUTH), *zip(estimates, COLOURS)]:
        parts.append(label(x, height - 6, name, colour))
        x += 12 + 7 * len(name)
    return frame(width, height, "".join(parts))


def curves(frames, named, title, mark=None, width=420, height=130, logarithmic=False):
    """Values over frame numbers; `mark`: a frame to point at."""
    values = np.concatenate([v[np.isfinite(v)] for v in named.values()])
    if logarithmic:
        values = values[values > 0]
    if not len(values):
        return ""
    change = np.log10 if logarithmic else (lambda v: v)
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = change(values.min()), change(values.max())
        if high - low < 1e-9:
            low, high = low - 0.5, high + 0.5
        x = lambda f: 45 + (f - frames.min()) / max(np.ptp(frames), 1) * (width - 55)
        y = lambda v: height - 22 - (change(v) - low) / (high - low) * (height - 44)
        parts = [label(45, 12, title), label(42, height - 22, f"{values.min():.3g}", anchor="end"), label(42, 30, f"{values.max():.3g}", anchor="end"),
                 label(45, height - 6, str(int(frames.min()))), label(width - 8, height - 6, f"frame {int(frames.max())}", anchor="end")]
        for (name, v), colour in zip(named.items(), COLOURS):
            points = np.stack([x(frames), y(np.where(np.isfinite(v), v, np.nan))], 1)
            parts.append(lines(points, colour, 1.3))
            parts += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="1.4" fill="{colour}"/>' for a, b in points if np.isfinite(b)]
    if mark is not None:
        parts.append(f'<path d="M{x(mark):.1f},16 V{height - 20}" stroke="#c0392b" stroke-dasharray="3 3"/>')
    return frame(width, height, "".join(parts))


def ribbon(states, width=420):
    """The state of each frame as a colour."""
    each = (width - 55) / max(len(states), 1)
    return frame(width, 16, "".join(f'<rect x="{45 + i * each:.2f}" y="2" width="{each + 0.3:.2f}" height="12" fill="{STATE_COLOURS[s]}"/>'
                                    for i, s in enumerate(states)))
