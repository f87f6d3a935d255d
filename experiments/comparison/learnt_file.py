"""``--write``: the robot as a law has calibrated it at work, in a file for ``--robot`` of other commands."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from diagrams.record.log import RunLog
from experiments.cli.staging import YAML, check_suffix, staged_file
from experiments.report.files import write_text
from robots.description.robot_file import robot_text
from systems.servo import LAWS

WriteOption = Annotated[
    str | None,
    typer.Option(
        "--write", metavar="FILE.yaml", help="The robot as the law has calibrated it, for --robot of others."
    ),
]


def calibrating_law(laws: Sequence[str]) -> str:
    """The one of some laws that calibrates robots.

    Raises:
        ValueError: if there is none, or more than one.
    """
    found = [law for law in laws if hasattr(LAWS.find(law), "calibrated_robot")]
    if len(found) != 1:
        raise ValueError(
            "--write: needs one law that calibrates the robot, such as self_calibrating, "
            f"got {', '.join(laws)}"
        )
    return found[0]


def check_write(file: str | None, laws: Sequence[str]) -> None:
    """Refuses ``--write`` before anything is built.

    Raises:
        OSError: if the name of the file does not say that it is YAML.
        ValueError: as `calibrating_law`.
    """
    if file is not None:
        calibrating_law(laws)
        check_suffix(file, YAML)


def robot_writer(
    stack: ExitStack, file: str | None, laws: Sequence[str]
) -> Callable[[Mapping[str, Sequence[RunLog]]], None]:
    """Prepares the file; returns what writes it from the logs of the laws, the robot of the last run.

    Raises:
        OSError: if the file cannot be written.
        ValueError: as `calibrating_law`.
    """
    if file is None:
        return lambda logs: None
    law = calibrating_law(laws)
    path = stack.enter_context(staged_file(file, *YAML))

    def write(logs: Mapping[str, Sequence[RunLog]]) -> None:
        if law not in logs:  # it ended before its path began
            return
        robot = logs[law][-1].calibrated
        assert robot is not None  # of a law that calibrates
        write_text(path, robot_text(robot, beside=Path(file)))

    return write
