"""The log of a run again, from the record that it left."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from diagrams.record.log import GuardEvent, RunLog
from diagrams.record.read_record import Contents, Topic
from diagrams.record.run_record import PATH
from diagrams.record.topics import (
    COMMAND,
    CORRECTION,
    DESIRED,
    EVENT,
    JOINTS,
    PATH_TIME,
    POSE,
    TRUE_LINKS,
    TRUE_POSE,
)

_SAME = 1e-6  # s, two times that are the same: records keep nanoseconds
_PARTS = ("rotation", "translation")  # of a correction
_NEEDED = (DESIRED, JOINTS, COMMAND, CORRECTION)


def restored(contents: Contents, name: str) -> RunLog:
    """The log of a run from its record.

    Of a simulation it has a row for each tick, as the log had that was written. On hardware a pose is not
    seen at a tick: there the log has a row for each exposure, with the wanted pose interpolated between two
    ticks and everything else from the nearest one.

    Args:
        contents: what `diagrams.record.read_record.read_record` found.
        name: of the file, for messages.

    Raises:
        ValueError: if the record is of no run, or cut off before it says where its path is; one line.
    """
    if "path_start" not in contents.run:
        why = f"{contents.cut}: it" if contents.cut else "is of no run of a law: it"
        raise ValueError(
            f"{name}: the record {why} does not say where its path is; truetip log shows the rest"
        )
    if lacking := contents.lacking(*_NEEDED):
        raise ValueError(f"{name}: {lacking}")
    topics = contents.topics
    seen, X_WE_seen = exposures(topics.get(POSE))
    ticks, X_WE_wanted = topics[DESIRED].time, _poses(topics[DESIRED])
    if TRUE_POSE in topics or len(seen) == 0:
        time, X_WE_desired = ticks, X_WE_wanted
        measured = _at(time, seen, X_WE_seen)
    else:
        inside = (seen >= ticks[0]) & (seen <= ticks[-1])
        time, measured = seen[inside], X_WE_seen[inside]
        X_WE_desired = _between(ticks, X_WE_wanted, time)
    true = topics.get(TRUE_POSE)
    events = topics.get(EVENT)
    run = contents.run
    return RunLog(
        law=str(run["law"]),
        seed=int(run["seed"]),
        time=time,
        X_WE_desired=X_WE_desired,
        X_WE_true=_at(time, true.time, _poses(true)) if true else np.full((len(time), 4, 4), np.nan),
        X_WE_measured=measured,
        joint_position=_nearest(time, topics[JOINTS], "position"),
        joint_effort=_nearest(time, topics[JOINTS], "effort"),
        link_position=_nearest(time, topics[TRUE_LINKS], "position")
        if TRUE_LINKS in topics
        else np.full((len(time), 6), np.nan),
        position_command=_nearest(time, topics[COMMAND], "position"),
        velocity_command=_nearest(time, topics[COMMAND], "velocity"),
        correction=np.hstack(
            [_nearest(time, topics[CORRECTION], part) for part in ("rotation", "translation")]
        ),
        guard_counts={kind: int(count) for kind, count in run["guard_counts"].items()},
        guard_events=_events(events) if events else [],
        path_start=float(run["path_start"]),
        dwell_start=float(run["dwell_start"]),
        path_end=float(run["path_end"]),
        lap_starts=tuple(run.get("lap_starts", ())),
        path_time=_path_time(time, topics.get(PATH_TIME)),
        ended_early=_ended_early(contents),
    )


def _ended_early(contents: Contents) -> str:
    if contents.cut:
        return f"its record {contents.cut}"
    ended = str(contents.run.get("ended", PATH))
    return "" if ended == PATH else ended


def _path_time(time: np.ndarray, topic: Topic | None) -> np.ndarray | None:
    """Where the path was at times of the log, (n,) in s; None where it was run as planned."""
    if topic is None:
        return None
    on_path = np.interp(time, topic.time, topic.columns["time"][:, 0])
    return on_path if np.abs(on_path - time).max(initial=0.0) > _SAME else None


def _poses(topic: Topic) -> np.ndarray:
    """Homogeneous matrices, shape (n, 4, 4)."""
    columns = topic.columns
    X = np.tile(np.eye(4), (len(topic.time), 1, 1))
    X[:, :3, 3] = np.hstack([columns[f"pose.position.{axis}"] for axis in "xyz"])
    X[:, :3, :3] = Rotation.from_quat(
        np.hstack([columns[f"pose.orientation.{part}"] for part in "xyzw"])
    ).as_matrix()
    return X


def exposures(topic: Topic | None) -> tuple[np.ndarray, np.ndarray]:
    """When poses were exposed, in s and in order, shape (m,), and the poses (m, 4, 4)."""
    if topic is None:
        return np.empty(0), np.empty((0, 4, 4))
    at = (topic.columns["timestamp.sec"] + 1e-9 * topic.columns["timestamp.nsec"])[:, 0]
    order = np.argsort(at, kind="stable")
    return at[order], _poses(topic)[order]


def _at(time: np.ndarray, known: np.ndarray, X: np.ndarray) -> np.ndarray:
    """The poses at those times at which they are known, NaN at all others; shape (n, 4, 4)."""
    found = np.full((len(time), 4, 4), np.nan)
    if len(known):
        index = _index(time, known)
        same = np.abs(known[index] - time) <= _SAME
        found[same] = X[index[same]]
    return found


def _between(known: np.ndarray, X: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Poses interpolated between the two that enclose each time."""
    found = np.tile(np.eye(4), (len(time), 1, 1))
    for axis in range(3):
        found[:, axis, 3] = np.interp(time, known, X[:, axis, 3])
    found[:, :3, :3] = Slerp(known, Rotation.from_matrix(X[:, :3, :3]))(time).as_matrix()
    return found


def _nearest(time: np.ndarray, topic: Topic, column: str) -> np.ndarray:
    return topic.columns[column][_index(time, topic.time)]


def _index(time: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The number of the nearest of the known times, which rise."""
    after = np.clip(np.searchsorted(known, time), 1, max(1, len(known) - 1))
    after = np.minimum(after, len(known) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(time - known[before] <= known[after] - time, before, after)


def _events(topic: Topic) -> list[GuardEvent]:
    kinds, details = topic.columns["kind"][:, 0], topic.columns["detail"][:, 0]
    return [
        GuardEvent(float(at), str(kind), str(detail))
        for at, kind, detail in zip(topic.time, kinds, details, strict=True)
    ]
