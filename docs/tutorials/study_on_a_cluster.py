"""Runs on a Dask cluster, here one of two workers on this machine: three payloads, one law."""

from typing import Any

from distributed import LocalCluster

from diagrams.scenario.scenario import load_scenario
from experiments.cli.cluster import DaskCluster
from experiments.library import compare

SETTINGS = ["reference.path=circle", "reference.acceleration=8", "reference.settle=1", "reference.dwell=1"]

if __name__ == "__main__":  # workers are processes that import this file
    # Elsewhere: the address of any scheduler, such as that of SLURMCluster, in place of this cluster's.
    cluster: Any = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0")
    with cluster:
        workers = DaskCluster(cluster.scheduler_address)
        workers.check()
        for payload in (0.0, 3.5, 7.0):
            scenario = load_scenario("misaligned", [*SETTINGS, f"station.payload={payload}"])
            result = compare(scenario, ["pbvs"], executor=workers)
            print(f"{payload} kg: largest {result.figure('max_norm_mm')['pbvs']:.3f} mm")
