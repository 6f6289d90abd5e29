"""Whether stated uncertainty predicts error: of each source, and of `tracking` and `weak` apart. Needs numpy.

Two errors are held against what is stated: that of the pose relative to its reference keyframe, and that of the motion since 50 frames
earlier (metrics.py). Poses of different maps are never put together; seeds of a source are one group.
"""
import re

import numpy as np

import metrics
import svg
from tables import markdown, name_of, number

STATES = {1: "tracking", 2: "weak"}
PARTS, LEAST = 10, 20  # deciles; fewer frames than this say nothing
AIM = (0.7, 1.4)       # of error over stated sigma
KINDS = {"keyframe": "sigma_m", "apart": "apart_sigma_m"}  # name of the error: column of its stated sigma


def ranks(values):
    """1 for the smallest; equal values share the mean of their ranks."""
    _, where, counts = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts - 1) / 2)[where]


def rank_correlation(a, b):
    """C. Spearman, "The proof and measurement of association between two things", 1904; NaN without spread."""
    a, b = ranks(a), ranks(b)
    return float(np.corrcoef(a, b)[0, 1]) if np.ptp(a) > 0 and np.ptp(b) > 0 else float("nan")


def ratio(error, sigma):
    """Root mean square error over root mean square stated sigma."""
    stated = metrics.root_mean_square(sigma)
    return metrics.root_mean_square(error) / stated if stated > 0 else float("nan")


def by_part(order, error, sigma):
    """[(largest of `order`, mean stated sigma, RMS error, ratio)] of ten parts of the same number of frames, by rising `order`."""
    found = []
    for part in np.array_split(np.argsort(order, kind="stable"), PARTS):
        if len(part):
            found.append((float(order[part].max()), metrics.root_mean_square(sigma[part]), metrics.root_mean_square(error[part]),
                          ratio(error[part], sigma[part])))
    return found


def judge(error, sigma, nees, quality):
    """Measures of frames whose error and sigma are known; None of too few."""
    known = np.isfinite(error) & np.isfinite(sigma) & np.isfinite(nees) & (sigma > 0)
    if known.sum() < LEAST:
        return None
    error, sigma, nees, quality = (values[known] for values in (error, sigma, nees, quality))
    return {"frames": len(error), "nees6": float(nees.mean() / 6), "nees6_median": float(np.median(nees) / 6),
            "outside": metrics.share_outside(nees), "rank": rank_correlation(sigma, error), "ratio": ratio(error, sigma),
            "by_quality": by_part(quality, error, sigma), "by_sigma": by_part(sigma, error, sigma)}


def columns_of(db):
    names = ["state", "quality", "keyframe_nees", "apart_nees", "keyframe_error_m", "apart_error_m", "sigma_m", "apart_sigma_m"]
    found = db.execute(f"SELECT r.source, r.version, {', '.join('f.' + name for name in names)} FROM frames f JOIN runs r USING (run) "
                       "WHERE f.state IN (1, 2) ORDER BY r.source, r.run, f.i").fetchnumpy()
    groups = np.array([f"{re.sub('seed=[0-9]+', 'seed=*', name_of(source))}, {version}"
                       for source, version in zip(found["source"], found["version"])], object)
    return groups, {name: np.ma.filled(np.ma.asarray(found[name]).astype(float), np.nan) for name in names}


def measure(db):
    """{group: {"weak": share, (kind, state): measures}}"""
    groups, columns = columns_of(db)
    found = {}
    for group in sorted(set(groups)):
        inside = groups == group
        found[group] = {"weak": float((columns["state"][inside] == 2).mean())}
        for kind, stated in KINDS.items():
            for state, name in STATES.items():
                of = inside & (columns["state"] == state)
                found[group][kind, name] = judge(columns[f"{kind}_error_m"][of], columns[stated][of], columns[f"{kind}_nees"][of],
                                                 columns["quality"][of])
    return found


def text(db):
    lines, parts = [], []
    for group, found in measure(db).items():
        for kind in KINDS:
            for name in STATES.values():
                m = found[kind, name]
                if m is None:
                    continue
                lines.append([group, f"{100 * found['weak']:.1f}", kind, name, str(m["frames"]), number(m["nees6"], ".2f"),
                              number(m["nees6_median"], ".2f"), number(100 * m["outside"], ".2f"), number(m["ratio"], ".2f"), number(m["rank"], ".2f")])
                parts.append([group, kind, name] + [f"{number(r, '.2f')} ({q:.2f})" for q, _, _, r in m["by_quality"]])
    head = ["source", "weak %", "error since", "state", "frames", "NEES/6, mean", "median", "% outside 99.9 %", "error over sigma", "rank correlation"]
    return ("# Stated against true error\n\n" + markdown(head, lines) + "\nError over sigma (root mean squares) by decile of quality, with the "
            "largest quality of each:\n\n" + markdown(["source", "error since", "state", *map(str, range(1, PARTS + 1))], parts))


def diagram(db, width=460, height=340):
    """RMS error over RMS stated sigma of ten parts by sigma (D. Levi et al., "Evaluating and calibrating uncertainty prediction in
    regression tasks", 2019), with the line where both agree and the aim about it; metres, logarithmic. Of errors since the keyframe."""
    drawn = [(group, name, np.array([(s, e) for _, s, e, _ in found["keyframe", name]["by_sigma"] if s > 0 and e > 0]))
             for group, found in measure(db).items() for name in STATES.values() if found["keyframe", name]]
    drawn = [each for each in drawn if len(each[2])]
    if not drawn:
        return svg.frame(width, height, svg.label(10, 20, "no frames whose error is known"))
    both = np.log10(np.concatenate([points for *_, points in drawn]))
    low, high = both.min() - 0.1, both.max() + 0.1
    place = lambda points: np.stack([50 + (np.log10(points[:, 0]) - low) / (high - low) * (width - 70),
                                     height - 40 - (np.log10(points[:, 1]) - low) / (high - low) * (height - 60)], 1)
    ends = 10 ** np.array([low, high])
    parts = [svg.lines(place(np.stack([ends, ends * share], 1)), svg.TRUTH, 1, "" if share == 1 else "3 3") for share in (1, *AIM)]
    for k, (group, name, points) in enumerate(drawn):
        colour = svg.COLOURS[k // 2 % len(svg.COLOURS)]
        parts += [svg.lines(place(points), colour, 1.6, "" if name == "tracking" else "5 3"), svg.label(56, 16 + 13 * k, f"{group}, {name}", colour)]
    parts += [svg.label(width / 2, height - 8, f"stated sigma, {ends[0]:.2g} to {ends[1]:.2g} m", anchor="middle"),
              svg.label(6, height - 46, f"{ends[0]:.2g} m"), svg.label(6, 30, f"{ends[1]:.2g} m")]
    return svg.frame(width, height, "".join(parts)).replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1) + "\n"
