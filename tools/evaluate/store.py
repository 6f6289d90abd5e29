"""Results on disk: Parquet files in a folder, read with DuckDB.

Each part holds some runs in three files, runs/PART.parquet, maps/PART.parquet and frames/PART.parquet; that of the runs is written last and makes
the part. A file comes into its place whole. A run is known by its key (plan.key_of), which holds the hash of its binary, so results
of another binary are never taken for it. Needs pyarrow and duckdb.
"""
import os
import time
import uuid

import duckdb
import pyarrow as pa
import pyarrow.parquet

import metric

FLUSH_RUNS, FLUSH_S = 200, 10.0

_text, _number, _whole, _truth = pa.string(), pa.float64(), pa.int64(), pa.bool_()
RUNS = pa.schema(
    [("run", _text), ("part", _text)]
    + [(name, _text) for name in ("binary_hash", "version", "source", "data_hash", "crop", "set", "kernel_set", "digest", "complaint")]
    + [(name, _whole) for name in ("start", "step", "frames_max", "status", "frames", "maps", "width", "height", "frames_starting",
                                   "frames_tracking", "frames_weak", "frames_lost", "frames_paused", "frames_coasting")]
    + [("reverse", _truth)] + [(name, _number) for name in ("wall_s", "mean_ms", "p99_ms", "resident_mib")])
MAPS = pa.schema(
    [("run", _text), ("part", _text)] + [(name, _whole) for name in ("map", "reset", "poses", "first_frame", "last_frame", "weak")]
    + [(name, _number) for name in ("path_m", "scale", "rmse_m", "max_m", "final_rmse_m", "final_scale", "metric_rmse_m", "metric_final_rmse_m",
                                    "metric_scale_percent", *metric.NAMES, "rpe_m", "rpe_deg", "scale_ratio",
                                    "step_ratio", "drift_percent_100m", "quality_first", "nees6_keyframe", "outside_keyframe", "nees6_apart",
                                    "outside_apart")]
    + [("good_error", _truth), ("good_scale", _truth)])
FRAMES = pa.schema(
    [("run", _text), ("part", _text)] + [(name, pa.int32()) for name in ("i", "state", "map", "reset", "inliers")]
    + [(name, _whole) for name in ("frame", "stamp_ns", "keyframe", "digest")]
    + [(name, pa.float32()) for name in ("quality", "error_m", "sigma_m", "local_scale", "keyframe_error_m", "keyframe_error_deg",
                                         "keyframe_nees", "apart_error_m", "apart_error_deg", "apart_nees", "apart_sigma_m", "velocity_nees", "gravity_deg")]
    + [(name, _number) for name in ("x", "y", "z", "truth_x", "truth_y", "truth_z")])
TABLES = {"runs": RUNS, "maps": MAPS, "frames": FRAMES}


def write(folder, part, name, table):
    path = os.path.join(folder, name, f"{part}.parquet")
    pa.parquet.write_table(table, path + ".part", compression="zstd")
    os.replace(path + ".part", path)


# What is not known is NULL, never NaN, which SQL takes for the largest number.

def by_rows(schema, rows, part):
    return pa.table({field.name: pa.array([part] * len(rows) if field.name == "part" else [row.get(field.name) for row in rows],
                                          field.type, from_pandas=True) for field in schema}, schema=schema)


def by_columns(columns, part):
    return pa.table({field.name: pa.array([part] * len(columns["run"]) if field.name == "part" else columns[field.name], field.type,
                                          from_pandas=True)
                     for field in FRAMES}, schema=FRAMES)


class Store:
    """Where results go: whole parts of some runs, so that an interruption loses at most the last seconds."""

    def __init__(self, folder):
        self.folder, self.waiting, self.last = folder, [], time.monotonic()
        for name in TABLES:
            os.makedirs(os.path.join(folder, name), exist_ok=True)

    def add(self, result):
        self.waiting.append(result)
        if len(self.waiting) >= FLUSH_RUNS or time.monotonic() - self.last > FLUSH_S:
            self.flush()

    def flush(self):
        self.last = time.monotonic()
        if not self.waiting:
            return
        part = f"{self.waiting[0]['run']['binary_hash'][:12]}-{uuid.uuid4().hex[:12]}"
        frames = [by_columns(result["frames"], part) for result in self.waiting if result["frames"]]
        write(self.folder, part, "frames", pa.concat_tables(frames) if frames else FRAMES.empty_table())
        write(self.folder, part, "maps", by_rows(MAPS, [row for result in self.waiting for row in result["maps"]], part))
        write(self.folder, part, "runs", by_rows(RUNS, [result["run"] for result in self.waiting], part))
        self.waiting = []


def read(folder):
    """A connection with the views runs, maps and frames: each run once, by the first part that holds it."""
    db = duckdb.connect()
    for name, schema in TABLES.items():
        files = sorted(os.listdir(os.path.join(folder, name))) if os.path.isdir(os.path.join(folder, name)) else []
        paths = [os.path.join(folder, name, file) for file in files if file.endswith(".parquet")]
        if paths:
            db.execute(f"CREATE VIEW all_{name} AS SELECT * FROM read_parquet({paths!r}, union_by_name = true)")
        else:
            db.register(f"all_{name}", schema.empty_table())
    db.execute("CREATE TABLE runs AS SELECT * FROM all_runs QUALIFY row_number() OVER (PARTITION BY run ORDER BY part) = 1")
    for name in ("maps", "frames"):
        db.execute(f"CREATE VIEW {name} AS SELECT t.* FROM all_{name} t SEMI JOIN runs r ON t.run = r.run AND t.part = r.part")
    return db


def known(folder):
    """Keys of the runs that are there."""
    return {key for key, in read(folder).execute("SELECT run FROM runs").fetchall()}
