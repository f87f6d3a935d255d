"""The page of the test cycle of ISO 9283: where poses were attained, how far off the square is, the table."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.accept.robot_cycle import Square, Visits
from experiments.report.figure_style import COLORS
from experiments.report.plot_page import Section, html_table, write_plot_page

TITLES = {
    "AP_mm": "pose accuracy AP in mm",
    "RP_mm": "pose repeatability RP in mm",
    "AP_deg": "pose accuracy, orientation, in degrees",
    "vAP_mm": "multi-directional pose accuracy variation vAP in mm",
    "AD_mm": "distance accuracy AD, P2 to P4, in mm",
    "RD_mm": "distance repeatability RD in mm",
    "dAP_mm": "drift of pose accuracy dAP over the cycles in mm",
    "stabilisation_s": "pose stabilisation time in s",
    "overshoot_mm": "pose overshoot in mm",
    "AT_mm": "path accuracy AT in mm",
    "RT_mm": "path repeatability RT in mm",
    "AT_deg": "path accuracy, orientation, in degrees",
    "CR_mm": "corner rounding CR in mm",
    "CO_mm": "corner overshoot CO in mm",
    "AV_percent": "path velocity accuracy AV in percent",
    "RV_percent": "path velocity repeatability RV in percent",
}
_NOTE = (
    "The largest over the poses or along the square P2, P3, P4, P5. The speed of a path rises and falls "
    "between corners; velocity is compared over the middle of the edges. Stabilisation counts from the end "
    "of the command; there is none where the tip has not stayed within the band before the next motion "
    "began. Drift is how far P1 moves from the first to the last quarter of the cycles, in place of the "
    "difference of its accuracies over eight hours, which is never more for the same time. The three sides "
    "of vAP are P5, P2 and P4, not at right angles to each other."
)
_NAMES = ("P1", "P2", "P3", "P4", "P5")
_WIDTH = 0.5  # of a pose's place on the axis that its visits take


@dataclass(frozen=True)
class Row:
    """What was found with one load at one speed."""

    load: float  # kg
    speed_percent: float
    criteria: dict[str, float | None]  # by the names of `TITLES`
    visits: Visits
    square: Square

    @property
    def name(self) -> str:
        """Load and speed in words."""
        return f"{self.load:g} kg, {self.speed_percent:g} %"

    @property
    def results(self) -> dict[str, float | None]:
        """The numbers, as JSON has them."""
        return {"load_kg": self.load, "speed_percent": self.speed_percent, **self.criteria}


def table_rows(rows: list[Row]) -> list[list[str]]:
    """A line of text for each criterion, a cell for each load and speed."""
    cells = {name: [row.criteria[name] for row in rows] for name in TITLES}
    return [
        [title, *("-" if value is None else f"{value:.3f}" for value in cells[name])]
        for name, title in TITLES.items()
    ]


def verdict(rows: list[Row], law: str, cycles: int, cube: float) -> str:
    """What was reached in a sentence, the worst of all loads and speeds."""
    worst = {
        name: _largest([row.criteria[name] for row in rows]) for name in ("AP_mm", "RP_mm", "AT_mm", "RT_mm")
    }
    of = f", the worst of {len(rows)} loads and speeds" if len(rows) > 1 else ""
    return (
        f"{law} attains the poses of a cube of {cube:g} mm with an accuracy AP of {worst['AP_mm']:.3f} mm "
        f"and a repeatability RP of {worst['RP_mm']:.3f} mm, and its square with AT {worst['AT_mm']:.3f} mm "
        f"and RT {worst['RT_mm']:.3f} mm, over {cycles} cycles{of}."
    )


def write_acceptance_page(page: Path, title: str, told: str, scenario: str, rows: list[Row]) -> None:
    """The page; opens offline."""
    head = ("criterion", *(row.name for row in rows))
    poses = (
        "A dot is the tip at rest after one visit, less the wanted position, along the axes of the world. "
        "How far the dots of a pose are from zero is its accuracy, how far they are apart its repeatability, "
        "of visits from the pose before it alone; P1 from P2 and P4, and P4 from P1, show another side."
    )
    square = (
        "Above, the mean of all cycles, its distance to the path as a curve: its maximum is AT. Below, how "
        "far the cycles are apart across it, mean and three standard deviations: its maximum is RT. Being "
        "late is neither."
    )
    sections = [
        Section("Attained poses", poses, _poses_figure(rows), 620),
        Section("Along the square", square, _square_figure(rows), 520),
        Section("Results", f"{_NOTE} Scenario: {scenario}.", html_table(head, table_rows(rows))),
    ]
    write_plot_page(page, title, told, sections)


def _poses_figure(rows: list[Row]) -> go.Figure:
    figure = make_subplots(3, 1, shared_xaxes=True, vertical_spacing=0.05)
    for number, row in enumerate(rows):
        moves = zip(row.visits.pose, row.visits.before, strict=True)
        labels = [f"{_NAMES[pose]} from {_NAMES[before]}" for pose, before in moves]
        # Beside one another, in the order of the visits from left to right.
        middle = row.visits.pose + _WIDTH * ((number + 0.5) / len(rows) - 0.5)
        order = np.arange(len(middle)) / len(middle) - 0.5
        x = middle + 0.7 * _WIDTH / len(rows) * order
        for axis in range(3):
            figure.add_scatter(
                x=x, y=-1e3 * row.visits.error[:, 3 + axis], mode="markers", name=row.name,
                marker={"color": COLORS[number % len(COLORS)], "size": 5}, legendgroup=row.name,
                showlegend=axis == 0, row=axis + 1, col=1,
                text=labels, hovertemplate="%{text}: %{y:.4f} mm",
            )  # fmt: skip
    for number, name in enumerate("xyz", 1):
        figure.update_yaxes(title=f"{name} in mm", row=number, col=1)
    figure.update_xaxes(tickvals=list(range(5)), ticktext=_NAMES, range=[-0.6, 4.6])
    return figure.update_xaxes(title="pose", row=3, col=1)


def _square_figure(rows: list[Row]) -> go.Figure:
    figure = make_subplots(2, 1, shared_xaxes=True, vertical_spacing=0.07)
    for number, row in enumerate(rows):
        line = {"color": COLORS[number % len(COLORS)]}
        for place, values in enumerate((row.square.off, row.square.scatter), 1):
            figure.add_scatter(
                x=row.square.edge, y=1e3 * values, name=row.name, legendgroup=row.name, line=line,
                mode="lines", showlegend=place == 1, row=place, col=1,
            )  # fmt: skip
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(title="off the path in mm", row=1, col=1)
    figure.update_yaxes(title="apart in mm", row=2, col=1)
    figure.update_xaxes(
        tickvals=list(range(5)), ticktext=[_NAMES[k] for k in (1, 2, 3, 4, 1)], range=[0.0, 4.0]
    )
    return figure.update_xaxes(title="corner", row=2, col=1)


def _largest(values: list[float | None]) -> float:
    return max(value for value in values if value is not None)
