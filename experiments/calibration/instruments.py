"""``truetip calibrate`` from tables of several targets and instruments."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape

from experiments.calibration.words import rounded, unit
from experiments.cli.console import print_files
from experiments.cli.json_output import JsonOutput
from experiments.cli.staging import YAML, staged_file, staged_folder
from experiments.report.files import write_text
from experiments.report.plot_page import Section, sortable_table, write_plot_page
from robots.calibration.instruments.identify import InstrumentCalibration, identify_with_instruments
from robots.calibration.instruments.observation_file import read_cell, read_observations
from robots.calibration.instruments.observations import MeasuringCell
from robots.calibration.measurement_file import RowProblem
from robots.description.model import RobotModel
from robots.description.robot_file import robot_text
from robots.pose import zyx_from_rotation

_CONFIDENCE = 1.96  # standard deviations to either side hold 95 %


def calibrate_with_instruments(
    console: Console,
    output: JsonOutput,
    robot: tuple[str, RobotModel],
    tables: tuple[str, str | None],
    out: Path,
    write: str | None,
    joint_errors: tuple[str, ...] = (),
    compliance: bool = False,
) -> None:
    """Reads, adjusts and writes.

    Args:
        console: for people.
        output: takes the numbers.
        robot: name and nominal model.
        tables: the measurements, and what is known of the cell if there is such a file.
        out: folder of the report.
        write: file of the calibrated robot.
        joint_errors, compliance: what to identify, as for `identify_with_instruments`.

    Raises:
        ValueError: if a file cannot be used or the adjustment fails.
        OSError: if a result cannot be written.
    """
    name, nominal = robot
    seen, problems = read_observations(tables[0])
    cell = read_cell(tables[1]) if tables[1] else MeasuringCell({}, {}, {}, {})
    known = {*seen.targets, *seen.instruments}
    for label in (*cell.places, *cell.frames, *cell.anchors, *cell.sigmas):
        if label not in known:
            raise ValueError(f"cell {tables[1]}: no line is of {label}; there are {', '.join(sorted(known))}")
    with ExitStack() as stack:
        stage = stack.enter_context(staged_folder(out))
        robot_file = stack.enter_context(staged_file(write, *YAML)) if write else None
        stack.enter_context(output.staged())
        found = identify_with_instruments(nominal, seen, cell, joint_errors, compliance)
        output.write(instruments_json(found, tables[0], problems))
        _write_page(stage / "report.html", found)
        if robot_file:
            write_text(robot_file, robot_text(found.calibrated_robot(name)))
    console.print(escape(sentence(found)))
    for problem in problems:
        console.print(
            f"[yellow]{escape(f'{tables[0]}, line {problem.row}: {problem.what}; left out')}[/yellow]"
        )
    if found.outliers:
        lines = ", ".join(map(str, found.outliers))
        console.print(f"[yellow]Gross errors, left out: lines {lines}[/yellow]")
    console.print()
    print_files(console, out / "report.html", write)


def sentence(found: InstrumentCalibration) -> str:
    """What was reached, in words."""
    seen = found.observations
    text = (
        f"{len(seen)} lines of {len(seen.targets)} targets and {len(seen.instruments)} instruments at "
        f"{len(seen.q)} configurations, adjusted together in {found.iterations} iterations. "
    )
    for number, name in enumerate(seen.instruments):
        lines = found.used & (seen.instrument == number)
        before, after = (
            1e3 * float(np.sqrt(np.nanmean(e[lines] ** 2))) for e in (found.before, found.residuals)
        )
        text += (
            f"{name}: {before:.3f} to {after:.4g} mm (rms), noise {1e3 * found.noise[1 + number]:.2g} mm. "
        )
    return text + f"Noise of the joints {np.rad2deg(found.noise[0]):.2g} degrees."


def instruments_json(found: InstrumentCalibration, file: str, problems: list[RowProblem]) -> dict[str, Any]:
    """The numbers of an adjustment, with the keys of other calibrations where they mean the same."""
    seen, at = found.observations, found.setting
    sigmas = np.sqrt(np.diagonal(found.covariance))
    left_out = [{"file": file, "row": problem.row, "why": problem.what} for problem in problems]
    left_out += [{"file": file, "row": line, "why": "gross error"} for line in found.outliers]
    return {
        "converged": True,
        "iterations": found.iterations,
        "rank": found.rank,
        "names": list(found.names),
        "values": found.values.tolist(),
        "sigmas": sigmas.tolist(),
        "shares": found.shares.tolist(),
        "correlation": (found.covariance / np.outer(sigmas, sigmas)).tolist(),
        "noise": {
            "joint_deg": float(np.rad2deg(found.noise[0])),
            **{name: 1e3 * float(s) for name, s in zip(seen.instruments, found.noise[1:], strict=True)},
        },
        "targets_mm": {
            name: (1e3 * place).tolist() for name, place in zip(seen.targets, at.places, strict=True)
        },
        "frames": {
            name: {
                "mm": (1e3 * X[:3, 3]).tolist(),
                "zyx_deg": np.rad2deg(zyx_from_rotation(X[:3, :3])).tolist(),
            }
            for number, (name, X) in enumerate(zip(seen.instruments, at.frames, strict=True))
            if not seen.is_bar(number)
        },
        "anchors_mm": {
            name: (1e3 * at.anchors[number]).tolist()
            for number, name in enumerate(seen.instruments)
            if seen.is_bar(number)
        },
        "residuals": [
            {
                "row": int(line),
                "mm": [None if np.isnan(v) else 1e3 * v for v in e.tolist()],
                "used": bool(used),
            }
            for line, e, used in zip(seen.lines, found.residuals, found.used, strict=True)
        ],
        "left_out": left_out,
        "outliers": list(found.outliers),
    }


def _write_page(page: Path, found: InstrumentCalibration) -> None:
    seen = found.observations
    rows = []
    for k, line in enumerate(seen.lines.tolist()):
        before, after = (1e3 * float(np.sqrt(np.nansum(e[k] ** 2))) for e in (found.before, found.residuals))
        axes = ["" if np.isnan(value) else f"{1e3 * value:z.4f}" for value in found.residuals[k]]
        names = [seen.targets[seen.target[k]], seen.instruments[seen.instrument[k]]]
        used = "" if found.used[k] else "left out"
        rows.append([str(line), *names, f"{before:.3f}", f"{after:.4f}", *axes, used])
    head = ["line", "target", "instrument", "before mm", "after mm", "Δ1 mm", "Δ2 mm", "Δ3 mm", ""]
    note = "Along the axes of the instrument; a distance has one number. A click on a head sorts."
    sections = [Section("Every line", note, sortable_table("lines", head, rows))]
    parameters = []
    sigmas = np.sqrt(np.diagonal(found.covariance))
    for name, value, sigma, share in zip(found.names, found.values, sigmas, found.shares, strict=True):
        label, factor = unit(name)
        shown = rounded(factor * value, _CONFIDENCE * factor * sigma)
        parameters.append([name, *shown, label, f"{100.0 * share:.1f} %"])
    note = (
        "All parameters with 95 % confidence: of the robot, of targets on the tool, of frames on top of "
        "where the nominal robot puts them, of anchors. What the data do not show has its prior."
    )
    head = ["name", "value", "±", "unit", "from the data"]
    sections.append(Section("Parameters", note, sortable_table("parameters", head, parameters)))
    write_plot_page(page, f"Calibration, {found.robot.name}", sentence(found), sections)
