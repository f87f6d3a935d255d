"""Reads the record of a run, also one whose writer was killed."""

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import MCAP0_MAGIC

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
    )  # law, path marks, why it ended; may be empty if cut off
    is_complete: bool = False  # whether the writer came to its end
    cut: str = ""  # where the file ends early or is damaged, in words; empty if all messages are there

    def lacking(self, *topics: str) -> str:
        """What is missing of these topics, in words; empty if all are there."""
        missing = ", ".join(topic for topic in topics if topic not in self.topics)
        because = f": the file {self.cut}" if self.cut else ""
        return f"no messages of {missing}{because}" if missing else ""


def read_record(path: str | Path) -> Contents:
    """Reads a file up to its end, or as far as it was written and is whole.

    Raises:
        OSError: if it cannot be read.
        ValueError: if it is no MCAP file, nothing can be read of it, or its messages are not JSON.
    """
    contents, channels = Contents(), dict[int, str]()
    times: dict[str, list[int]] = {}
    messages: dict[str, list[dict[str, Any]]] = {}
    size = Path(path).stat().st_size
    with Path(path).open("rb") as file:
        head = file.read(len(MCAP0_MAGIC))
        if not head or not MCAP0_MAGIC.startswith(head):
            raise ValueError(f"{path}: not an MCAP file{'' if head else ', it is empty'}")
        file.seek(0)
        damage, has_all, stream = "", False, _Stream(file)
        try:
            for record in stream.records():
                if isinstance(record, Channel):
                    if record.message_encoding != "json":
                        raise _OtherEncodingError(
                            f"{path}: messages in {record.message_encoding}, not in JSON"
                        )
                    channels[record.id] = record.topic
                elif isinstance(record, Message):
                    topic, row = channels[record.channel_id], json.loads(record.data)
                    times.setdefault(topic, []).append(record.log_time)
                    messages.setdefault(topic, []).append(row)
                elif isinstance(record, Attachment) and record.name == SCENARIO:
                    contents.scenario = record.data.decode()
                elif isinstance(record, Metadata) and record.name == RUN:
                    contents.run = {name: json.loads(value) for name, value in record.metadata.items()}
                has_all = has_all or isinstance(record, DataEnd)
                contents.is_complete = isinstance(record, Footer)
        except _OtherEncodingError:
            raise
        except (InvalidMagic, EndOfFile, struct.error):  # of what was written when the writer was killed
            damage = f"ends early at byte {size}"
        except (
            McapError,
            KeyError,
            RuntimeError,
            ValueError,
        ):  # of the decompression, of JSON, of a checksum
            damage = f"is damaged before byte {file.tell()}"
        if damage and not has_all:
            number = sum(map(len, times.values()))
            contents.cut = f"{damage}, {f'after {number} messages' if number else stream.before_all()}"
            if not channels and not contents.scenario and not contents.run:
                raise ValueError(f"{path}: the MCAP file {contents.cut}")
    for topic, rows in messages.items():
        at = 1e-9 * np.array(times[topic], dtype=float)
        try:
            contents.topics[topic] = Topic(at, _columns(rows))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: the messages of {topic} are no rows of one table") from error
    return contents


def recorded_topics(path: str | Path) -> set[str]:
    """The topics of a record, without its messages; empty of one that was cut off and of what is none.

    Raises:
        OSError: if it cannot be read.
    """
    with Path(path).open("rb") as file:
        try:
            found = make_reader(file).get_summary()
        except (McapError, OSError, struct.error, ValueError):
            return set()
    return {channel.topic for channel in found.channels.values()} if found else set()


class _Stream:
    """The records of a file; messages stand in blocks that are packed and checked as a whole."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._begun = file, len(MCAP0_MAGIC)  # where a record or a block begins

    def records(self) -> Iterator[McapRecord]:
        """All of them, those of a block once the whole of it is there."""
        for record in StreamReader(self._file, emit_chunks=True, validate_crcs=True).records:
            if isinstance(record, Chunk):
                yield from breakup_chunk(record, validate_crc=True)
            else:
                yield record
            self._begun = self._file.tell()

    def before_all(self) -> str:
        """Where the file ended for want of any message, in words."""
        self._file.seek(self._begun)
        if self._file.read(1) != bytes([Opcode.CHUNK]):
            return "before its first message"
        return "within its first block of messages, of which none can be read without the rest"


class _OtherEncodingError(ValueError):
    """Messages that are not JSON."""


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
