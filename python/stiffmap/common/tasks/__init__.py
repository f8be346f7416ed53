"""Many independent tasks: here, in processes, or on a dask cluster. One room for all that takes minutes (docs/big_maps.md)."""

from stiffmap.common.tasks.cluster import client_of
from stiffmap.common.tasks.workers import Workers, workers

__all__ = ["Workers", "client_of", "workers"]
