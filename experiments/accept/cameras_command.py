"""``truetip accept cameras``: lengths of a ball bar along seven lines, as VDI/VDE 2634, part 1, has them."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import plotly.graph_objects as go
import typer
from rich.markup import escape

from experiments.cli.console import print_files, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.option_limits import at_least, in_millimetres, positive, refuse_given
from experiments.cli.options import JsonOption, PictureOption
from experiments.cli.staging import PAGE, staged_file
from experiments.report.plot_page import Section, html_table, write_plot_page
from robots.text_table import TextTableError, finite_number, parse_fields, read_text
from systems.vision.camera_rig import load_cell
from systems.vision.triangulation import triangulate

COLUMNS = ("line", "nominal_mm", "measured_mm")
# Of what `judged` says, for people.
_NAMES = {
    "lines": "lines",
    "lengths": "lengths",
    "largest_length_error_mm": "largest error of a length, mm",
    "at_line": "on line",
    "at_length_mm": "at the length, mm",
    "probing_error_mm": "probing error, mm",
    "limit_mm": "permitted error of a length, mm",
    "passed": "passed",
}
LINES, LEAST_LENGTHS = 7, 5
_OF_SIMULATION = "cell", "calibration", "cube_mm", "pixel_sigma", "count", "seed"  # options
_IN_METRES = 20.0  # mm; no bar is shorter, but one of 20 m in metres
_PROBED = 25  # times that one ball is measured for the probing error
# Directions of the lines in a box: its space diagonals, and three parallel to its edges.
_DIRECTIONS = np.array(
    [[1, 1, 1], [-1, 1, 1], [1, -1, 1], [1, 1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float
)


def accept_cameras_command(
    context: typer.Context,
    lengths: Annotated[
        str | None,
        typer.Option(
            metavar="FILE.csv", help=f"Measured lengths: {', '.join(COLUMNS)}.", show_default="simulated"
        ),
    ] = None,
    cell: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="The true cameras of a simulation.")
    ] = "probst",
    calibration: Annotated[
        str | None,
        typer.Option(metavar="FILE.yaml", help="What is believed of the cameras.", show_default="the truth"),
    ] = None,
    limit: Annotated[float, typer.Option(metavar="MM", help="Largest permissible error of a length.")] = 0.2,
    cube_mm: Annotated[
        float, typer.Option("--cube", metavar="MM", help="Edge of the cube that is tested.")
    ] = 1000.0,
    pixel_sigma: Annotated[
        float, typer.Option("--pixel-sigma", metavar="PX", help="Noise of an image coordinate.")
    ] = 0.1,
    count: Annotated[int, typer.Option(metavar="N", help="Lengths on each line.")] = LEAST_LENGTHS,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of the noise.")] = 0,
    out: PictureOption = Path("out/accept-cameras.html"),
    json_file: JsonOption = None,
) -> None:
    """Test the lengths that the cameras measure, simulated or recorded, against a stated maximum."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        at_least("--count", LEAST_LENGTHS, count)
        at_least("--seed", 0, seed)
        for name, value in (("--limit", limit), ("--pixel-sigma", pixel_sigma)):
            positive(name, value)
        in_millimetres("--cube", cube_mm)
        probing = None
        if lengths is None:
            table, probing = simulated(cell, calibration or cell, 1e-3 * cube_mm, pixel_sigma, count, seed)
        else:
            refuse_given(context, _OF_SIMULATION, "with --lengths: nothing is simulated")
            table = read_lengths(lengths)
        numbers = judged(table, probing, limit)
        page = stack.enter_context(staged_file(out, *PAGE))
        stack.enter_context(output.staged())
        figure = go.Figure()
        for line in np.unique(table[:, 0]):
            own = table[table[:, 0] == line]
            error = own[:, 2] - own[:, 1]
            figure.add_trace(go.Scatter(x=own[:, 1], y=error, mode="markers", name=f"line {line:g}"))
        for sign in (-1.0, 1.0):
            figure.add_hline(y=sign * limit, line={"dash": "dot", "width": 1})
        figure.update_layout(xaxis={"title": "length in mm"}, yaxis={"title": "measured less nominal in mm"})
        rows = [[_NAMES[name], _said(value)] for name, value in numbers.items()]
        sections = [
            Section("Errors of the lengths", "Dotted: what is permitted.", figure),
            Section("Numbers", "", html_table(("what", "value"), rows)),
        ]
        write_plot_page(page, "Acceptance of the cameras", _verdict(numbers), sections)
        output.write(numbers)
    human.print(escape(_verdict(numbers)))
    print_files(human, out)


def simulated(
    cell: str, calibration: str, edge: float, pixel_sigma: float, count: int, seed: int
) -> tuple[np.ndarray, float]:
    """Lengths of a ball bar that a cell measures: rows of `COLUMNS`, and the probing error in mm.

    The probing error is the spread of the distances of one ball from its mean place, over 25 measurements.

    Raises:
        ValueError: if the cells have other cameras, or a ball is not seen by two of them.
    """
    rig, believed = load_cell(cell), load_cell(calibration)
    if [each.name for each in rig.cameras] != [each.name for each in believed.cameras]:
        raise ValueError(
            f"--calibration {calibration}: its cameras must be those of the cell {cell}; --cell names another"
        )
    cameras, known = rig.camera_model(), believed.camera_model()
    middle, rng, rows = 1e-3 * rig.target_mm, np.random.default_rng(seed), []

    def measured(p: np.ndarray) -> np.ndarray:
        pixels = cameras.project(p) + pixel_sigma * rng.standard_normal((len(cameras), len(p), 2))
        inside = ((pixels >= 0.0) & (pixels < rig.sensor_px)).all(axis=-1)
        pixels[~inside] = np.nan
        found = triangulate(known, pixels, pixel_sigma).p_W
        if np.isnan(found).any():
            raise ValueError(f"--cube {1e3 * edge:g}: a ball is not seen by two cameras; make it smaller")
        return found

    for number, direction in enumerate(_DIRECTIONS, 1):
        reach = edge * np.linalg.norm(direction)  # a space diagonal is longer than an edge
        along = direction / np.linalg.norm(direction)
        for length in np.linspace(reach / count, reach, count):
            ends = measured(middle + np.outer([-0.5 * length, 0.5 * length], along))
            rows.append([number, 1e3 * length, 1e3 * float(np.linalg.norm(ends[1] - ends[0]))])
    balls = np.array([measured(middle[None])[0] for _ in range(_PROBED)])
    away = np.linalg.norm(balls - balls.mean(axis=0), axis=1)
    return np.array(rows), 1e3 * float(away.max() - away.min())


def read_lengths(path: str) -> np.ndarray:
    """Lines, nominal and measured lengths of a table, (n, 3).

    Raises:
        TextTableError: if it cannot be read, or there are fewer lines or lengths than the guideline wants.
    """
    table = parse_fields(read_text(path), path, has_head=True)
    head = table.rows[0]
    missing = [name for name in COLUMNS if head.count(name) != 1]
    if missing:
        raise TextTableError(
            f"{table.where(0)}: {head.count(missing[0]) or 'no'} columns '{missing[0]}'; "
            f"needed is one each of {', '.join(COLUMNS)}"
        )
    rows = []
    for number, fields in enumerate(table.rows[1:], 1):
        if len(fields) != len(head):
            raise TextTableError(f"{table.where(number)}: {len(head)} fields are needed, got {len(fields)}")
        row = dict(zip(head, fields, strict=True))
        values = [finite_number(row[name], table.separator) for name in COLUMNS]
        for name, value in zip(COLUMNS, values, strict=True):
            if value is None:
                raise TextTableError(
                    f"{table.where(number)}: {name} is not a finite number, got '{row[name]}'"
                )
        _refuse_row(row, values, table.where(number))
        rows.append(values)
    found = np.array(rows, dtype=float).reshape(-1, len(COLUMNS))
    lines = np.unique(found[:, 0])
    # A length that was measured several times is one length, to a mm: the guideline wants different ones.
    least = min((len(np.unique(found[found[:, 0] == line, 1].round())) for line in lines), default=0)
    if len(lines) < LINES or least < LEAST_LENGTHS:
        raise TextTableError(
            f"{path}: {LINES} lines with {LEAST_LENGTHS} lengths each are needed, got {len(lines)} lines "
            f"with {least} different ones at least"
        )
    return found


def _refuse_row(row: dict[str, str], values: list[float | None], where: str) -> None:
    """Raises TextTableError for what is no line of a ball bar's lengths."""
    line, *lengths = values
    if line is None or line != round(line):
        raise TextTableError(f"{where}: line must be the number of a line, got '{row['line']}'")
    for name, value in zip(COLUMNS[1:], lengths, strict=True):
        if value is None or value < _IN_METRES:
            raise TextTableError(
                f"{where}: {name} must be at least {_IN_METRES:g}, got {row[name]}: is it in mm?"
            )


def judged(table: np.ndarray, probing: float | None, limit: float) -> dict[str, Any]:
    """The largest error of a length, the probing error and the verdict."""
    error = table[:, 2] - table[:, 1]
    worst = int(np.abs(error).argmax())
    return {
        "lines": len(np.unique(table[:, 0])),
        "lengths": len(table),
        "largest_length_error_mm": round(float(error[worst]), 4),
        "at_line": round(float(table[worst, 0])),
        "at_length_mm": round(float(table[worst, 1]), 3),
        "probing_error_mm": None if probing is None else round(probing, 4),
        "limit_mm": limit,
        "passed": bool(np.abs(error).max() <= limit),
    }


def _said(value: float | bool | None) -> str:
    if value is None:
        return "not measured"
    return ("no", "yes")[value] if isinstance(value, bool) else f"{value:g}"


def _verdict(numbers: dict[str, Any]) -> str:
    said = "passed" if numbers["passed"] else "not passed"
    where = f"line {numbers['at_line']}, {numbers['at_length_mm']:.0f} mm"
    limit, error = numbers["limit_mm"], numbers["largest_length_error_mm"]
    return (
        f"{numbers['lengths']} lengths on {numbers['lines']} lines: the largest error is {error:+.3f} mm "
        f"({where}), permitted are {limit:g} mm: {said}."
    )
