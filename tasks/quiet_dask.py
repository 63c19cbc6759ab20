"""What Dask's processes do beside our work, kept small."""

# By default a worker samples its own threads a hundred times a second, and looks at its memory ten times: of a worker
# that waits for images of two seconds that was a third of its processor time. Images are done in processes that are
# watched by their own pool.
SETTINGS = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}


def make_dask_quiet() -> None:
    """For the clusters that this process starts from now on, scheduler and workers."""
    import dask

    dask.config.set(SETTINGS)
