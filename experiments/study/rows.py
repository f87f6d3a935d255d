"""One row of a study: a law at a point of the design, run wherever there is a free core."""

import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from diagrams.runs.simulation import run
from diagrams.scenario.kept import file_of, named_files, with_inner_files
from diagrams.scenario.scenario import scenario_text
from experiments.cli.prepare import Prepared, prepare
from experiments.cli.workers import Progress
from experiments.comparison.compare import simulating
from experiments.metrics.single_figures import FIGURES, single_figures
from experiments.metrics.unfinished import unfinished
from experiments.study.designs import Value, design_points
from experiments.study.study_file import Study
from systems.named_classes import place_in_own_file


@dataclass(frozen=True)
class StudyRow:
    """What is run, in a form that is small enough to have a million of."""

    number: int
    point: int  # of the design
    repetition: int
    law: str
    scenario: str
    settings: tuple[str, ...]  # that all rows have
    factors: tuple[tuple[str, Value], ...]
    seed: int  # of the camera's noise
    is_quick: bool

    @property
    def all_settings(self) -> list[str]:
        """Of the scenario, as ``--set`` takes them."""
        varied = [f"{key}={value if isinstance(value, str) else repr(value)}" for key, value in self.factors]
        return [*self.settings, f"seed={self.seed}", *varied]

    @property
    def command(self) -> str:
        """The command line that repeats it."""
        settings = [word for setting in self.all_settings for word in ("--set", setting)]
        quick = ["--quick"] if self.is_quick else ["--cycles", "1"]
        words = ["truetip", "compare", "--scenario", self.scenario, "--laws", self.law, *quick, *settings]
        return shlex.join(words)


def study_rows(study: Study) -> list[StudyRow]:
    """All rows of a study, point by point; all laws of a point see the same noise."""
    points = design_points(study.factors, study.design, study.seed)
    rows = [
        (number, repetition, law, tuple(point.items()))
        for number, point in enumerate(points)
        for repetition in range(study.repetitions)
        for law in study.laws
    ]
    return [
        StudyRow(
            number=number,
            point=point,
            repetition=repetition,
            law=law,
            scenario=study.scenario,
            settings=tuple(study.settings),
            factors=factors,
            seed=study.seed + repetition,
            is_quick=study.quick,
        )
        for number, (point, repetition, law, factors) in enumerate(rows)
    ]


def run_row(row: StudyRow, progress: Progress) -> dict[str, Any]:
    """Runs it and gives its line of the table; one that fails has ``failure`` in place of numbers.

    So has one that the guard did not let come to the end of its path.

    ``wall_s`` is how long it took, which is not the same in two runs of a study.
    """
    line: dict[str, Any] = {
        "row": row.number,
        "point": row.point,
        "repetition": row.repetition,
        "law": row.law,
        "seed": row.seed,
        "failure": "",
        "command": row.command,
        "wall_s": float("nan"),
        **dict(row.factors),
        **dict.fromkeys(FIGURES, float("nan")),
    }
    try:
        prepared = prepare(row.scenario, row.all_settings, is_quick=row.is_quick)
        with simulating(row.law, row.seed):
            log = run(prepared.scenario, row.law, prepared.robot, progress=progress)
        if ending := unfinished(log):  # its figures would be those of another task
            return line | {"failure": ending, "wall_s": log.wall_time}
        return line | single_figures(log) | {"wall_s": log.wall_time}
    # A refused combination or a run that broke off is a result of the study; the others shall go on.
    except (ValueError, RuntimeError) as error:
        return line | {"failure": " ".join(str(error).split())}
    # What else a class of one's own raises, and what Drake's own checks do.
    except (Exception, SystemExit) as error:
        told = place_in_own_file(error) or f"{type(error).__name__}: {' '.join(str(error).split())}"
        return line | {"failure": told}


def first_run(rows: Sequence[StudyRow]) -> dict[str, Any]:
    """What the first row runs; with the commands of the others it says what they run.

    It refuses a study whose keys are misspelt or whose values are of the wrong kind before anything runs.

    Returns:
        The whole scenario as YAML, ``first_scenario``, and if there are any what identifies the files that it
        and the rows name, and those that these name in turn: ``files``.

    Raises:
        ValueError: with what the scenario refuses in the first row.
    """
    first = rows[0]
    try:
        prepared = prepare(first.scenario, first.all_settings, is_quick=first.is_quick)
    except ValueError as error:
        raise ValueError(f"the first run of the study is refused: {error}") from error
    named = {row.law for row in rows} | {value for row in rows for _, value in row.factors}
    files = {file_of(name) for name in [*named, prepared.calibrated] if isinstance(name, str)}
    files |= set(named_files(prepared.scenario))
    files = with_inner_files(filter(None, files))
    said: dict[str, Any] = {"first_scenario": f"# {prepared.title}\n{scenario_text(prepared.scenario)}"}
    marks = {str(file): sha256(file.read_bytes()).hexdigest() for file in files}
    return said | ({"files": marks} if marks else {})


def prepared_of(rows: Sequence[StudyRow]) -> list[Prepared]:
    """The first row of each robot that the rows vary, ready to run; one that is refused is left out."""
    first = {dict(row.factors).get("robot"): row for row in reversed(rows)}
    prepared = []
    for row in reversed(first.values()):
        with suppress(ValueError):
            prepared.append(prepare(row.scenario, row.all_settings, is_quick=row.is_quick))
    return prepared
