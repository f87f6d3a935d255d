"""``truetip compensate``: a robot program corrected for the robot as it is."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from experiments.cli.console import print_files, print_note, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import JsonOption, PictureOption
from experiments.cli.prepare import noted_robot
from experiments.cli.staging import PAGE, staged_file
from experiments.compensate.report import compensation_json, verdict, write_compensation_page
from experiments.compensate.study import CompensationStudy, compensate
from robots.description.model import RobotModel, load_robot
from robots.programs.read import SUFFIXES, unit_in_doubt

_SHOWN = 10  # remarks on the terminal


def compensate_command(
    program: Annotated[
        Path,
        typer.Argument(
            metavar="PROGRAM",
            help="ABB RAPID (.mod, .prg, .sys), KUKA KRL (.src, .dat), or a table of poses or joints (.csv).",
            show_default=False,
        ),
    ],
    robot: Annotated[
        str, typer.Option("--robot", metavar="FILE.yaml", help="The robot as `truetip calibrate` wrote it.")
    ],
    out: Annotated[
        Path, typer.Option("--write", metavar="NEW", help="The corrected program, of the same kind.")
    ],
    nominal: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            help="What the controller computes with.",
            show_default="what was calibrated",
        ),
    ] = None,
    others: Annotated[
        list[Path] | None,
        typer.Option(
            "--with",
            metavar="FILE",
            help="Declares tools and frames, or moves to targets of PROGRAM; is not changed. Repeatable.",
        ),
    ] = None,
    tool: Annotated[
        str, typer.Option(metavar="NAME|N", help="Tool of targets for which no instruction says one.")
    ] = "",
    base: Annotated[
        str, typer.Option(metavar="NAME|N", help="Work object or base of such targets.", show_default="world")
    ] = "",
    payload: Annotated[
        float | None,
        typer.Option(metavar="KG", help="Mass at the flange.", show_default="what the program says, or none"),
    ] = None,
    keep: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A target that stays as it is; repeatable.")
    ] = None,
    near: Annotated[
        str, typer.Option(metavar="Q1,...,Q6", help="Degrees, from where the first target is reached.")
    ] = "0,0,0,0,0,0",
    report: PictureOption = Path("out/compensate.html"),
    json_file: JsonOption = None,
) -> None:
    """Correct the targets of a robot program, so that the calibrated robot arrives where they say."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        true = load_robot(robot)
        if not true.is_calibrated:
            raise ValueError(f"--robot {robot} is a nominal robot; `truetip calibrate --write` makes one")
        believed = nominal or true.calibration.of
        if not believed:
            raise ValueError(f"--robot {robot} does not say which robot was calibrated; --nominal says it")
        if not nominal and load_robot(believed).is_calibrated:
            raise ValueError(
                f"--robot {robot} was calibrated on {believed}, which is calibrated itself; --nominal says "
                "what the controller computes with"
            )
        new = stack.enter_context(staged_file(out, *_suffixes(program)))
        page = stack.enter_context(staged_file(report, *PAGE))
        stack.enter_context(output.staged())
        print_note(human, unit_in_doubt(program))
        with progress_bar("targets") as progress:
            study = compensate(
                program,
                noted_robot(human, believed),
                true,
                [str(other) for other in others or []],
                (tool, base),
                payload,
                keep or [],
                _configuration(near),
                progress,
            )
        new.write_bytes(study.corrected.text.encode("latin-1"))
        write_compensation_page(page, study)
        output.write(compensation_json(study))
    _print(human, study, true)
    print_files(human, out, report)


def _suffixes(program: Path) -> tuple[str, ...]:
    suffix = program.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{program}: the name of a program must end in one of {', '.join(SUFFIXES)}")
    return (suffix,)


def _configuration(text: str) -> np.ndarray:
    try:
        q = np.deg2rad([float(part) for part in text.split(",")])
    except ValueError:
        q = np.zeros(0)
    if q.shape != (6,) or not np.isfinite(q).all():
        raise ValueError(f"--near must be six angles in degrees such as 0,20,10,0,40,0, got '{text}'")
    return q


def _print(console: Console, study: CompensationStudy, robot: RobotModel) -> None:
    console.print(escape(verdict(study)), highlight=False)
    remarks: list[tuple[int, Any]] = [(note.line, note.text) for note in study.corrected.notes]
    for each in study.results:
        named = f"{each.target.name}: " if each.target.name else ""
        remarks += [(each.target.line, named + remark) for remark in each.remarks]
    for line, text in sorted(remarks)[:_SHOWN]:
        where = f"{study.program.name}, line {line}"
        console.print(f"[yellow]{escape(f'{where}: {text}')}[/yellow]", soft_wrap=True)
    if len(remarks) > _SHOWN:
        console.print(f"[yellow]and {len(remarks) - _SHOWN} more, in the report[/yellow]")
    for text in study.notes:
        console.print(f"[yellow]{escape(text)}[/yellow]", soft_wrap=True)
    console.print()
