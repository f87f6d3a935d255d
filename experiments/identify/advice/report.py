"""What to record further: in words, as tables, as JSON."""

from typing import Any

import numpy as np

from experiments.cli.console import count
from experiments.identify.advice.advise import Advice, Option, Prospect, WeakParameter
from experiments.report.plot_page import Section, html_table

ADVICE_HEAD = ["parameter", "sigma", "motion", "sensor", "few", "proposed", "known by"]


def advised(advice: Advice) -> str:
    """What is proposed, in some sentences."""
    if not advice.weak:
        return "All springs and dampers are identifiable: no further motion is needed."
    tried = f"{count(advice.motions, 'motion')} and {count(advice.sensors, 'sensor')} that were looked at"
    better = [row.name for row in advice.weak if advice.proposed and row.proposed < row.limit]
    hidden = [row.name for row in advice.weak if row.verdict == "nothing" and row.name not in better]
    said = []
    if advice.proposed:
        shown = f" would make {', '.join(better)} identifiable" if better else " would help most"
        said.append(f"Of {tried} {'; '.join(map(told, advice.proposed))}{shown}.")
    if hidden:
        said.append(
            f"{'' if said else f'Of {tried} '}none shows {', '.join(hidden)} well enough.".capitalize()
        )
    return " ".join(said)


def told(option: Option) -> str:
    """An option in a line."""
    if option.sensor is not None:
        place = ", ".join(f"{value:.3g}" for value in option.sensor.position)
        return f"{option.sensor.kind} on {option.sensor.body} at ({place}) m"
    motion = option.motion
    assert motion is not None
    position = ", ".join(f"{value:.0f}" for value in np.rad2deg(motion.start))
    return f"{np.rad2deg(motion.angle):+.0f} degrees from ({position}) with {motion.payload:g} kg"


def advice_rows(advice: Advice) -> list[list[str]]:
    """Weak parameters with the standard deviations that the best options would leave."""
    return [
        [
            row.name,
            f"{row.sigma:.2%}",
            *(f"{each.sigma:.2%}" if each else "-" for each in (row.motion, row.sensor, row.reach)),
            f"{row.proposed:.2%}" if advice.proposed else "-",
            row.verdict,
        ]
        for row in advice.weak
    ]


def advice_sections(advice: Advice) -> list[Section]:
    """Of the page."""
    note = (
        f"{advised(advice)} Standard deviations that the identification would give, with the best motion, "
        "the best sensor, the best few for this parameter alone, and with all that is proposed."
    )
    if not advice.weak:
        return [Section("Further motions and sensors", note, "")]
    head = [*ADVICE_HEAD, "best motion", "best sensor", "the best few"]
    rows = [
        [*cells, *(_options(each) for each in (row.motion, row.sensor, row.reach))]
        for cells, row in zip(advice_rows(advice), advice.weak, strict=True)
    ]
    return [Section("Further motions and sensors", note, html_table(head, rows))]


def _options(prospect: Prospect | None) -> str:
    return "; ".join(map(told, prospect.options)) if prospect and prospect.options else "-"


def advice_json(advice: Advice) -> dict[str, Any]:
    """The numbers; `further` is what a file of ``--motions`` takes, `sigma` is relative."""
    return {
        "further": [_option_json(each) for each in advice.proposed if each.motion is not None],
        "sensors": [_option_json(each) for each in advice.proposed if each.sensor is not None],
        "candidates": {"motions": advice.motions, "sensors": advice.sensors},
        "parameters": {row.name: _parameter_json(row) for row in advice.weak},
    }


def _parameter_json(row: WeakParameter) -> dict[str, Any]:
    return {
        "sigma": row.sigma,
        "known_below": row.limit,
        "motion": _prospect_json(row.motion),
        "sensor": _prospect_json(row.sensor),
        "best_few": _prospect_json(row.reach),
        "proposed_sigma": row.proposed,
        "made_known_by": row.verdict,
    }


def _prospect_json(prospect: Prospect | None) -> dict[str, Any] | None:
    if prospect is None:
        return None
    return {"options": [_option_json(each) for each in prospect.options], "sigma": prospect.sigma}


def _option_json(option: Option) -> dict[str, Any]:
    sensor, motion = option.sensor, option.motion
    if sensor is not None:
        place = {"position": sensor.position.tolist(), "bandwidth": sensor.bandwidth}
        return {"name": sensor.name, "kind": sensor.kind, "body": sensor.body} | place
    assert motion is not None
    return {
        "position_deg": np.rad2deg(motion.start).round(3).tolist(),
        "angle_deg": float(np.rad2deg(motion.angle).round(3)),
        "payload": motion.payload,
    }
