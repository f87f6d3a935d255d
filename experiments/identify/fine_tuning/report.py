"""What a fine tuning on the robot has changed: in words, as tables, as figures, as JSON."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from experiments.cli.console import count
from experiments.identify.fine_tuning.motions import Size, TipMotion
from experiments.identify.fine_tuning.tuning import FineTuning
from experiments.report.plot_page import Section, html_table

NUMBERS_HEAD = ["number", "change", "sigma was", "sigma", "tip per sigma", "true"]
MOTIONS_HEAD = ["motion", "measured before", "measured", "true before", "true"]
_BEFORE, _AFTER = "#e0a43a", "#2f7fd0"
_SMOOTH = 5  # samples, over which a measured deviation is averaged in its figure


def outcome(tuning: FineTuning) -> str:
    """What came out, in a few sentences."""
    robot = f"{count(tuning.robot_runs, 'run')} of the robot, {tuning.robot_seconds:.0f} s of motion"
    if not tuning.changed:
        return f"Fine tuning: the motion shows none of the {len(tuning.numbers)} numbers ({robot})."
    said = ", ".join(
        f"{name} {_change(each.before.deviation.measured, each.after.deviation.measured)}"
        for name, each in (("tuned on", tuning.tuned), ("not tuned on", tuning.validated))
    )
    numbers = count(len(tuning.changed), "number")
    if tuning.is_taken_over:
        verdict = "It is taken over."
    else:
        verdict = "It is not taken over, since one of them is worse: the inverse model stays as identified."
    return (
        f"Fine tuning of {numbers} on the robot ({robot}) changes the measured deviation of the tip on the "
        f"rectangle that was {said}. {verdict}"
    )


def _change(before: float, after: float) -> str:
    return f"from {1e3 * before:.3f} to {1e3 * after:.3f} mm"


def number_rows(tuning: FineTuning) -> list[list[str]]:
    """The numbers that were tuned, then by name those that were not."""
    rows = []
    for each in sorted(tuning.numbers, key=lambda number: not number.is_tuned):
        rows.append(
            [
                each.name,
                f"{each.factor - 1.0:+.2%}" if each.is_tuned else "stays",
                f"{each.before:.2%}",
                f"{each.sigma:.2%}",
                f"{1e6 * each.effect:.1f} um",
                "-" if each.true is None else f"{each.true - 1.0:+.2%}",
            ]
        )
    return rows


def motion_rows(tuning: FineTuning) -> list[list[str]]:
    """Deviation and ringing of both motions in mm."""
    rows = []
    for name, each in (("tuned on", tuning.tuned), ("not tuned on", tuning.validated)):
        for label, of in (("deviation", _deviation), ("ringing", _ringing)):
            before, after = of(each.before), of(each.after)
            values = before.measured, after.measured, before.true, after.true
            rows.append([f"{name}, {label}", *(f"{1e3 * value:.4f}" for value in values)])
    return rows


def _deviation(motion: TipMotion) -> Size:
    return motion.deviation


def _ringing(motion: TipMotion) -> Size:
    return motion.ringing


def fine_tuning_json(tuning: FineTuning) -> dict[str, Any]:
    """The numbers in SI units."""
    return {
        "share": tuning.share,
        "taken_over": tuning.is_taken_over,
        "robot_runs": tuning.robot_runs,
        "robot_seconds": tuning.robot_seconds,
        "numbers": {
            each.name: {
                "factor": each.factor,
                "sigma_before": each.before,
                "sigma": each.sigma,
                "effect_m": each.effect,
                "tuned": each.is_tuned,
            }
            | ({} if each.true is None else {"true_factor": each.true})
            for each in tuning.numbers
        },
        "motions": {
            name: {
                "before": _motion_json(each.before),
                "after": _motion_json(each.after),
            }
            for name, each in (("tuned", tuning.tuned), ("validated", tuning.validated))
        },
    }


def _motion_json(motion: TipMotion) -> dict[str, float]:
    deviation, ringing = motion.deviation, motion.ringing
    return {
        "measured_m": deviation.measured,
        "true_m": deviation.true,
        "ringing_measured_m": ringing.measured,
        "ringing_true_m": ringing.true,
    }


def fine_tuning_sections(tuning: FineTuning) -> list[Section]:
    """Of the page."""
    note = (
        "Root mean square in mm of the distance between tip and path, and of the tip about its place after "
        "the end. What the camera measures decides; its noise, another one in each sample, is not in it."
    )
    return [
        Section("Fine tuning on the robot", note, html_table(MOTIONS_HEAD, motion_rows(tuning))),
        Section(
            "What was tuned",
            f"Within {tuning.share:g} of what was identified and its inverse. A number stays where the "
            "motion hardly shows it. The inverse model is approximate: what is best for it need not be what "
            "the plant has, whose change is in the last column where it has such a number.",
            html_table(NUMBERS_HEAD, number_rows(tuning)),
        ),
        Section(
            "Deviation of the tip, measured",
            f"Camera, mean of {_SMOOTH} samples, on the rectangle that was tuned on.",
            distance_figure([tuning.tuned.before, tuning.tuned.after]),
            420,
        ),
    ]


def distance_figure(motions: Sequence[TipMotion]) -> go.Figure:
    """Measured distance over time before and after."""
    figure = go.Figure()
    kernel = np.ones(_SMOOTH) / _SMOOTH
    for name, motion, colour in zip(("before", "after"), motions, (_BEFORE, _AFTER), strict=True):
        seen = motion.seen
        smooth = np.column_stack(
            [np.convolve(axis, kernel, mode="valid") for axis in motion.measured[seen].T]
        )
        time = np.convolve(motion.time[seen], kernel, mode="valid")
        distance = 1e3 * np.linalg.norm(smooth, axis=1)
        figure.add_trace(go.Scatter(x=time, y=distance, name=name, line={"color": colour, "width": 1.4}))
    figure.update_xaxes(title="time in s")
    return figure.update_yaxes(title="distance in mm", rangemode="tozero")
