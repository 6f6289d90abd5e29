"""Runs beside each other, by Dask: processes of this machine, or the workers of a cluster by its scheduler's address.

A run is a function of its specification alone (one.run), so it does not matter which worker makes it, in which order, or how often: a
worker that dies is replaced, and its runs are made again. Workers of a cluster see the same files at the same paths.
"""
import os

HERE = os.path.dirname(os.path.abspath(__file__))
AHEAD = 8         # runs given to the scheduler per worker, so that none waits for the next
RETRIES = 3       # of a run that could not be made (one.Broken)
DEATHS = 20       # workers that a run may lose before it is given up


def task(folder, spec):
    """Sent to the workers by value: they need nothing but Python, numpy and Dask."""
    import sys
    if folder not in sys.path:
        sys.path.insert(0, folder)
    import one
    return one.run(spec)


def here(specs, done):
    """One after the other, in this process."""
    import one
    for spec in specs:
        done(spec, one.run(spec), None)


def cluster_of(workers, scheduler):
    import dask
    import distributed
    dask.config.set({"distributed.scheduler.allowed-failures": DEATHS, "distributed.admin.low-level-log-length": 100,
                     "distributed.worker.memory.terminate": False})
    if scheduler:
        return distributed.Client(scheduler, timeout="30s")
    cluster = distributed.LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None,
                                       memory_limit=None, silence_logs=50)
    return distributed.Client(cluster)


def across(specs, workers, scheduler, done, started=None):
    """By Dask. `started`, for tests, gets the client."""
    import cloudpickle
    import distributed
    import execute
    cloudpickle.register_pickle_by_value(execute)
    client = cluster_of(workers, scheduler)
    try:
        if started:
            started(client)
        waiting, of = iter(specs), {}

        def submit():
            spec = next(waiting, None)
            if spec is None:
                return []
            future = client.submit(task, HERE, spec, key=f"run-{spec['run']}", pure=False, retries=RETRIES)
            of[future.key] = spec
            return [future]

        ahead = max(AHEAD * max(len(client.scheduler_info()["workers"]), workers), 1)
        running = distributed.as_completed([future for _ in range(ahead) for future in submit()])
        for future in running:
            spec = of.pop(future.key)
            error = future.exception() if future.status != "finished" else None
            done(spec, None if error else future.result(), error)
            future.release()
            for more in submit():
                running.add(more)
    finally:
        cluster = client.cluster
        client.close()
        if cluster is not None:
            cluster.close()


def all_of(specs, workers, scheduler, done, started=None):
    """Call done(spec, result, error) for each; `workers` 0 and no scheduler: in this process, without Dask."""
    if workers == 0 and not scheduler:
        here(specs, done)
    else:
        across(specs, workers, scheduler, done, started)


def processors():
    return len(os.sched_getaffinity(0))
