"""Error metrics computed from the log of a run.

The error of the tip is e = (rotation vector, translation) of `robots.pose.pose_error`, Probst (2024)
eqs. (2.36) and (2.37), axis by axis in the world. It is counted twice: *true*, what a perfect instrument
would see, and *measured*, what the camera says. A comparison maps each law to one log per cycle; cycles
differ by the seed of the noise, the first is the one whose errors are reported, and all of them serve
ISO 9283 (`experiments.metrics.iso9283`).
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from diagrams.record.log import RunLog
from experiments.metrics.iso9283 import iso_9283
from experiments.metrics.laps import lap_metrics, times_planned
from experiments.metrics.unfinished import unfinished_cycles
from robots.pose import pose_error

STATIC_WINDOW = 0.5  # s, the end of the dwell over which the static error is the mean
SETTLING_BAND = 0.05  # of the initial distance
SETTLING_HOLD = 0.25  # s, that long the error must stay in the band: an oscillation only crosses it
SMALLEST_STEP = 1e-3  # m, an initial distance below this is not a transient worth the name
SMALLEST_TURN = math.radians(0.1)  # rad, the same for one axis of the orientation
SIGNIFICANT_DIGITS = 9
FIRST_TICKS = 10  # of a law, in which it fills its caches

Comparison = Mapping[str, Sequence[RunLog]]


def pose_errors(log: RunLog, source: str) -> np.ndarray:
    """The error e of every sample in rad and m, shape (n, 6); ``source`` is "true" or "measured".

    Measured errors are NaN where there was no sample.
    """
    X_WE = log.X_WE_true if source == "true" else log.X_WE_measured
    return pose_error(log.X_WE_desired, X_WE)


def judged_source(log: RunLog) -> str:
    """By what a run is judged: "true", or "measured" on a real station, where nobody knows the truth."""
    return "true" if np.isfinite(log.X_WE_true).any() else "measured"


def known_poses(log: RunLog) -> np.ndarray:
    """Poses of the tool by which a run is judged, for pictures; gaps hold the last one known, (n, 4, 4)."""
    X_WE = log.X_WE_true if judged_source(log) == "true" else log.X_WE_measured
    known = np.asarray(np.isfinite(X_WE).all(axis=(1, 2)))
    if not known.any():
        return log.X_WE_desired
    newest = np.maximum.accumulate(np.where(known, np.arange(len(known)), -1))
    return X_WE[np.where(newest < 0, int(np.argmax(known)), newest)]


def window(log: RunLog, start: float, end: float) -> np.ndarray:
    """Which samples lie in [start, end], with a quarter of a sample to spare; shape (n,)."""
    slack = 0.25 * (log.time[1] - log.time[0]) if len(log.time) > 1 else 0.0
    return (log.time >= start - slack) & (log.time <= end + slack)


def path_window(log: RunLog) -> np.ndarray:
    """Which samples lie between the start of the path and its end; shape (n,)."""
    return window(log, log.path_start, log.path_end)


def static_window(log: RunLog) -> np.ndarray:
    """Which samples lie in the last half second of the dwell, none if there is no dwell; shape (n,)."""
    if log.path_end <= log.dwell_start:
        return np.zeros(len(log.time), dtype=bool)
    return window(log, max(log.dwell_start, log.path_end - STATIC_WINDOW), log.path_end)


def error_metrics(log: RunLog, source: str) -> dict[str, Any]:
    """Largest, static and mean errors of one run, and its initial transient.

    ``source`` is "true" or "measured". Static is the absolute value of the mean error over the static
    window. Samples without a measurement are left out; a number with no sample at all is NaN.

    Raises:
        ValueError: if the log holds no sample between the start and the end of the path.
    """
    e = pose_errors(log, source)
    on_path = path_window(log)
    if not on_path.any():
        raise ValueError(
            f"law '{log.law}': no sample between path_start {log.path_start:g} s "
            f"and path_end {log.path_end:g} s"
        )
    valid = np.isfinite(e).all(axis=1)
    path, static = e[on_path & valid], _mean(e[static_window(log) & valid])
    distance = np.linalg.norm(path[:, 3:], axis=1)
    return {
        "max_mm": _mm(_largest(np.abs(path[:, 3:]))),
        "max_deg": _deg(_largest(np.abs(path[:, :3]))),
        "static_mm": _mm(np.abs(static[3:])),
        "static_deg": _deg(np.abs(static[:3])),
        "max_norm_mm": 1e3 * float(_largest(distance)),
        "rms_norm_mm": 1e3 * math.sqrt(float(_mean(distance**2))),
        "max_angle_deg": math.degrees(float(_largest(np.linalg.norm(path[:, :3], axis=1)))),
        **transient_metrics(log.time[on_path & valid] - log.path_start, path),
    }


def transient_metrics(time: np.ndarray, e: np.ndarray) -> dict[str, Any]:
    """How an initial error dies away.

    ``settling_s`` is when the distance falls to 5 % of its first value and stays there for 0.25 s.
    Overshoot is how far an axis goes past zero, to the other side of its initial error, until then. All of
    them are None if the run does not start 1 mm off, or never settles. An axis that starts at zero (0.1 mm,
    0.1 degrees) has no other side and overshoots by 0.

    Args:
        time: since the start of the path in s, shape (n,).
        e: errors in rad and m, shape (n, 6).
    """
    nothing = {"overshoot_mm": None, "overshoot_deg": None, "settling_s": None}
    if len(e) == 0:
        return nothing
    distance = np.linalg.norm(e[:, 3:], axis=1)
    if distance[0] < SMALLEST_STEP:
        return nothing
    settled = _settling_index(time, distance <= SETTLING_BAND * distance[0])
    if settled is None:
        return nothing
    transient = e[time <= time[settled] + SETTLING_HOLD]
    overshoot = np.maximum(0.0, np.max(-np.sign(e[0]) * transient, axis=0))
    started_off = np.abs(e[0]) >= np.repeat([SMALLEST_TURN, 0.1 * SMALLEST_STEP], 3)
    overshoot = np.where(started_off, overshoot, 0.0)
    return {
        "overshoot_mm": _mm(overshoot[3:]),
        "overshoot_deg": _deg(overshoot[:3]),
        "settling_s": float(time[settled]),
    }


def _settling_index(time: np.ndarray, inside: np.ndarray) -> int | None:
    """The first sample from which on ``inside`` holds for the hold time."""
    entries = np.flatnonzero(inside & ~np.concatenate([[False], inside[:-1]]))
    for entry in entries:
        exits = np.flatnonzero(~inside[entry:])
        end = time[entry + exits[0]] if len(exits) else math.inf
        if end - time[entry] > SETTLING_HOLD:
            return int(entry)
    return None


def summary(scenario_name: str, logs: Comparison) -> dict[str, Any]:
    """The deterministic result of a comparison, the content of ``summary.json``.

    Lengths are in mm and angles in degrees, as the keys say. No wall times: the same seed gives the same
    bytes.
    """
    runs = {}
    for law, cycles in logs.items():
        first = cycles[0]
        runs[law] = {
            source: {**error_metrics(first, source), "iso_9283": iso_9283(cycles, source)}
            for source in ("true", "measured")
        }
        runs[law]["guard"] = {kind: int(first.guard_counts[kind]) for kind in sorted(first.guard_counts)}
        if first.lap_starts:
            runs[law]["laps"] = lap_metrics(first, pose_errors(first, judged_source(first)))
        if first.path_time is not None:
            runs[law]["times_planned"] = times_planned(first, first.path_start, first.dwell_start)
        if first.learnt is not None:
            runs[law]["learnt"] = first.learnt
        if ending := unfinished_cycles(cycles):
            runs[law]["unfinished"] = ending
    return _rounded({"scenario": scenario_name, "runs": runs})


def timing(logs: Comparison) -> dict[str, Any]:
    """Wall and simulated time per law, added over its cycles, the content of ``timing.json``.

    ``tick_us``: wall time of the law's own updates in microseconds, the first `FIRST_TICKS` left out.
    """
    runs = {}
    for law, cycles in logs.items():
        wall = sum(log.wall_time for log in cycles)
        simulated = float(sum(log.time[-1] - log.time[0] for log in cycles))
        factor = simulated / wall if wall > 0.0 else None
        runs[law] = {"wall_s": wall, "simulated_s": simulated, "real_time_factor": factor}
        ticks = np.concatenate([log.tick_seconds[FIRST_TICKS:] for log in cycles])
        if len(ticks):
            shares = {"median": 0.5, "p99": 0.99, "p999": 0.999, "max": 1.0}
            runs[law]["tick_us"] = {name: 1e6 * np.quantile(ticks, share) for name, share in shares.items()}
    return _rounded({"runs": runs})


def with_timing(result: dict[str, Any], times: Mapping[str, Any]) -> dict[str, Any]:
    """A `summary` with the ``tick_us`` of `timing` beside what each learning law has learnt.

    They are left out of ``summary.json``, which a simulation with the same seed repeats byte for byte.
    """
    runs = {
        law: run | {"tick_us": times["runs"][law]["tick_us"]}
        if "learnt" in run and "tick_us" in times["runs"][law]
        else run
        for law, run in result["runs"].items()
    }
    return {**result, "runs": runs}


def best_law(result: Mapping[str, Any]) -> str:
    """The law of a `summary` whose largest distance is smallest; the open loop only if it is alone.

    Where the laws start from the same error and it stays the largest, the root mean square decides. One that
    did not come to the end of its path has not kept near it; it is the best only if all have not.
    """
    runs, source = result["runs"], judged_by(result)
    finished = [law for law in runs if "unfinished" not in runs[law]] or list(runs)
    laws = [law for law in finished if law != "open_loop"] or finished
    laws = [law for law in laws if None not in runs[law][source]["static_mm"]] or laws
    smallest = min(_sortable(runs[law][source]["max_norm_mm"]) for law in laws)
    alike = [law for law in laws if _sortable(runs[law][source]["max_norm_mm"]) <= 1.001 * smallest]
    return min(alike, key=lambda law: _sortable(runs[law][source]["rms_norm_mm"]))


def judged_by(result: Mapping[str, Any]) -> str:
    """By what the runs of a `summary` are judged, as `judged_source`."""
    is_known = any(run["true"]["max_norm_mm"] is not None for run in result["runs"].values())
    return "true" if is_known else "measured"


def _rounded(value: Any) -> Any:
    """The same tree with plain numbers of nine digits; what is not a number becomes None."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_rounded(item) for item in value]
    if isinstance(value, float | np.floating):
        # Adding zero turns -0.0 into 0.0: the sign of nothing is an accident of rounding.
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0 if math.isfinite(value) else None
    return value


def _sortable(value: float | None) -> float:
    return math.inf if value is None else value


def _mean(values: np.ndarray) -> np.ndarray:
    return np.mean(values, axis=0) if len(values) else np.full(values.shape[1:], np.nan)


def _largest(values: np.ndarray) -> np.ndarray:
    return np.max(values, axis=0) if len(values) else np.full(values.shape[1:], np.nan)


def _mm(lengths: np.ndarray) -> list[float]:
    return (1e3 * lengths).tolist()


def _deg(angles: np.ndarray) -> list[float]:
    return np.rad2deg(angles).tolist()
