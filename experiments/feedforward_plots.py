"""The pictures of a feedforward study, as in Reiner (2010), figures 6.1 to 6.8, and its page."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.feedforward_study import KINDS, FeedforwardStudy
from experiments.plot_page import Section, html_table, write_plot_page

LABELS = {"rigid": "rigid", "flexible_joint": "flexible joint", "elastic_structure": "elastic structure"}
TABLE_HEAD = ("feedforward", "integral", "max", "max mm", "us a tick")


def criterion_figure(study: FeedforwardStudy, angle_deg: int) -> go.Figure:
    """Contours of the criterion with each feedforward, all in the colours of one scale."""
    figure = make_subplots(1, len(KINDS), subplot_titles=list(LABELS.values()), shared_yaxes=True)
    for column, kind in enumerate(KINDS, 1):
        values = np.log10(study.criterion[angle_deg][kind])
        contour = _contour(study, values, coloraxis="coloraxis", contours={"showlabels": False})
        figure.add_trace(contour, 1, column)
    figure.update_xaxes(title="axis 2 in degrees")
    figure.update_yaxes(title="axis 3 in degrees", col=1)
    return figure.update_layout(coloraxis={"colorscale": "Viridis", "colorbar": {"title": "log10 C in m/s"}})


def surface_figure(study: FeedforwardStudy, angle_deg: int) -> go.Figure:
    """The criterion as surfaces above the positions, one for each feedforward."""
    figure = go.Figure()
    axis_2, axis_3 = _degrees(study)
    for kind, color in zip(KINDS, ("#c0392b", "#e0a030", "#0f7cc0"), strict=True):
        figure.add_trace(
            go.Surface(
                x=axis_2,
                y=axis_3,
                z=study.criterion[angle_deg][kind].T,
                name=LABELS[kind],
                colorscale=[[0.0, color], [1.0, color]],
                showscale=False,
                showlegend=True,
                opacity=0.85,
            )
        )
    return figure.update_layout(
        scene={
            "xaxis": {"title": "axis 2 in degrees"},
            "yaxis": {"title": "axis 3 in degrees"},
            "zaxis": {"title": "C in m/s", "type": "log"},
        }
    )


def ratio_figure(study: FeedforwardStudy, angle_deg: int) -> go.Figure:
    """Contours of C with the elastic structure in the model over C with elastic joints alone."""
    style = {"showlabels": True, "labelfont": {"color": "white"}}
    figure = go.Figure(_contour(study, study.ratio(angle_deg), contours=style, colorscale="Viridis"))
    return figure.update_layout(xaxis={"title": "axis 2 in degrees"}, yaxis={"title": "axis 3 in degrees"})


def deviation_figure(study: FeedforwardStudy) -> go.Figure:
    """How far the tip is from the rectangle over the time."""
    figure = go.Figure()
    for kind, path in study.path.items():
        figure.add_trace(go.Scatter(x=path.time, y=1e3 * path.distance, name=LABELS[kind]))
    return figure.update_layout(
        xaxis={"title": "time in s"}, yaxis={"title": "distance in mm", "type": "log"}
    )


def table_rows(study: FeedforwardStudy) -> list[list[str]]:
    """The deviations of table 6.1, relative to the rigid model, and the time of a tick."""
    rigid = study.path["rigid"]
    return [
        [
            LABELS[kind],
            f"{path.integral / rigid.integral:.4f}",
            f"{path.max / rigid.max:.4f}",
            f"{1e3 * path.max:.4f}",
            f"{1e6 * study.tick[kind]:.0f}",
        ]
        for kind, path in study.path.items()
    ]


def study_verdict(study: FeedforwardStudy) -> str:
    """The ratios in a sentence for each angle."""
    return " ".join(
        f"After {angle} degrees the wrist rings {np.median(study.ratio(angle)):.2f} times as much as without "
        f"the structure in the model (median of {study.ratio(angle).size} positions), at worst "
        f"{study.ratio(angle).max():.2f} times."
        for angle in study.criterion
    )


def write_study_page(path: Path, study: FeedforwardStudy) -> None:
    """All of it as a page that opens offline."""
    sections = [
        Section(
            "Rectangle in space",
            "How far the tip is from its path, relative to the rigid model; Reiner (2010), table 6.1.",
            html_table(TABLE_HEAD, table_rows(study)),
        ),
        Section("Distance from the rectangle", "Without a camera.", deviation_figure(study), 380),
    ]
    for angle in study.criterion:
        sections += [
            Section(
                f"Ringing after {angle} degrees, ratio",
                "C with the elastic structure in the model over C with elastic joints alone.",
                ratio_figure(study, angle),
            ),
            Section(f"Ringing after {angle} degrees", "", criterion_figure(study, angle), 420),
            Section(f"Ringing after {angle} degrees, surfaces", "", surface_figure(study, angle), 560),
        ]
    title = f"Feedforward, {study.robot.name}, {study.payload:g} kg"
    write_plot_page(path, title, study_verdict(study), sections)


def _contour(study: FeedforwardStudy, values: np.ndarray, **style) -> go.Contour:
    axis_2, axis_3 = _degrees(study)
    hover = "axis 2: %{x:.0f}°<br>axis 3: %{y:.0f}°<br>%{z:.3f}<extra></extra>"
    return go.Contour(x=axis_2, y=axis_3, z=values.T, hovertemplate=hover, **style)


def _degrees(study: FeedforwardStudy) -> tuple[np.ndarray, np.ndarray]:
    return np.rad2deg(study.axis_2), np.rad2deg(study.axis_3)
