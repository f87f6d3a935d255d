"""Results of a calibration as JSON and as terminal tables."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.calibration.calibrate import CalibrationStudy
from experiments.cli.console import print_table
from robots.calibration.identifiability import completeness
from robots.calibration.identified import Identified
from robots.calibration.measurement_file import RowProblem
from robots.calibration.measurements import MeasurementNoise
from robots.calibration.repeatability import repeatability
from robots.calibration.solver.left_over import GravityTest
from robots.calibration.validation import ErrorStatistics, prediction_errors, statistics
from robots.description.model import RobotModel
from robots.pose import zyx_from_rotation

Problems = Sequence[tuple[str, RowProblem]]
AXES = ("Δx mm", "Δy mm", "Δz mm", "ρx °", "ρy °", "ρz °")
_WEAK = 0.5  # share of the data in what is known of a parameter, below which it is said
_MISFIT = 1.3  # of residuals, in units of the known noise, from which it is said
_NO_NOISE = 1e-6  # mm or degrees
_ENCODERS_DEG = 0.03  # noise of joints, estimated, that is ten times that of encoders


def calibration_json(
    study: CalibrationStudy, path: Mapping[str, Any] | None, problems: Problems = ()
) -> dict[str, Any]:
    """The numbers of a calibration; what was not done is None."""
    design = study.design
    errors, found = None, study.identified
    if study.truth is not None:
        errors = {"max_abs_error": float(np.abs(found.values - study.truth)[: found.rank].max())}
    frame = None
    if found.frame is not None:
        zyx_deg = np.rad2deg(zyx_from_rotation(found.frame[:3, :3]))
        frame = {"translation": found.frame[:3, 3].tolist(), "zyx_deg": zyx_deg.tolist()}
    repeated = repeatability(found)
    source_set = completeness(study.nominal, found.residuals.shape[1] == 3)
    return {
        "identifiable": found.rank,
        "design": design and {"b3": design.b3, "bound": design.bound, "seconds": study.design_seconds},
        "parameters": errors,
        "compliance_rad_per_Nm": study.identified.compliance.tolist(),
        "iterations": study.identified.iterations,
        "outliers": list(study.identified.outliers),
        "validation_outliers": list(study.validation_outliers),
        "converged": True,  # what has not converged is refused
        "left_out": rows_left_out(study, problems),
        "rank": found.rank,
        "names": list(found.names),
        "values": found.values.tolist(),
        "sigmas": found.sigmas.tolist(),
        "shares": found.shares.tolist(),
        "truth": None if study.truth is None else study.truth.tolist(),
        "correlation": found.correlation.tolist(),
        "condition": found.condition,
        "residuals": residual_rows(found),
        "noise": noise_dict(found),
        "gravity": gravity_dict(found.gravity),
        "frame": frame,
        "repeatability": repeated and asdict(repeated),
        "completeness_of_48": asdict(source_set),
        "validation": {
            name: errors_of and errors_of.as_dict()
            for name, errors_of in (
                ("before", study.before),
                ("after", study.after),
                ("after_geometry_only", study.geometry_only),
                ("after_noise_free", study.after_noise_free),
            )
        },
        "path": path and {name: path[name]["errors"] for name in ("before", "after")},
    }


def problem_lines(problems: Problems) -> list[str]:
    """What is wrong with rows that cannot be used; those of a file with the same fault share a line."""
    rows: dict[tuple[str, str], list[int]] = {}
    for name, problem in problems:
        rows.setdefault((name, problem.what), []).append(problem.row)
    return [
        f"{name}, line{'s' if len(numbers) > 1 else ''} {_in_a_row(numbers)}: {what}; left out"
        for (name, what), numbers in rows.items()
    ]


def _in_a_row(numbers: list[int]) -> str:
    """Rising numbers as a list: 3, 7 to 9."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def rows_left_out(study: CalibrationStudy, problems: Problems) -> list[dict[str, Any]]:
    """Rows that were not used: where they stand and why."""
    left_out = [{"file": name, "row": problem.row, "why": problem.what} for name, problem in problems]
    for file, rows in (
        ("identification", study.identified.outliers),
        ("validation", study.validation_outliers),
    ):
        left_out += [{"file": file, "row": int(row), "why": "gross error"} for row in rows]
    return left_out


def residual_rows(found: Identified) -> list[dict[str, Any]]:
    """Measured less predicted, row by row, in mm and degrees along and about the axes of the world."""
    rows = []
    for number, e, is_kept in zip(found.measurements.rows, found.residuals, found.kept, strict=True):
        row = {"row": int(number), "mm": (1e3 * e[-3:]).tolist(), "used": bool(is_kept)}
        if len(e) == 6:
            row["deg"] = np.rad2deg(e[:3]).tolist()
        rows.append(row)
    return rows


def noise_dict(found: Identified) -> dict[str, Any]:
    """Standard deviations of one row; that of orientations is None where none were measured."""
    noise, has_rotation = found.noise, found.residuals.shape[1] == 6
    return {
        "estimated": not found.is_noise_known,
        "believed": found.noise_belief is not None,  # the rows hardly tell it
        "joint_deg": float(np.rad2deg(noise.joint_sigma)),
        "position_mm": 1e3 * noise.position_sigma,
        "rotation_deg": float(np.rad2deg(noise.rotation_sigma)) if has_rotation else None,
    }


def print_calibration(
    console: Console, study: CalibrationStudy, path: Mapping[str, Any] | None, problems: Problems
) -> None:
    """Tables 6.3 and 6.4 of Probst (2024) for this calibration."""
    for line in problem_lines(problems):
        console.print(f"[yellow]{escape(line)}[/yellow]")
    if study.identified.outliers:
        rows = ", ".join(map(str, study.identified.outliers))
        console.print(f"[yellow]Outliers, left out of the identification: rows {rows}[/yellow]")
    if study.validation_outliers:
        rows = ", ".join(map(str, study.validation_outliers))
        console.print(f"[yellow]Outliers, left out of the validation: rows {rows}[/yellow]")
    if rows := validation_rows(study):
        _print(console, "Validation: errors on fresh configurations", rows)
    if path:
        _print(console, "Path without a camera: true errors", path_rows(path))
    console.print(escape(calibration_verdict(study, path)))
    source_set = completeness(study.nominal, study.identified.residuals.shape[1] == 3)
    if source_set.missed:
        console.print(escape(source_set.sentence))
    console.print()


def calibration_verdict(study: CalibrationStudy, path: Mapping[str, Any] | None) -> str:
    """What was reached, in words."""
    identified = study.identified
    text = f"{len(identified.names)} parameters"
    shown = [name for name in identified.reducible.shown_by_errors if name in identified.names]
    if shown:
        drawn = len(identified.names) - len(shown)
        text += f" ({drawn} of the robot as drawn; {', '.join(shown)} show as its tool is off its axis)"
    text += f" from {len(identified.residuals)} measurements"
    text += f" in {identified.iterations} iterations."
    text += noise_sentence(identified) + unexplained_sentence(identified)
    text += load_sentence(identified.robot, identified.measurements.payload)
    if identified.frame is not None:
        far = float(np.linalg.norm(identified.frame[:3, 3]))
        text += f" The instrument measures in a frame of its own, {far:.2f} m from the world of the robot."
    weak = [
        f"{name} ({100.0 * share:.0f} %)"
        for name, share in zip(identified.names, identified.shares, strict=True)
        if share < _WEAK
    ]
    if weak:
        text += f" Mostly the prior, not the data, gives {', '.join(weak)}; in brackets what the data add."
    repeated = repeatability(identified)
    if repeated:
        text += f" {repeated.rows} rows repeat {repeated.configurations} configurations, "
        text += f"to {repeated.position_mm:.3g} mm."
    if study.before and study.after:
        before, after = study.before.mean_norm_mm, study.after.mean_norm_mm
        way = "falls" if after <= before else "rises"
        text += f" On fresh configurations the mean error {way} from {before:.3f} to {after:.3f} mm"
        if study.after_noise_free:
            text += f" ({study.after_noise_free.mean_norm_mm:.4f} mm without noise)"
        text += "."
    elif study.sets.validation is None:
        errors = prediction_errors(identified.robot, identified.measurements), identified.residuals
        old, new = (statistics(each[identified.kept]).mean_norm_mm for each in errors)
        text += (
            f" On its own rows the mean error falls from {old:.3f} to {new:.3f} mm; how it is elsewhere, "
            "fresh rows would say (--validation)."
        )
    if path:
        before, after = (path[name]["errors"] for name in ("before", "after"))
        rest = [float(np.linalg.norm(each["static_mm"])) for each in (before, after)]
        text += (
            f" On the path the largest true error falls from {before['max_norm_mm']:.2f} to "
            f"{after['max_norm_mm']:.2f} mm, at rest from {rest[0]:.3f} to {rest[1]:.3f} mm."
        )
    return text


def noise_sentence(found: Identified) -> str:
    """How noisy the rows are, and how one knows."""
    noise = noise_dict(found)
    if noise["estimated"] and noise["position_mm"] < _NO_NOISE:
        return " The rows are free of noise."
    if found.noise_belief is not None:
        return (
            f" {int(found.kept.sum())} measurements are too few to tell their noise: usually it is "
            f"{_sizes(found, found.noise_belief)}, with what they leave {_sizes(found, found.noise)} are "
            "taken. The intervals are as good as that; who knows the noise better may say it (--noise)."
        )
    how = "Estimated" if noise["estimated"] else "Known"
    text = f" {how} noise: {_sizes(found, found.noise)}."
    if not noise["estimated"] and found.misfit > _MISFIT:
        text += (
            f" Residuals are {found.misfit:.1f} times as large as this noise makes them: it is larger than "
            "believed, or the model lacks something, and the intervals are too small."
        )
    return text


def _sizes(found: Identified, noise: MeasurementNoise) -> str:
    """Of joints, if any, positions and, where they were measured, orientations."""
    sizes = [f"{_size(np.rad2deg(noise.joint_sigma))} degrees of the joints"] if noise.joint_sigma else []
    sizes += [f"{_size(1e3 * noise.position_sigma)} mm"]
    if found.residuals.shape[1] == 6:
        sizes += [f"{_size(np.rad2deg(noise.rotation_sigma))} degrees"]
    return ", ".join(sizes)


def _size(noise: float) -> str:
    """In mm or degrees; what an estimate leaves of a noise that the rows do not have is none."""
    return f"{noise:.2g}" if noise >= _NO_NOISE else "0"


def gravity_dict(gravity: GravityTest | None) -> dict[str, float] | None:
    """The test for gravity in what a fit leaves, in mm; None without one."""
    return gravity and {"explained_mm": 1e3 * gravity.explained, "chance": gravity.chance}


def gravity_sentence(gravity: GravityTest | None) -> str:
    """That what is left follows the weight; empty if it does not."""
    if gravity is None or not gravity.is_clear:
        return ""
    return (
        f" Of what these parameters leave, {1e3 * gravity.explained:.2g} mm (rms) follow the weight of "
        "arm and load, as where joints yield; identify that, too (--compliance)."
    )


def load_sentence(robot: RobotModel, loads: np.ndarray) -> str:
    """That loads in kg, (n,), are more than a robot may carry, which no rigid one feels; else empty."""
    heaviest, largest = float(loads.max(initial=0.0)), robot.payload.largest_mass
    if heaviest <= largest:
        return ""
    return (
        f" The loads of the table (payload_kg, up to {heaviest:g} kg) have no effect on geometry alone; "
        f"{robot.name} may carry {largest:g} kg: whether joints yield was not looked at."
    )


def unexplained_sentence(found: Identified) -> str:
    """That the rows agree on something that the parameters cannot describe; empty if they do not.

    Springs move a tip as noise of the joints does, and on a long arm little noise of joints hides much sag;
    but sag follows the weight. What else there is shows where it is more than encoders have.
    """
    if said := gravity_sentence(found.gravity):
        return said
    joint_deg = 0.0 if found.is_noise_known else float(np.rad2deg(found.noise.joint_sigma))
    if not found.lacks_something and joint_deg < _ENCODERS_DEG:
        return ""
    has_springs = len(found.parameters) > len(found.model)
    if has_springs:
        cause = "do bearings yield, or joints err (--joint-errors)"
    else:
        cause = (
            "do joints yield (--compliance)" if found.gravity is None else "do joints err (--joint-errors)"
        )
    if not found.lacks_something:
        return (
            f" Noise of {joint_deg:.2g} degrees of the joints is far more than encoders have: most of it "
            f"may be what these parameters do not explain; {cause}?"
        )
    position = float(np.sqrt(np.mean(np.sum(found.residuals[found.kept, -3:] ** 2, axis=1))))
    return (
        f" These parameters do not explain the measurements: {1e3 * position:.2g} mm (rms) are left that are "
        f"not noise alone; {cause}?"
    )


def _print(console: Console, title: str, rows: Sequence[Sequence[str]]) -> None:
    table = Table(
        box=box.SIMPLE_HEAD, title=title, title_justify="left", title_style="italic", pad_edge=False
    )
    for head in ("", "", *AXES):
        table.add_column(head, justify="right" if head else "left", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    print_table(console, table)


def validation_rows(study: CalibrationStudy) -> list[list[str]]:
    """Statistics of each stage on fresh configurations."""
    rows = []
    stages = {
        "uncalibrated": study.before,
        "geometry only": study.geometry_only,
        "calibrated": study.after,
        "without noise": study.after_noise_free,
    }
    for stage, found in stages.items():
        if found is not None:
            for kind in ("mean", "max", "p90"):
                rows.append([stage if kind == "mean" else "", kind, *_numbers(found, kind)])
    return rows


def _numbers(found: ErrorStatistics, kind: str) -> list[str]:
    millimetres, degrees = getattr(found, f"{kind}_mm"), getattr(found, f"{kind}_deg")
    return [*_digits(millimetres, degrees), *[""] * (3 - len(degrees))]


def _digits(millimetres: Sequence[float], degrees: Sequence[float]) -> list[str]:
    return [f"{value:.4f}" for value in millimetres] + [f"{value:.3f}" for value in degrees]


def path_rows(path: Mapping[str, Any]) -> list[list[str]]:
    """Errors on the path before and after."""
    rows = []
    for stage, name in (("uncalibrated", "before"), ("calibrated", "after")):
        errors = path[name]["errors"]
        for kind in ("max", "static"):
            numbers = _digits(errors[f"{kind}_mm"], errors[f"{kind}_deg"])
            rows.append([stage if kind == "max" else "", kind, *numbers])
    return rows
