"""``truetip design --program``: the measurement run as a robot program, and the table that it will fill."""

import re
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from experiments.cli.option_limits import one_of
from experiments.cli.staging import staged_folder
from experiments.report.files import write_text
from robots.description.model import NUM_JOINTS
from robots.programs.measurement_run import RUNS, MeasurementRun, table_to_fill

_DEFAULT = Path("out/measure.csv")
_ELSEWHERE = "move it away or give --write another name"
_LONGEST = 16  # characters of a name: KRL allows 24, and we append some


class ProgramFiles:
    """Files of a measurement run, written all at once; none where no program is wanted."""

    def __init__(self, language: str | None, beside: str | None, settle: float | None, trigger: str) -> None:
        """Checks the options.

        Args:
            language: one of `RUNS`, or None.
            beside: table of the configurations, whose name the files have; None for ``out/measure``.
            settle: s; None for half a second.
            trigger: digital output; empty for the default.

        Raises:
            ValueError: if an option is unknown, or has no effect.
        """
        if language is None and (settle is not None or trigger):
            raise ValueError("--settle and --trigger need --program")
        one_of("--program", RUNS, language)
        self._language, self._settle, self._trigger = language, 0.5 if settle is None else settle, trigger
        path = Path(beside or _DEFAULT)
        self._folder, self._stem = path.parent, path.stem
        self._name = re.sub(r"\W", "_", path.stem)[:_LONGEST]
        if not self._name[:1].isalpha():  # no language lets a name begin otherwise
            self._name = f"m_{self._name}"
        if language is not None:
            self._files(MeasurementRun(np.zeros((1, 6)), self._settle, trigger, self._name), False)

    @property
    def _measured(self) -> Path:
        """The table that people fill in."""
        return self._folder / f"{self._stem}_measured.csv"

    def staged(self, stack: ExitStack) -> Path | None:
        """The folder to write to.

        Raises:
            OSError: if it cannot be written, or an option names the table that the run will fill.
            ValueError: if somebody has filled that table already.
        """
        if self._language is None:
            return None
        if self._measured.is_file():
            rows = [line.split(",") for line in _text(self._measured).splitlines() if line[:1] != "#"]
            if any(field.strip() for row in rows[1:] for field in row[NUM_JOINTS:]):
                raise ValueError(f"{self._measured} holds measurements; {_ELSEWHERE}")
        return stack.enter_context(staged_folder(self._folder, self._measured.name))

    def write(
        self, stage: Path | None, q: np.ndarray, position_only: bool, vias: Sequence[np.ndarray] = ()
    ) -> list[Path]:
        """Writes program and table for configurations (n, 6) in rad; gives where they will be.

        ``vias`` are points on the way to each in rad, (k, 6); without them all ways are straight.

        Raises:
            ValueError: if the table to fill is there and is another one: joints may have been noted in it.
        """
        if stage is None:
            return []
        run = MeasurementRun(q, self._settle, self._trigger, self._name, tuple(vias))
        files = self._files(run, position_only)
        if self._measured.is_file() and _text(self._measured) != files[self._measured.name]:
            raise ValueError(f"{self._measured} is there and is not the table of this run; {_ELSEWHERE}")
        for name, text in files.items():
            write_text(stage / name, text)
        return [self._folder / name for name in files]

    def _files(self, run: MeasurementRun, position_only: bool) -> dict[str, str]:
        assert self._language is not None
        table = {self._measured.name: table_to_fill(run, position_only)}
        return RUNS[self._language](run) | table


def _text(path: Path) -> str:
    """A table as it is, whatever a spreadsheet has made of it."""
    return path.read_text(encoding="utf-8", errors="replace")
