"""Records of an earlier run in the folder of a new one, which would be taken for its records."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from diagrams.record.read_record import recorded_topics
from diagrams.record.topics import TRUE_POSE
from experiments.report.style import law_file_name

_LINK = "link.json"  # of a run on a station


@contextmanager
def replaced_records(folder: Path) -> Iterator[None]:
    """Takes the records of the run before out of a folder, once a block has put those of a new run there.

    As its other results they are replaced. Only what a simulation makes again is removed: a record of
    hardware, or one that was cut off, stays and is named on stderr.

    Raises:
        OSError: if a file cannot be removed.
    """
    before = {path: _stamp(path) for path in [*_named_records(folder), folder / _LINK] if path.is_file()}
    yield
    left = [path for path, stamp in before.items() if path.is_file() and _stamp(path) == stamp]
    for path in left:
        if TRUE_POSE in recorded_topics(path):
            path.unlink()
        else:
            typer.echo(
                f"truetip: {path} is of an earlier run and stays: no simulation makes it again", err=True
            )


def _named_records(folder: Path) -> list[Path]:
    """Where the records of the runs would be that the summary in a folder is of."""
    try:
        runs = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["runs"]
        return [
            folder / f"{law_file_name(law)}-{number}.mcap"
            for law, run in runs.items()
            for number in range(1, run["true"]["iso_9283"]["cycles"] + 1)
        ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):  # none, or one of something else
        return []


def _stamp(path: Path) -> tuple[int, int, int]:
    """What changes when a file is written or another takes its place."""
    found = path.stat()
    return found.st_ino, found.st_mtime_ns, found.st_size
