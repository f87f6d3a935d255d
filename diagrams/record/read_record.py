"""Reads the record of a run, also one whose writer was killed."""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.records import Attachment, Channel, Footer, Message, Metadata
from mcap.stream_reader import StreamReader

from diagrams.record.run_record import RUN, SCENARIO


@dataclass
class Topic:
    """The messages of a topic as columns, n rows."""

    time: np.ndarray  # (n,) s, of the path
    columns: dict[str, np.ndarray]  # by field; (n, size), or texts


@dataclass
class Contents:
    """What stands in a file."""

    topics: dict[str, Topic] = field(default_factory=dict)
    scenario: str = ""
    run: dict[str, Any] = field(
        default_factory=dict
    )  # law, path marks, why it ended; empty if it was cut off
    is_complete: bool = False  # whether the writer came to its end


def read_record(path: str | Path) -> Contents:
    """Reads a file up to its end, or as far as it was written.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is no MCAP file, or its messages are not JSON.
    """
    contents, channels = Contents(), dict[int, str]()
    times: dict[str, list[int]] = {}
    messages: dict[str, list[dict[str, Any]]] = {}
    with Path(path).open("rb") as file:
        try:
            for record in StreamReader(file).records:
                if isinstance(record, Channel):
                    if record.message_encoding != "json":
                        raise ValueError(f"{path}: messages in {record.message_encoding}, not in JSON")
                    channels[record.id] = record.topic
                elif isinstance(record, Message):
                    topic = channels[record.channel_id]
                    times.setdefault(topic, []).append(record.log_time)
                    messages.setdefault(topic, []).append(json.loads(record.data))
                elif isinstance(record, Attachment) and record.name == SCENARIO:
                    contents.scenario = record.data.decode()
                elif isinstance(record, Metadata) and record.name == RUN:
                    contents.run = {name: json.loads(value) for name, value in record.metadata.items()}
                contents.is_complete = contents.is_complete or isinstance(record, Footer)
        except InvalidMagic as error:
            # At the end it is missing where the writer was killed.
            if not channels and not contents.scenario:
                raise ValueError(f"{path}: not an MCAP file") from error
        except (EndOfFile, McapError, struct.error) as error:
            # Else it is what was being written when the writer was killed.
            if not channels and not contents.scenario and not contents.run:
                raise ValueError(f"{path}: not an MCAP file") from error
    for topic, rows in messages.items():
        at = 1e-9 * np.array(times[topic], dtype=float)
        contents.topics[topic] = Topic(at, _columns(rows))
    return contents


def _columns(rows: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    flat = [_flat(row) for row in rows]
    found = {}
    for name, first in flat[0].items():
        values = [row[name] for row in flat]
        kind = object if isinstance(first, str) else float
        found[name] = np.array(values, dtype=kind).reshape(len(rows), -1)
    return found


def _flat(row: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = value
    return found
