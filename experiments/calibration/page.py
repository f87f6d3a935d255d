"""The page of a calibration, which a customer gets."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.calibration.calibrate import CalibrationStudy
from experiments.calibration.figures import (
    correlation_figure,
    frames_figure,
    joints_figure,
    noise_figure,
    path_figure,
    spread_figure,
    vectors_figure,
)
from experiments.calibration.report import (
    AXES,
    Problems,
    calibration_verdict,
    path_rows,
    rows_left_out,
    validation_rows,
)
from experiments.calibration.words import icon, in_words, rounded, unit
from experiments.report.plot_page import Section, html_table, sortable_table, write_plot_page
from experiments.report.robot_plot import tips_figure
from robots.calibration.prior import CENTRE_OF_MASS, MASS
from robots.calibration.residuals import expected_spread, standardised
from robots.calibration.validation import prediction_errors

_CONFIDENCE = 1.96  # standard deviations to either side hold 95 %
NOISE_NOTE = (
    "Residuals of all axes in units of the noise, correlations taken out. Where noise and model are right "
    "they follow the curve, narrower than one because the parameters follow the noise a little."
)
CORRELATION_NOTE = (
    "Pairs near one or minus one change the tool in nearly the same way: only their sum, or their "
    "difference, is well known. Condition number {condition:.3g}."
)


def write_calibration_page(
    page: Path, title: str, study: CalibrationStudy, path: Mapping[str, Any] | None, problems: Problems
) -> None:
    """The page of a calibration; opens offline."""
    sections = [*_accuracy(study, path), *_residuals(study), *_parameters(study)]
    q, rows = study.sets.calibration.q, study.sets.calibration.rows
    names = [f"row {row}" for row in rows]
    note = "Where the tool was in the measured rows; what is far from all of them was extrapolated."
    sections.append(Section("Measured configurations", note, tips_figure(study.nominal, q, names), 560))
    left_out = [[each["file"], str(each["row"]), each["why"]] for each in rows_left_out(study, problems)]
    if left_out:
        sections.append(Section("Rows left out", "", html_table(["file", "row", "why"], left_out)))
    write_plot_page(page, f"Calibration, {title}", calibration_verdict(study, path), sections)


def _accuracy(study: CalibrationStudy, path: Mapping[str, Any] | None) -> list[Section]:
    """How accurate the robot was and is."""
    head = ["", "", *AXES]
    sections = []
    if study.sets.validation is not None:
        note = (
            "Distances between measured and predicted positions on the validation set: the calibrated robot "
            "should be far left of the nominal one."
        )
        sections.append(Section("How the errors are spread", note, spread_figure(study), 320))
    if study.before is not None:
        note = "Mean, largest and 90 % absolute errors on configurations that were not used before."
        sections.append(Section("Validation", note, html_table(head, validation_rows(study))))
    if path:
        note = "No camera: the path is planned with the nominal and with the calibrated robot. True errors."
        sections.append(Section("Distance from the path", note, path_figure(path), 360))
        sections.append(Section("Path", "The same errors.", html_table(head, path_rows(path))))
    return sections


def _residuals(study: CalibrationStudy) -> list[Section]:
    """What the identification leaves of its own rows."""
    found = study.identified
    before = prediction_errors(found.robot, found.measurements)
    note = (
        "Measured less predicted pose of every row, before with the nominal robot, after with the calibrated "
        "one. A click on a head sorts."
    )
    table, kept = sortable_table("poses", *_pose_table(study, before)), found.kept
    points, after = found.measurements.position[kept], found.residuals[kept, -3:]
    white = standardised(found)[kept].ravel()
    return [
        Section("Error of every pose", note, table),
        Section(
            "Errors in space",
            "From each measured position along its error, drawn longer than it is, before and after.",
            vectors_figure(found.robot, points, before[kept, -3:], after),
            560,
        ),
        Section(
            "What is left against the joints",
            "Positions along the axes of the world. A wave over a joint is something that the model lacks.",
            joints_figure(found.measurements.q[kept], after),
            520,
        ),
        Section("Is it noise?", NOISE_NOTE, noise_figure(white, expected_spread(found)), 320),
    ]


def _pose_table(study: CalibrationStudy, before: np.ndarray) -> tuple[list[str], list[list[str]]]:
    found = study.identified
    has_rotation = found.residuals.shape[1] == 6
    head = ["row", "kg", "before mm", "after mm", "Δx mm", "Δy mm", "Δz mm"]
    head += ["before °", "after °"] if has_rotation else []
    rows = []
    table = found.measurements
    for k, (number, payload) in enumerate(zip(table.rows, table.payload, strict=True)):
        old, new = before[k], found.residuals[k]
        cells = [f"{1e3 * np.linalg.norm(old[-3:]):.3f}", f"{1e3 * np.linalg.norm(new[-3:]):.4f}"]
        cells += [f"{1e3 * value:z.4f}" for value in new[-3:]]
        if has_rotation:
            cells += [f"{np.rad2deg(np.linalg.norm(each[:3])):.4f}" for each in (old, new)]
        used = "" if found.kept[k] else "left out"
        rows.append([str(number), f"{payload:g}", *cells, used])
    return [*head, ""], rows


def _parameters(study: CalibrationStudy) -> list[Section]:
    note = (
        "With 95 % confidence, rounded to it. Placements are displaced along and turned about the axes of "
        "their frame; a dependent parameter is zero, its effect is in the ones shown. The picture has x to "
        "the front, y to the right, z up."
        f" Intervals of compliances contain masses known to {100.0 * MASS:.0f} % and centres known to "
        f"{1e3 * CENTRE_OF_MASS:.0f} mm."
    )
    frames = "The frames of the nominal robot at zero joint angles, along whose axes the parameters count."
    found = study.identified
    correlation = CORRELATION_NOTE.format(condition=found.condition)
    return [
        Section("Parameters", note, sortable_table("parameters", *_parameter_table(study))),
        Section("Frames", frames, frames_figure(found.robot), 480),
        Section("Correlation", correlation, correlation_figure(found.names, found.correlation), 620),
    ]


def _parameter_table(study: CalibrationStudy) -> tuple[list[str], list[list[str]]]:
    """Each parameter in mm, degrees or rad per N m, with its confidence, and with the truth where known."""
    identified, truth = study.identified, study.truth
    rows = []
    for number, name in enumerate(identified.names):
        label, factor = unit(name)
        value, sigma = factor * identified.values[number], factor * identified.sigmas[number]
        share = f"{100.0 * identified.shares[number]:.1f} %"
        shown = rounded(value, _CONFIDENCE * sigma)
        row = [in_words(name), name, icon(name, identified.robot), *shown, label, share]
        if truth is not None:
            row.append(rounded(factor * truth[number], _CONFIDENCE * sigma)[0])
        rows.append(row)
    head = ["what", "name", "", "value", "±", "unit", "from the data"]
    return [*head, *(["truth"] if truth is not None else [])], rows
