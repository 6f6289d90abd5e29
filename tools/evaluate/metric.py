"""What the poses in metres of one map are worth: nothing is scaled, and velocity and gravity are judged with them. Needs numpy.

Times are since the first frame of the run. Velocity is compared in the child's own axes, so that the heading of the map does not
count; the true one is the derivative of the truth's positions. The truth's z axis points up.
"""
import numpy as np

import metrics

UPRIGHT = ("euroc", "sim")        # kinds of recordings whose truth has z up
EARLY_S, SETTLED_S = 5.0, 10.0    # when gravity is judged; from the latter on motions and the running scale are
SOON_S = 1.5                      # after metres are known: the stretch over which their scale is judged
NEAR_S = 0.25                     # a frame nearest to an instant is at most so far from it
AT_ONCE = 5                       # every so many frames the scale of all poses so far is judged

NAMES = ("metric_path_m", "metric_since_s", "metric_first_sigma_percent", "metric_first_error_sigmas", "metric_nees6", "tracking_outside",
         "velocity_nees3", "gravity_5s_deg", "gravity_10s_deg", "gravity_rms_deg", "gravity_nees2", "metric_rpe_m", "metric_rpe_deg",
         "metric_scale_median_percent", "metric_scale_worst_percent")


def true_velocity(run, i):
    """Of the child in the truth's world by the positions of two frames before and after (error of fourth order); NaN without them."""
    around = np.arange(i - 2, i + 3)
    if around[0] < 0 or around[-1] >= len(run["frame"]):
        return np.full(3, np.nan)
    steps = np.diff(run["stamp_ns"][around]) * 1e-9
    if np.ptp(steps) > 0.01 * steps.mean() or not run["has_truth"][around].all():
        return np.full(3, np.nan)
    return np.array([1, -8, 0, 8, -1]) @ run["truth_position"][around] / (12 * steps.mean())


def velocity_nees(run, i):
    """Of the velocity, in the child's axes, in units of its stated covariance; NaN where one is not known."""
    R = run["R"][i]
    error = R.T @ run["velocity"][i] - run["truth_R"][i].T @ true_velocity(run, i)
    return metrics.nees(error, R.T @ run["velocity_covariance"][i][:3, :3] @ R)


def gravity_error(run, i):
    """Angle in degrees between stated and true gravity in the child's axes, and its square in units of the two stated variances."""
    stated = run["R"][i].T @ run["gravity"][i]
    true = run["truth_R"][i].T @ np.array([0, 0, -1.0])
    angle = np.arctan2(np.linalg.norm(np.cross(stated, true)), stated @ true)
    return np.degrees(angle), (angle / run["gravity_sigma"][i]) ** 2


def nearest(run, indices, values, seconds):
    """The value of the frame nearest to an instant of the run; NaN without a near one."""
    if not len(indices):
        return float("nan")
    away = np.abs(run["stamp_ns"][indices] - run["stamp_ns"][0] - seconds * 1e9) * 1e-9
    best = int(np.argmin(away))
    return float(values[best]) if away[best] <= NEAR_S else float("nan")


def scale_percent(run, indices):
    """By what percentage the poses are too long; NaN without motion."""
    fit = metrics.similarity(run["position"][indices], run["truth_position"][indices]) if len(indices) >= 3 else None
    return 100 * (1 / fit[0] - 1) if fit is not None and fit[0] > 0 else float("nan")


def running_scale(run, indices, since_s):
    """Median and largest size of the percentage over instants from `since_s` on, each of all poses so far."""
    late = np.flatnonzero((run["stamp_ns"][indices] - run["stamp_ns"][0]) * 1e-9 >= since_s)[::AT_ONCE]
    found = np.abs([scale_percent(run, indices[:k + 1]) for k in late])
    found = found[np.isfinite(found)]
    return (float(np.median(found)), float(found.max())) if len(found) else (float("nan"), float("nan"))


def judge(run, indices, upright, per_second):
    """Measures of the poses `indices`, all in metres and in one map, and columns of single frames."""
    row = dict.fromkeys(NAMES, float("nan"))
    if not len(indices):
        return row
    seconds = (run["stamp_ns"] - run["stamp_ns"][0]) * 1e-9
    steps = np.linalg.norm(np.diff(run["truth_position"][indices], axis=0), axis=1)
    first = indices[0]
    truth_at = {int(stamp): i for i, stamp in enumerate(run["stamp_ns"]) if run["has_truth"][i]}
    poses = np.array([metrics.against_keyframe(run, i, 1.0, truth_at)[2] for i in indices])
    for i in indices:
        run["velocity_nees"][i] = velocity_nees(run, i)
    soon = scale_percent(run, indices[seconds[indices] <= seconds[first] + SOON_S])
    row.update(metric_path_m=float(steps.sum()), metric_since_s=float(seconds[first]),
               metric_first_sigma_percent=100 * float(run["scale_sigma"][first]),
               metric_first_error_sigmas=abs(soon) / (100 * float(run["scale_sigma"][first])),
               metric_nees6=metrics.mean_or_nan(poses) / 6,
               tracking_outside=metrics.share_outside(poses[run["state"][indices] == 1]),
               velocity_nees3=metrics.mean_or_nan(run["velocity_nees"][indices]) / 3)
    row["metric_scale_median_percent"], row["metric_scale_worst_percent"] = running_scale(run, indices, SETTLED_S)
    row["metric_rpe_m"], row["metric_rpe_deg"] = metrics.second_apart(run, indices[seconds[indices] >= SETTLED_S], 1.0, per_second)
    known = indices[np.isfinite(run["gravity"][indices]).all(axis=1)]
    if upright and len(known):
        angle, squared = np.array([gravity_error(run, i) for i in known]).T
        run["gravity_deg"][known] = angle
        row.update(gravity_5s_deg=nearest(run, known, angle, EARLY_S), gravity_10s_deg=nearest(run, known, angle, SETTLED_S),
                   gravity_rms_deg=metrics.root_mean_square(angle), gravity_nees2=metrics.mean_or_nan(squared) / 2)
    return row
