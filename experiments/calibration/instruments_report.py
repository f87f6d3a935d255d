"""An adjustment of several targets and instruments: in words, as numbers, as a page."""

from pathlib import Path
from typing import Any

import numpy as np

from experiments.calibration.figures import correlation_figure, joints_figure, noise_figure, vectors_figure
from experiments.calibration.page import CORRELATION_NOTE, NOISE_NOTE
from experiments.calibration.report import gravity_dict, gravity_sentence, load_sentence
from experiments.calibration.words import icon, in_words, rounded, unit
from experiments.report.plot_page import Section, sortable_table, write_plot_page
from robots.calibration.instruments.identify import InstrumentCalibration
from robots.calibration.instruments.observations import Observations
from robots.calibration.instruments.validation import FreshLines
from robots.calibration.measurement_file import RowProblem
from robots.pose import zyx_from_rotation

_CONFIDENCE = 1.96  # standard deviations to either side hold 95 %


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
    if found.is_noise_believed:
        text += "The lines are too few to tell their noise: it leans on the usual 0.1 mm, and the intervals "
        text += "are as good as that; who knows it better may say it (sigma_mm, --noise). "
    text += f"Noise of the joints {np.rad2deg(found.noise[0]):.2g} degrees."
    return text + gravity_sentence(found.gravity) + load_sentence(found.robot, seen.loads)


def validation_sentence(checked: FreshLines) -> str:
    """How well fresh lines are predicted, in words."""
    parts = []
    for number, name in enumerate(checked.observations.instruments):
        before, after = (1e3 * each for each in checked.distances(number))
        if len(after):
            parts.append(
                f"{name} {before.mean():.3f} to {after.mean():.4g} mm (mean; {after.max():.3g} at most)"
            )
    return f"Validation, {int(checked.used.sum())} fresh lines: {', '.join(parts)}."


def instruments_json(
    found: InstrumentCalibration,
    file: str,
    unused: list[tuple[str, RowProblem]],
    checked: FreshLines | None = None,
) -> dict[str, Any]:
    """The numbers of an adjustment, with the keys of other calibrations where they mean the same.

    Args:
        found: the adjustment.
        file: of the lines that were used.
        unused: files, and their lines that cannot be used.
        checked: predictions of fresh lines; None without a table of them.
    """
    seen, at = found.observations, found.setting
    sigmas = np.sqrt(np.diagonal(found.covariance))
    left_out = [{"file": name, "row": problem.row, "why": problem.what} for name, problem in unused]
    left_out += [{"file": file, "row": line, "why": "gross error"} for line in found.outliers]
    return {
        "converged": True,
        "iterations": found.iterations,
        "rank": found.rank,
        "names": list(found.names),
        "values": found.values.tolist(),
        "sigmas": sigmas.tolist(),
        "shares": found.shares.tolist(),
        "correlation": found.correlation.tolist(),
        "condition": found.condition,
        "noise_believed": found.is_noise_believed,  # the lines hardly tell it
        "noise": {
            "joint_deg": float(np.rad2deg(found.noise[0])),
            **{name: 1e3 * float(s) for name, s in zip(seen.instruments, found.noise[1:], strict=True)},
        },
        "gravity": gravity_dict(found.gravity),
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
        "validation": _validation_json(checked) if checked else None,
        "validation_outliers": list(checked.outliers) if checked else [],
    }


def _validation_json(checked: FreshLines) -> dict[str, Any]:
    """Distances by instrument, before and after."""
    numbers: dict[str, Any] = {"before": {}, "after": {}}
    for number, name in enumerate(checked.observations.instruments):
        for when, distances in zip(numbers, checked.distances(number), strict=True):
            if len(distances):
                mm = 1e3 * distances
                numbers[when][name] = {
                    "lines": len(mm),
                    "mean_mm": float(mm.mean()),
                    "p90_mm": float(np.percentile(mm, 90.0)),
                    "max_mm": float(mm.max()),
                }
    return numbers


def _lines_table(
    name: str, seen: Observations, errors: tuple[np.ndarray, np.ndarray], used: np.ndarray
) -> str:
    """Every line with its errors (m, 3) in m, before and after."""
    rows = []
    for k, line in enumerate(seen.lines.tolist()):
        before, after = (1e3 * float(np.sqrt(np.nansum(e[k] ** 2))) for e in errors)
        axes = ["" if np.isnan(value) else f"{1e3 * value:z.4f}" for value in errors[1][k]]
        names = [seen.targets[seen.target[k]], seen.instruments[seen.instrument[k]]]
        rows.append(
            [str(line), *names, f"{before:.3f}", f"{after:.4f}", *axes, "" if used[k] else "left out"]
        )
    head = ["line", "target", "instrument", "before mm", "after mm", "Δ1 mm", "Δ2 mm", "Δ3 mm", ""]
    return sortable_table(name, head, rows)


def _pictures(found: InstrumentCalibration) -> list[Section]:
    """Errors in space, against the joints and against the noise; distances are no vectors and left out."""
    seen = found.observations
    whole = found.used & np.isfinite(found.residuals).all(axis=1) & ~np.isfinite(seen.distance)
    sections = []
    if whole.any():
        X = found.setting.frames[seen.instrument[whole]]
        before, after = (_in_world(X, e[whole]) for e in (found.before, found.residuals))
        points = _in_world(X, seen.position[whole] - X[:, :3, 3])
        figure = vectors_figure(found.robot, points, before, after)
        note = "Of the lines with three coordinates, in the world of the robot."
        sections.append(Section("Errors in space", note, figure, 560))
        note = "Along the axes of the world. A wave over a joint is something that the model lacks."
        figure = joints_figure(seen.q[seen.row[whole]], after)
        sections.append(Section("What is left against the joints", note, figure, 520))
    figure = noise_figure(found.standardised, found.spread)
    return [*sections, Section("Is it noise?", NOISE_NOTE, figure, 320)]


def _in_world(X: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) in frames of instruments X (n, 4, 4), which have the world of the robot, turned back."""
    return np.einsum("nji,nj->ni", X[:, :3, :3], vectors)


def write_instruments_page(page: Path, found: InstrumentCalibration, checked: FreshLines | None) -> None:
    """The page for people. Raises OSError if it cannot be written."""
    errors = (found.before, found.residuals)
    note = "Along the axes of the instrument; a distance has one number. A click on a head sorts."
    table = _lines_table("lines", found.observations, errors, found.used)
    sections = [Section("Every line", note, table)]
    if checked:
        table = _lines_table("fresh", checked.observations, (checked.before, checked.after), checked.used)
        sections.insert(0, Section("Validation", validation_sentence(checked), table))
    parameters = []
    sigmas = np.sqrt(np.diagonal(found.covariance))
    for name, value, sigma, share in zip(found.names, found.values, sigmas, found.shares, strict=True):
        label, factor = unit(name)
        shown = rounded(factor * value, _CONFIDENCE * factor * sigma)
        parameters.append(
            [in_words(name), name, icon(name, found.robot), *shown, label, f"{100.0 * share:.1f} %"]
        )
    note = (
        "All parameters with 95 % confidence: of the robot, of targets on the tool, of frames on top of "
        "where the nominal robot puts them, of anchors. What the data do not show has its prior."
    )
    head = ["what", "name", "", "value", "±", "unit", "from the data"]
    sections += _pictures(found)
    sections.append(Section("Parameters", note, sortable_table("parameters", head, parameters)))
    note = CORRELATION_NOTE.format(condition=found.condition)
    sections.append(Section("Correlation", note, correlation_figure(found.names, found.correlation), 760))
    write_plot_page(page, f"Calibration, {found.robot.name}", sentence(found), sections)
