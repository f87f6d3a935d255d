"""A program, corrected and checked: what ``truetip compensate`` computes."""

import codecs
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from experiments.cli.console import count
from robots.description.model import RobotModel
from robots.programs.compensation import Compensation, FalseTarget, Refusal
from robots.programs.program import Program, ProgramContext, ProgramError, Source, edited, read_source
from robots.programs.read import parse_program, read_program

_SHOWN = 3  # refusals that one line names
_RIGHT = 1e-9  # m and rad: what a corrected target may miss by, which its digits allow


@dataclass(frozen=True)
class CompensationStudy:
    """The outcome for n targets."""

    nominal: RobotModel
    program: Program  # as it was
    corrected: Program  # as it is written
    results: list[FalseTarget]
    errors_after: np.ndarray  # (n, 6) rad, m; of the corrected program, read anew
    errors_stored: np.ndarray  # (n, 6) likewise, with numbers in the single precision of controllers
    notes: tuple[str, ...]  # about the whole

    @property
    def errors_before(self) -> np.ndarray:
        """Wanted less true poses of the program as it was, (n, 6) rad, m."""
        return np.array([each.error_before for each in self.results]).reshape(-1, 6)

    @property
    def shifts(self) -> np.ndarray:
        """By which targets were moved, (n, 6) rad, m."""
        return np.array([each.shift for each in self.results]).reshape(-1, 6)


def compensate(
    path: Path,
    nominal: RobotModel,
    calibrated: RobotModel,
    others: Sequence[str] = (),
    frames: tuple[str, str] = ("", ""),
    payload: float | None = None,
    keep: Sequence[str] = (),
    q_near: np.ndarray | None = None,
    progress: Callable[[float], None] | None = None,
) -> CompensationStudy:
    """Corrects a program.

    Args:
        path: of the program.
        nominal: what the controller computes with.
        calibrated: the robot as it is.
        others: files that declare tools and frames.
        frames: tool and base of targets for which nothing says one.
        payload: kg; None for what the program says.
        keep: names of targets that stay as they are.
        q_near: rad, (6,), from where the first target is reached.
        progress: is called with the share that is done.

    Raises:
        ValueError: if the program cannot be read, or a target cannot be reached: the message has its line.
    """
    for name in (path, *others):
        _refuse_wide_characters(Path(name))
    program = _without(read_program(path, others, *frames), keep)
    if payload is not None and not 0.0 <= payload <= nominal.payload.largest_mass:
        raise ValueError(f"--payload must be 0 to {nominal.payload.largest_mass:g} kg, got {payload:g}")
    compensation = Compensation(nominal, calibrated, payload)
    found = compensation.false_targets(program, np.zeros(6) if q_near is None else q_near, progress)
    refusals = [each for each in found if isinstance(each, Refusal)]
    if refusals:
        raise ProgramError(_refused(program, refusals))
    results = [each for each in found if isinstance(each, FalseTarget)]
    text = edited(program.text, [edit for each in results for edit in each.edits.items()])
    context = ProgramContext(tuple(read_source(other) for other in others), *frames)
    corrected = _without(parse_program(Source(program.name, text), context), keep)
    errors = compensation.errors(corrected, results)
    if np.abs(errors).max(initial=0.0) > _RIGHT:
        worst = int(np.argmax(np.abs(errors).max(axis=1)))
        line = corrected.targets[worst].line
        raise ProgramError(
            f"{program.name}, line {line}: the corrected target misses by {1e3 * np.abs(errors).max():.2g} "
            "(mm or 1e-3 rad): the controller would take another configuration"
        )
    stored = replace(corrected, targets=tuple(each.in_single_precision() for each in corrected.targets))
    notes = _notes(program, compensation, payload)
    errors_stored = compensation.errors(stored, results)
    return CompensationStudy(nominal, program, corrected, results, errors, errors_stored, notes)


def _without(program: Program, keep: Sequence[str]) -> Program:
    names = {target.name.lower() for target in program.targets}
    unknown = [name for name in keep if name.lower() not in names]
    if unknown:
        raise ProgramError(f"{program.name}: --keep {unknown[0]}: no target that is corrected has this name")
    kept = {name.lower() for name in keep}
    return replace(program, targets=tuple(each for each in program.targets if each.name.lower() not in kept))


def _refused(program: Program, refusals: Sequence[Refusal]) -> str:
    texts = []
    for each in refusals[:_SHOWN]:
        named = f"{each.target.name}: " if each.target.name else ""
        texts.append(f"line {each.target.line}: {named}{each.why}")
    more = f"; and {len(refusals) - _SHOWN} more" if len(refusals) > _SHOWN else ""
    return f"{program.name}, {'; '.join(texts)}{more}; nothing is written"


def _notes(program: Program, compensation: Compensation, payload: float | None) -> tuple[str, ...]:
    notes = []
    if not program.targets:
        notes.append("There is no target to correct; the program is written as it is.")
    foreign = sorted(
        {
            each.tool.name
            for each in program.targets
            if each.tool and not compensation.uses_measured_tool(each)
        }
    )
    if foreign:
        notes.append(
            f"Not the tool of the calibration: {', '.join(foreign)}. It is taken as declared, on the flange; "
            "what a calibration found of its own tool is left out."
        )
    silent = [each for each in program.targets if not each.payloads]
    if compensation.is_compliant and payload is None and silent:
        of = count(len(silent), "target")
        notes.append(f"The load of {of} is not said and taken as zero; --payload says it.")
    return tuple(notes)


def _refuse_wide_characters(path: Path) -> None:
    """Raises ProgramError for a file in UTF-16, in which no target would be found."""
    with path.open("rb") as file:
        if file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            raise ProgramError(f"{path}: saved as UTF-16, which controllers do not read; save it as UTF-8")
