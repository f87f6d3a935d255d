"""The record of a run as a stream on disk, an MCAP file; what is a second old survives the writer."""

import contextlib
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from mcap.writer import CompressionType, Writer

from diagrams.record.log import GuardEvent, RunLog
from diagrams.record.topics import (
    COMMAND,
    CORRECTION,
    DESIRED,
    EVENT,
    JOINTS,
    PATH_TIME,
    POSE,
    SCHEMAS,
    TRUE_LINKS,
    TRUE_POSE,
    pose_message,
)

_FLUSH = 1.0  # s, the longest time until what is logged is on the disk
SCENARIO, RUN = "scenario.yaml", "run"  # names of the attachment and of the metadata
PATH = "path"  # what ended a run that came to the end of its path


class Viewer(Protocol):
    """Who is told of the messages too, as `diagrams.record.foxglove_server.FoxgloveServer` is."""

    def write(self, topic: str, at: float, message: Mapping[str, Any]) -> None:
        """Takes a message of a topic of `SCHEMAS` at a time of the path in s."""
        ...


class RunRecord:
    """Writes messages to a file as they come; a full disk ends the writing and not the run."""

    def __init__(self, path: str | Path, scenario: str, viewer: Viewer | None = None) -> None:
        """Opens the file.

        Args:
            path: of the file. The first message takes the place of what is in it: a run that never begins
                leaves an earlier record as it is.
            scenario: its text, for the attachment.
            viewer: is told of every message too.

        Raises:
            OSError: if the file cannot be written.
        """
        self.path = Path(path)
        self.problem = ""  # why nothing is written any more, in words
        self._viewer = viewer
        self._scenario = scenario
        self._writer: Writer | None = None  # None while an earlier record stands
        if self.path.is_file():
            self._file = self.path.open("r+b")  # which leaves what is in it
        else:
            is_new = not self.path.exists()  # and no device
            self._file = self.path.open("wb")
            self._writer = self._begun()
            if is_new:
                self._file.flush()  # a process that is killed before the first message leaves no riddle
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._flushed = time.monotonic()

    def write(self, topic: str, at: float, message: Mapping[str, Any]) -> None:
        """Logs a message of a topic of `SCHEMAS` at a time of the path in s."""
        if self._viewer is not None:
            self._viewer.write(topic, at, message)
        if self.problem:
            return
        try:
            writer = self._writer = self._writer or self._begun()
            channel = self._channels.get(topic) or self._register(topic, writer)
            self._counts[topic] += 1
            stamp = max(0, round(1e9 * at))
            writer.add_message(channel, stamp, json.dumps(message).encode(), stamp, self._counts[topic])
            if time.monotonic() - self._flushed > _FLUSH:
                self.flush()
        except OSError as error:
            self._give_up(error)

    def flush(self) -> None:
        """Brings what has been written to the disk."""
        if self._writer is not None:
            self._writer.flush()
        self._file.flush()
        self._flushed = time.monotonic()

    def close(self, **metadata: object) -> None:
        """Ends the file with what is to be known of the run, as texts by name."""
        try:
            if self._writer is not None and not self.problem:
                self._writer.add_metadata(RUN, {name: json.dumps(value) for name, value in metadata.items()})
                self._writer.finish()
        except OSError as error:
            self._give_up(error)
        finally:
            with contextlib.suppress(OSError):  # what is left in the buffer of a full disk
                self._file.close()

    def _begun(self) -> Writer:
        """Begins the file, in the place of an earlier record. Raises OSError."""
        if self.path.is_file():
            self._file.truncate()
        writer = Writer(self._file, compression=CompressionType.LZ4)
        writer.start(profile="", library="truetip")
        writer.add_attachment(0, 0, SCENARIO, "application/yaml", self._scenario.encode())
        return writer

    def _register(self, topic: str, writer: Writer) -> int:
        schema = SCHEMAS[topic]
        number = writer.register_schema(schema["title"], "jsonschema", json.dumps(schema).encode())
        self._channels[topic] = writer.register_channel(topic, "json", number)
        self._counts[topic] = 0
        return self._channels[topic]

    def _give_up(self, error: OSError) -> None:
        size = self.path.stat().st_size if self.path.exists() else 0
        why = (error.strerror or str(error)).lower()
        self.problem = f"{self.path}: {why} after {size} bytes; what is written can be read"


def write_tick(
    record: RunRecord,
    at: float,
    stamp: float | None,
    joints: tuple[np.ndarray, np.ndarray],
    command: tuple[np.ndarray, np.ndarray],
    correction: np.ndarray,
    X_WE_desired: np.ndarray,
    path_time: float | None = None,
) -> None:
    """Logs what there is at every tick.

    Args:
        record: where to.
        at: s, of the path.
        stamp: s, the controller's clock; None in a simulation.
        joints: position (6,) rad and effort (6,) N m.
        command: position (6,) rad and velocity (6,) rad/s.
        correction: (6,) rad and m.
        X_WE_desired: (4, 4).
        path_time: s on the path where it is slowed; None where it is run as planned.
    """
    names = (JOINTS, ("position", "effort"), joints), (COMMAND, ("position", "velocity"), command)
    for topic, fields, values in names:
        message: dict[str, Any] = {
            field: _numbers(value) for field, value in zip(fields, values, strict=True)
        }
        record.write(topic, at, {"stamp": stamp, **message} if topic == JOINTS else message)
    turn, shift = _numbers(correction[:3]), _numbers(correction[3:])
    record.write(CORRECTION, at, {"rotation": turn, "translation": shift})
    record.write(DESIRED, at, pose_message(X_WE_desired, at))
    if path_time is not None:
        record.write(PATH_TIME, at, {"time": path_time})


def write_event(record: RunRecord, event: GuardEvent) -> None:
    """Logs an intervention."""
    record.write(EVENT, event.time, {"kind": event.kind, "detail": event.detail})


def marks(log: RunLog, ended: str) -> dict[str, object]:
    """What `RunRecord.close` is told of a run."""
    names = ("law", "seed", "path_start", "dwell_start", "path_end", "lap_starts", "guard_counts")
    return {**{name: getattr(log, name) for name in names}, "ended": ended}


def write_log(path: str | Path, scenario: str, log: RunLog, ended: str = PATH) -> None:
    """Writes a run that is over with the same topics, and the truth beside them.

    Raises:
        OSError: if the file cannot be written.
    """
    record = RunRecord(path, scenario)
    for n, at in enumerate(log.time.tolist()):
        write_tick(
            record,
            at,
            None,
            (log.joint_position[n], log.joint_effort[n]),
            (log.position_command[n], log.velocity_command[n]),
            log.correction[n],
            log.X_WE_desired[n],
            None if log.path_time is None else float(log.path_time[n]),
        )
        # The measured pose stands in the log where it was exposed.
        if np.isfinite(log.X_WE_measured[n]).all():
            record.write(POSE, at, pose_message(log.X_WE_measured[n], at))
        if np.isfinite(log.X_WE_true[n]).all():
            record.write(TRUE_POSE, at, pose_message(log.X_WE_true[n], at))
            record.write(TRUE_LINKS, at, {"position": _numbers(log.link_position[n])})
    for event in log.guard_events:
        write_event(record, event)
    record.close(**marks(log, ended))
    if record.problem:
        raise OSError(record.problem)


def _numbers(values: np.ndarray) -> list[float | None]:
    """For JSON, which has no number for what is none."""
    return [value if value == value else None for value in values.tolist()]
