"""Records of simulated runs, with the topics of those on hardware and the truth beside them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from diagrams.record.log import RunLog
from diagrams.record.run_record import PATH, write_log
from experiments.metrics.unfinished import unfinished
from experiments.report.style import law_file_name


def write_records(folder: Path, scenario: str, logs: Mapping[str, Sequence[RunLog]]) -> None:
    """Writes ``LAW-CYCLE.mcap`` for every run.

    Args:
        folder: where to.
        scenario: its text.
        logs: law -> one log per cycle.

    Raises:
        OSError: if a file cannot be written.
    """
    for law, cycles in logs.items():
        for number, log in enumerate(cycles, 1):
            record = folder / f"{law_file_name(law)}-{number}.mcap"
            write_log(record, scenario, log, unfinished(log) or PATH)
