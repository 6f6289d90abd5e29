"""What a run's poses are worth against the truth, for each stay in a map alone. Needs numpy.

Poses of different maps are never put together: each map has a unit and a world of its own. Neither are those before and after the
camera was lost and found again in the same map (reset_counter): `odom` and its changes of unit begin anew there. Truth belongs to a frame by the frame's
own stamp, which the run wrote with both.
"""
import numpy as np

import metric

POSED = (1, 2, 5)  # pose_t: tracking, weak, coasting
STATES = ("starting", "tracking", "weak", "lost", "paused", "coasting")
POSES_MIN = 10        # of a map that is judged
WINDOW = 10           # frames over which scale is local
WINDOW_M = 0.1        # least motion of the truth in it, and in a single step
APART = 50            # frames between the poses of the longer relative error
UNIT_SIGMA = 0.005    # of the unit of length of a stretch, relative (src/runtime/relative.c)
CHI2_999 = 22.4577    # of 6 degrees of freedom: 99.9 % are below
DRIFT_PATH_M = 10.0   # a shorter path says nothing about drift per 100 m

# How well the truth itself is known, metres: of positions, by kind of recording.
TRUTH_ERROR_M = {"kitti": 0.05, "tum": 0.02, "euroc": 0.005}

# What a map must hold: root mean square and largest error, as fractions of the true path, beyond the truth's own error; and
# the largest local scale over the smallest.
RMSE_SHARE, MAX_SHARE, SCALE_RATIO = 0.015, 0.04, 1.5


def truth_error_m(source):
    """Of a source's URI, also of one that wraps or chains others: the worst of them."""
    return max((error for kind, error in TRUTH_ERROR_M.items() if kind + ":" in source), default=0.0)


def upright(source):
    """Whether the truth of all that a source's URI names has z up."""
    kinds = [kind for kind in ("kitti", "tum", "euroc", "sim", "images", "lcmlog", "video") if kind + ":" in source]
    return bool(kinds) and all(kind in metric.UPRIGHT for kind in kinds)


def rotation(q):
    """Of a unit quaternion w x y z."""
    w, x, y, z = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def rotation_vector(R):
    """Axis times angle of a rotation by less than 180 degrees."""
    sine = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = np.linalg.norm(sine)
    angle = np.arctan2(length, 0.5 * (np.trace(R) - 1))
    return sine if length < 1e-12 else sine * (angle / length)


def logarithm(R, t):
    """(rho, omega) with exp of it the motion (R, t)."""
    omega = rotation_vector(R)
    angle2 = omega @ omega
    if angle2 < 1e-8:
        factor = 1 / 12 + angle2 / 720
    else:
        angle = np.sqrt(angle2)
        factor = (1 - 0.5 * angle / np.tan(0.5 * angle)) / angle2
    turned = np.cross(omega, t)
    return np.concatenate([t - 0.5 * turned + factor * np.cross(omega, turned), omega])


def similarity(p, q):
    """Scale, rotation and translation that take points p best to q (S. Umeyama, PAMI 1991); None without extent."""
    p0, q0 = p.mean(0), q.mean(0)
    spread = ((p - p0) ** 2).sum()
    if not spread > 0 or not ((q - q0) ** 2).sum() > 0:
        return None
    U, D, Vt = np.linalg.svd((q - q0).T @ (p - p0))
    sign = np.array([1, 1, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = U @ np.diag(sign) @ Vt
    scale = (D * sign).sum() / spread
    return scale, R, q0 - scale * R @ p0


def rigid_error(p, q):
    """Root mean square distance of points p from q after the best rigid motion, both in metres."""
    if len(p) < 3:
        return float("nan")
    p0, q0 = p.mean(0), q.mean(0)
    U, _, Vt = np.linalg.svd((q - q0).T @ (p - p0))
    R = U @ np.diag([1, 1, np.sign(np.linalg.det(U) * np.linalg.det(Vt))]) @ Vt
    return root_mean_square(np.linalg.norm((p - p0) @ R.T + q0 - q, axis=1))


def aligned_error(p, q):
    """Root mean square distance of points p from q after the best similarity, and its scale; NaN without one."""
    fit = similarity(p, q) if len(p) >= 3 else None
    if fit is None:
        return float("nan"), float("nan")
    scale, R, t = fit
    return root_mean_square(np.linalg.norm(scale * p @ R.T + t - q, axis=1)), float(scale)


def root_mean_square(values):
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")


def relative(Ra, ta, Rb, tb):
    """T_a^-1 T_b."""
    return Ra.T @ Rb, Ra.T @ (tb - ta)


def one_unit(run):
    """Bring all poses of each stay to its last unit and frame: pose_t states each change, p_new = s R p_old + t."""
    changes = {}  # (map, reset): {count: (s, R, t)}
    stay = lambda i: (int(run["map"][i]), int(run["reset"][i]))
    for i in np.flatnonzero(run["map"] >= 0):
        changes.setdefault(stay(i), {}).setdefault(int(run["change_count"][i]), run["change"][i])
    for i in np.flatnonzero(run["map"] >= 0):
        known = changes[stay(i)]
        for count in range(int(run["change_count"][i]) + 1, max(known) + 1):
            if count not in known:
                continue
            s, R, t = known[count]
            run["position"][i] = s * R @ run["position"][i] + t
            run["R"][i] = R @ run["R"][i]
            run["gravity"][i] = R @ run["gravity"][i]
            run["velocity"][i] = s * R @ run["velocity"][i]
            run["velocity_covariance"][i][:3, :3] = s * s * R @ run["velocity_covariance"][i][:3, :3] @ R.T
            run["keyframe_position"][i] = s * run["keyframe_position"][i]
            run["covariance"][i, :3] *= s
            run["covariance"][i, :, :3] *= s


def nees(error, covariance):
    """Squared error in units of its covariance; NaN where that is none."""
    try:
        value = float(error @ np.linalg.solve(covariance, error))
    except np.linalg.LinAlgError:
        return float("nan")
    return value if np.isfinite(value) and value >= 0 else float("nan")


def against_keyframe(run, i, scale, truth_at):
    """Error of T_keyframe_child in metres and degrees, and its NEES; NaN at the keyframe itself and where its truth is not known."""
    k = truth_at.get(int(run["keyframe_stamp_ns"][i]))
    if k is None or k == i or not run["has_truth"][i]:
        return np.full(3, np.nan)
    R, t = relative(run["truth_R"][k], run["truth_position"][k], run["truth_R"][i], run["truth_position"][i])
    Re, te = run["keyframe_R"][i], run["keyframe_position"][i]
    error = logarithm(*relative(Re, te, R, t / scale))
    return np.array([scale * np.linalg.norm(error[:3]), np.degrees(np.linalg.norm(error[3:])), nees(error, run["covariance"][i])])


def carried(run, j, i):
    """The covariance of pose j as one of a motion on the side of pose i: by the adjoint of T_i_j."""
    Re, te = relative(run["R"][j], run["position"][j], run["R"][i], run["position"][i])
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = Re.T
    adjoint[:3, 3:] = skew(-Re.T @ te) @ Re.T
    return adjoint @ run["covariance"][j] @ adjoint.T


def chain_covariance(run, j, i, links):
    """Covariance of the motion from pose j to pose i, as fovea_relative_pose_get sums it (src/runtime/relative.h): that of pose i, those
    of the keyframes in between against the ones before them, and that of pose j unless it is a keyframe itself; and what their unit of
    length errs by in common. `links`: is a keyframe."""
    total = run["covariance"][i].copy()
    for k in range(j, i):
        if links[k] == (k != j) and run["map"][k] == run["map"][i] and run["state"][k] in POSED:
            total += carried(run, k, i)
    Re, te = relative(run["R"][j], run["position"][j], run["R"][i], run["position"][i])
    unit = run["scale_sigma"][i] if run["metric"][i] and "scale_sigma" in run else UNIT_SIGMA
    total[:3, :3] += unit ** 2 * np.outer(Re.T @ te, Re.T @ te)
    return total


def against_earlier(run, j, i, scale, links):
    """Error of the motion from pose j to pose i in metres and degrees, its NEES and its stated sigma in metres."""
    Re, te = relative(run["R"][j], run["position"][j], run["R"][i], run["position"][i])
    R, t = relative(run["truth_R"][j], run["truth_position"][j], run["truth_R"][i], run["truth_position"][i])
    error = logarithm(*relative(Re, te, R, t / scale))
    if links is None:
        return np.array([scale * np.linalg.norm(error[:3]), np.degrees(np.linalg.norm(error[3:])), np.nan, np.nan])
    both = chain_covariance(run, j, i, links)
    return np.array([scale * np.linalg.norm(error[:3]), np.degrees(np.linalg.norm(error[3:])), nees(error, both),
                     scale * np.sqrt(np.trace(both[:3, :3]))])


def second_apart(run, indices, scale, frames):
    """Root mean square error of the motion over one second: metres, degrees."""
    inside = set(indices.tolist())
    pairs = [(i - frames, i) for i in indices if i - frames in inside]
    errors = np.array([against_earlier(run, j, i, scale, None)[:2] for j, i in pairs]).reshape(-1, 2)
    return root_mean_square(errors[:, 0]), root_mean_square(errors[:, 1])


def local_scales(run, indices, scale, window):
    """Estimated over true distance between frames `window` apart, by frame index; of frames that are all posed in this map."""
    inside = np.zeros(len(run["map"]), bool)
    inside[indices] = True
    found = {}
    for i in indices:
        j = i - window
        if j < 0 or not inside[j:i + 1].all():
            continue
        true = np.linalg.norm(run["truth_position"][i] - run["truth_position"][j])
        if true >= WINDOW_M:
            found[int(i)] = scale * np.linalg.norm(run["position"][i] - run["position"][j]) / true
    return found


def drift_percent(run, indices, scales):
    """Change of scale per 100 m of true path, percent, by the line through the logarithms of the local scales."""
    steps = np.linalg.norm(np.diff(run["truth_position"][indices], axis=0), axis=1)
    way = dict(zip(indices.tolist(), np.concatenate([[0], np.cumsum(steps)])))
    if len(scales) < 5 or max(way.values()) < DRIFT_PATH_M or min(scales.values()) <= 0:
        return float("nan")
    x = np.array([way[i] for i in scales])
    y = np.log(list(scales.values()))
    if np.ptp(x) < DRIFT_PATH_M / 2:
        return float("nan")
    return float(100 * np.expm1(100 * np.polyfit(x, y, 1)[0]))


def ratio(scales):
    values = scales.values()
    return max(values) / min(values) if values and min(values) > 0 else float("nan")


def share_outside(values):
    known = values[np.isfinite(values)]
    return float((known > CHI2_999).mean()) if len(known) else float("nan")


def mean_or_nan(values):
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def judge_map(run, map_id, indices, source, per_second):
    """Metrics of the poses `indices` of one map; fills in the run's columns of single frames."""
    p, q = run["position"][indices], run["truth_position"][indices]
    row = {"map": int(map_id), "poses": len(indices), "first_frame": int(run["frame"][indices[0]]),
           "last_frame": int(run["frame"][indices[-1]]), "quality_first": float(run["quality"][indices[1:POSES_MIN]].min()),
           "weak": int((run["state"][indices] == 2).sum()),
           "path_m": float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum())}
    metres = indices[run["metric"][indices]]
    row["metric_rmse_m"] = rigid_error(run["position"][metres], run["truth_position"][metres])  # also of a camera that stands
    row.update(metric.judge(run, metres, upright(source), per_second))
    own_error_m = truth_error_m(source)
    fit = similarity(p, q)
    if fit is None or not fit[0] > 0:  # nothing moved, or all poses are one point
        return row
    scale, R, t = fit
    error = np.linalg.norm(scale * p @ R.T + t - q, axis=1)
    run["aligned"][indices] = scale * p @ R.T + t
    run["error_m"][indices] = error
    run["sigma_m"][indices] = scale * np.sqrt(np.trace(run["covariance"][indices, :3, :3], axis1=1, axis2=2))
    scales = local_scales(run, indices, scale, WINDOW)
    for i, value in scales.items():
        run["local_scale"][i] = value
    truth_at = {int(stamp): i for i, stamp in enumerate(run["stamp_ns"]) if run["has_truth"][i]}
    inside = set(indices.tolist())
    links = run["keyframe_stamp_ns"] == run["stamp_ns"]
    for i in indices:
        run["keyframe_error"][i] = against_keyframe(run, i, scale, truth_at)
        if i - APART in inside:
            run["apart_error"][i] = against_earlier(run, i - APART, i, scale, links)
    row.update(scale=float(scale), rmse_m=root_mean_square(error), max_m=float(error.max()),
               scale_ratio=ratio(scales), step_ratio=ratio(local_scales(run, indices, scale, 1)),
               drift_percent_100m=drift_percent(run, indices, scales),
               nees6_keyframe=mean_or_nan(run["keyframe_error"][indices, 2]) / 6,
               outside_keyframe=share_outside(run["keyframe_error"][indices, 2]),
               nees6_apart=mean_or_nan(run["apart_error"][indices, 2]) / 6,
               outside_apart=share_outside(run["apart_error"][indices, 2]))
    row["rpe_m"], row["rpe_deg"] = second_apart(run, indices, scale, per_second)
    final = indices[np.isfinite(run["final"][indices, 0])]
    row["final_rmse_m"], row["final_scale"] = aligned_error(run["final"][final], run["truth_position"][final])
    final = final[run["metric"][final]]
    row["metric_final_rmse_m"] = rigid_error(run["final"][final], run["truth_position"][final])
    row["metric_scale_percent"] = metric.scale_percent(run, metres)
    row["good_error"] = (row["rmse_m"] <= RMSE_SHARE * row["path_m"] + own_error_m
                         and row["max_m"] <= MAX_SHARE * row["path_m"] + own_error_m)
    row["good_scale"] = not row["scale_ratio"] > SCALE_RATIO
    return row


def judge(run, source):
    """Metrics of each stay in a map with at least POSES_MIN poses; `run` gets the columns of single frames."""
    n = len(run["frame"])
    for name, width in (("error_m", 0), ("sigma_m", 0), ("local_scale", 0), ("velocity_nees", 0), ("gravity_deg", 0), ("aligned", 3),
                        ("keyframe_error", 3), ("apart_error", 4)):
        run[name] = np.full((n, width) if width else n, np.nan)
    one_unit(run)
    steps_ns = np.diff(run["stamp_ns"])
    per_second = max(int(round(1e9 / np.median(steps_ns))), 1) if n > 1 else 1
    posed = np.isin(run["state"], POSED) & (run["map"] >= 0) & run["has_truth"]
    rows = []
    for reset, map_id in sorted(set(zip(run["reset"][posed].tolist(), run["map"][posed].tolist()))):
        indices = np.flatnonzero(posed & (run["map"] == map_id) & (run["reset"] == reset))
        if len(indices) >= POSES_MIN:
            rows.append({**judge_map(run, map_id, indices, source, per_second), "reset": reset})
    return rows
