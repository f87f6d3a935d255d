"""The history of checks in a Parquet file, one row a check."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

_ROBOT, _CAMERAS, _POSES, _CALIBRATION = b"robot", b"cameras", b"poses_rad", b"calibration_of_cameras"
_PARQUET = b"PAR1"  # at both ends of a file
_REMEDY = "put a copy in its place, or begin another with --history"


@dataclass(frozen=True)
class History:
    """n checks of one robot in one cell."""

    robot: str
    cameras: tuple[str, ...]
    q: np.ndarray  # rad, of the poses, (6, 6)
    time: np.ndarray  # s, of the checks, (n,)
    X_WE: np.ndarray  # of the poses, (n, 6, 4, 4)
    rotations: np.ndarray  # of the cameras, mean of a check in rad, (n, cameras, 3)
    alarms: list[list[dict[str, Any]]]  # of the cameras in each check
    # Of the cameras as they were calibrated: places in m, orientations and lenses, (cameras, k); None in a
    # history of before these were kept
    calibration: np.ndarray | None = None

    def appended(
        self, time: float, X_WE: np.ndarray, rotations: np.ndarray, alarms: list[dict[str, Any]]
    ) -> "History":
        """With one more check."""
        return History(
            self.robot,
            self.cameras,
            self.q,
            np.append(self.time, time),
            np.concatenate([self.X_WE, X_WE[None]]),
            np.concatenate([self.rotations, rotations[None]]),
            [*self.alarms, alarms],
            self.calibration,
        )


def new_history(robot: str, cameras: tuple[str, ...], q: np.ndarray, calibration: np.ndarray) -> History:
    """A history without a check."""
    nothing = np.zeros((0, len(q), 4, 4)), np.zeros((0, len(cameras), 3))
    return History(robot, cameras, q, np.zeros(0), *nothing, [], calibration)


def write_history(path: Path, history: History) -> None:
    """Writes a history. Raises OSError if it cannot be written."""
    n = len(history.time)
    columns: dict[str, Any] = {"time_s": history.time}
    for pose in range(len(history.q)):
        rows = history.X_WE[:, pose, :3].reshape(n, -1)
        columns |= {f"pose{pose + 1}_{k // 4}{k % 4}": rows[:, k] for k in range(12)}
    for i, name in enumerate(history.cameras):
        columns |= {f"camera_{name}_{axis}_rad": history.rotations[:, i, k] for k, axis in enumerate("xyz")}
    columns["camera_alarms"] = [json.dumps(each) for each in history.alarms]
    table = pa.table(columns).replace_schema_metadata(
        {
            _ROBOT: history.robot,
            _CAMERAS: json.dumps(history.cameras),
            _POSES: json.dumps(history.q.tolist()),
        }
        | ({} if history.calibration is None else {_CALIBRATION: json.dumps(history.calibration.tolist())})
    )
    pq.write_table(table, path)


def read_history(path: Path) -> History:
    """Reads what `write_history` has written.

    Raises:
        ValueError: if it is no such file, was cut off or is damaged.
        OSError: if it cannot be read.
    """
    _refuse_cut_off(path)
    try:
        table = pq.read_table(path)
        head = table.schema.metadata or {}
        cameras, q = tuple(json.loads(head[_CAMERAS])), np.array(json.loads(head[_POSES]))
        data = {name: table[name].to_numpy() for name in table.column_names if name != "camera_alarms"}
        n = table.num_rows
        X = np.tile(np.eye(4), (n, len(q), 1, 1))
        for pose in range(len(q)):
            rows = np.stack([data[f"pose{pose + 1}_{k // 4}{k % 4}"] for k in range(12)], -1)
            X[:, pose, :3] = rows.reshape(n, 3, 4)
        turns = [[data[f"camera_{name}_{axis}_rad"] for axis in "xyz"] for name in cameras]
        alarms = [json.loads(each) for each in table["camera_alarms"].to_pylist()]
        rotations, calibrated = np.moveaxis(np.array(turns), 2, 0), head.get(_CALIBRATION)
        calibration = None if calibrated is None else np.array(json.loads(calibrated))
        robot, time = head[_ROBOT].decode(), data["time_s"]
        return History(robot, cameras, q, time, X, rotations, alarms, calibration)
    except KeyError as error:
        raise ValueError(f"history {path}: not a history of truetip health") from error
    except (pa.ArrowException, OSError, ValueError) as error:
        if isinstance(error, OSError) and error.errno:  # of the system; what is packed wrongly has none
            raise
        raise ValueError(f"history {path}: the file is damaged: {_REMEDY}") from error


def _refuse_cut_off(path: Path) -> None:
    """Raises ValueError for a file without the end of a Parquet file, where its index stands."""
    content = path.read_bytes()
    if not _PARQUET.startswith(content[: len(_PARQUET)]):
        raise ValueError(f"history {path}: not a history of truetip health")
    if len(content) < 3 * len(_PARQUET) or not content.endswith(_PARQUET):
        raise ValueError(
            f"history {path}: the file is cut off after {len(content)} bytes, and without its end no check "
            f"in it can be read: {_REMEDY}"
        )
