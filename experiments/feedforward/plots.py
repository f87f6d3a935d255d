"""The pictures of a feedforward study, as in Reiner (2010), figures 6.1 to 6.8, and its page."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.feedforward.rectangle import Deviation
from experiments.feedforward.study import KINDS, FeedforwardStudy
from experiments.feedforward.trial import RINGING
from experiments.feedforward.two_joint_arm import TIMES, Solution, TwoJointArm
from experiments.report.plot_page import Section, html_table, write_plot_page
from systems.feedforward import FEEDFORWARDS

COLORS = {kind: FEEDFORWARDS[kind].colour for kind in KINDS}
_LIGHT = [[0.0, "#8fbbe8"], [0.5, "#f4f1e8"], [1.0, "#f0b27a"]]  # on which the numbers can be read
LABELS = {kind: FEEDFORWARDS[kind].title for kind in KINDS}
TABLE_HEAD = ("feedforward", "mean ratio", "max ratio", "max mm", "sag mm", "dynamic mm", "µs")


def criterion_figure(study: FeedforwardStudy, angle_deg: int) -> go.Figure:
    """Contours of the criterion with each feedforward, all in the colours of one scale."""
    figure = make_subplots(1, len(KINDS), subplot_titles=list(LABELS.values()), shared_yaxes=True)
    for column, kind in enumerate(KINDS, 1):
        values = np.log10(study.criterion[angle_deg][kind])
        contour = _contour(study, values, coloraxis="coloraxis", contours={"showlabels": False})
        figure.add_trace(contour, 1, column)
    figure.update_xaxes(title="axis 2 in degrees")
    figure.update_yaxes(title="axis 3 in degrees", col=1)
    decades = np.log10([study.criterion[angle_deg][kind] for kind in KINDS])
    marks = np.linspace(decades.min(), decades.max(), 6)
    title = {"text": "C in m/s", "side": "right"}
    bar = {"title": title, "tickvals": marks, "ticktext": [f"{10**mark:.2g}" for mark in marks]}
    return figure.update_layout(coloraxis={"colorscale": "Viridis", "colorbar": bar})


def surface_figure(study: FeedforwardStudy, angle_deg: int) -> go.Figure:
    """The criterion as surfaces above the positions, one for each feedforward."""
    figure = go.Figure()
    for kind, color in COLORS.items():
        style = {"colorscale": [[0.0, color], [1.0, color]], "showlegend": True, "opacity": 0.85}
        figure.add_trace(_surface(study, study.criterion[angle_deg][kind], name=LABELS[kind], **style))
    values = np.array([study.criterion[angle_deg][kind] for kind in KINDS])
    has_decades = values.max() > 30.0 * values.min()
    zaxis = {"title": "C in m/s", "type": "log", "dtick": 1 if has_decades else "D2", "tickformat": "~g"}
    return figure.update_layout(scene=_scene(zaxis))


def ratio_figure(study: FeedforwardStudy, angle_deg: int) -> go.Figure:
    """Contours of C with the elastic structure in the model over C with elastic joints alone."""
    style = {"showlabels": True, "labelfont": {"color": "#1c2430"}}
    bar = {"title": {"text": "ratio", "side": "right"}}
    figure = go.Figure(
        _contour(study, study.ratio(angle_deg), contours=style, colorscale=_LIGHT, colorbar=bar)
    )
    return figure.update_layout(xaxis={"title": "axis 2 in degrees"}, yaxis={"title": "axis 3 in degrees"})


def ratio_surface_figure(study: FeedforwardStudy, angle_deg: int) -> go.Figure:
    """The same ratio as a surface above the positions."""
    figure = go.Figure(_surface(study, study.ratio(angle_deg), colorscale="Viridis"))
    return figure.update_layout(scene=_scene({"title": "ratio", "rangemode": "tozero"}))


def deviation_figure(paths: Mapping[str, Deviation]) -> go.Figure:
    """How far the tip is from a rectangle over the time."""
    figure = go.Figure()
    for kind, path in paths.items():
        line = {"color": COLORS[kind]}
        figure.add_trace(go.Scatter(x=path.time, y=1e3 * path.distance, name=LABELS[kind], line=line))
    # Decades alone, where there are many.
    has_decades = paths["elastic_structure"].max < 0.01 * paths["rigid"].max
    yaxis = {
        "title": "distance in mm",
        "type": "log",
        "dtick": 1 if has_decades else "D2",
        "exponentformat": "none",
    }
    return figure.update_layout(xaxis={"title": "time in s"}, yaxis=yaxis)


def table_rows(study: FeedforwardStudy, is_fast: bool = False) -> list[list[str]]:
    """The deviations of table 6.1, relative to the rigid model, and the time of a tick."""
    paths = study.fast if is_fast else study.path
    rigid = paths["rigid"]
    return [
        [
            LABELS[kind],
            f"{path.integral / rigid.integral:.4f}",
            f"{path.max / rigid.max:.4f}",
            f"{1e3 * path.max:.4f}",
            f"{1e3 * path.sag:.4f}",
            f"{1e3 * path.dynamic:.4f}",
            f"{1e6 * study.tick[kind]:.0f}",
        ]
        for kind, path in paths.items()
    ]


def study_verdict(study: FeedforwardStudy) -> str:
    """What is left of the deviation from the rectangle and of the ringing, in some sentences."""
    largest = {kind: 1e3 * path.max for kind, path in study.path.items()}
    sentences = [
        f"On the rectangle the tip is off by {largest['rigid']:.2g} mm with a rigid model, by "
        f"{largest['flexible_joint']:.2g} mm with elastic joints in it, and by "
        f"{largest['elastic_structure']:.2g} mm with the elastic structure{_error_note(study)}.",
        "On a small one with edges as fast as the joints can go it moves by "
        f"{1e3 * study.fast['rigid'].dynamic:.2g}, {1e3 * study.fast['flexible_joint'].dynamic:.2g} and "
        f"{1e3 * study.fast['elastic_structure'].dynamic:.2g} mm from where its sag has it.",
    ]
    sentences += [
        f"After {angle} degrees the wrist rings {np.median(study.ratio(angle)):.2f} times as much as without "
        f"the structure in the model (median of {study.ratio(angle).size} positions), at worst "
        f"{study.ratio(angle).max():.2f} times."
        for angle in study.criterion
    ]
    return " ".join(sentences)


def _error_note(study: FeedforwardStudy) -> str:
    """How wrong the models were."""
    error = study.config.stiffness_error
    if study.plant == "realistic":
        also = f", all the models' springs {error:+.0%}" if error else ""
        return f"; the plant has softer springs, friction, play and hysteresis that no model knows of{also}"
    if not error:
        return ", whose parameters are exact"
    return (
        f"; all springs and dampers of the models are {abs(error):.0%} too {'stiff' if error > 0 else 'soft'}"
    )


def write_study_page(path: Path, study: FeedforwardStudy) -> None:
    """All of it as a page that opens offline."""
    sections = [
        Section(
            "Distance from the rectangle",
            "Of the true tip, without a camera; the feedforward has to do it alone. The lower, the better.",
            deviation_figure(study.path),
            380,
        ),
        Section(
            "Rectangle in space",
            "How far the tip is from its path: mean and maximum as ratios to the rigid model, the maximum in "
            "mm, the sag at rest before it, and how far the tip leaves that when it moves; last, the time "
            "that a tick of the model takes. Reiner (2010), table 6.1.",
            html_table(TABLE_HEAD, table_rows(study)),
        ),
        Section(
            "Distance from the rectangle with fast edges",
            "A quarter of the size, the edges as fast as the joints can go: what excites the structure, "
            "ripples where it swings.",
            deviation_figure(study.fast),
            380,
        ),
        Section(
            "Fast edges",
            "The dynamic part is how far the tip goes from where its sag at rest has it.",
            html_table(TABLE_HEAD[:-1], [row[:-1] for row in table_rows(study, is_fast=True)]),
        ),
    ]
    for angle in study.criterion:
        sections += [
            Section(
                f"Ringing after {angle} degrees, ratio",
                "C with the elastic structure in the model over C with elastic joints alone. Below one, the "
                "structure in the model calms the wrist.",
                ratio_figure(study, angle),
            ),
            Section(
                f"Ringing after {angle} degrees",
                f"Axes 1, 2 and 3 turn together by {angle} degrees and stop. C adds up how much the wrist "
                f"still accelerates in the {RINGING:g} s after that, Reiner (2010), eq. (6.1).",
                criterion_figure(study, angle),
                420,
            ),
            Section(
                f"Ringing after {angle} degrees, surfaces",
                "The same C above the positions: the lower the surface, the calmer the wrist.",
                surface_figure(study, angle),
                560,
            ),
            Section(
                f"Ringing after {angle} degrees, ratio as a surface",
                "The same ratio: below one the structure in the model helps.",
                ratio_surface_figure(study, angle),
                560,
            ),
        ]
    sections.append(
        Section(
            "Why an approximate inverse is enough",
            "The smallest arm whose structure yields, two joints of which the second one is sprung: Reiner "
            "(2010), figure 3.10. Taken for rigid, approximately as in the model above, and exactly; below, "
            "how far torques are from the exact ones.",
            two_joint_figure(),
            760,
        )
    )
    title = f"Feedforward, {study.robot.name}, {study.payload:g} kg, {study.plant} plant"
    write_plot_page(path, title, study_verdict(study), sections)


def two_joint_figure() -> go.Figure:
    """Figure 3.10: angles and torques of both joints by three inverse models, and how far they are apart."""
    arm = TwoJointArm()
    exact = _angles_and_torques(arm.exact())
    models = {
        "rigid": _angles_and_torques(arm.rigid()),
        "approximate": _angles_and_torques(arm.approximate()),
    }
    colors = {"rigid": "#c0392b", "approximate": "#27ae60", "exact": "#2c3e90"}  # those of the source
    titles = ("driven joint", "sprung joint")
    figure = make_subplots(3, 2, shared_xaxes=True, vertical_spacing=0.08, subplot_titles=titles)
    for name, values in (models | {"exact": exact}).items():
        line = {"color": colors[name], "dash": "dash" if name == "exact" else "solid"}
        rows = [*values, values[1] - exact[1]][: 2 if name == "exact" else 3]
        for row, both in enumerate(rows, 1):
            for column, curve in enumerate(both, 1):
                trace = go.Scatter(x=TIMES, y=curve, name=name, line=line, legendgroup=name)
                figure.add_trace(trace.update(showlegend=row == column == 1), row, column)
    figure.update_xaxes(title="time in s", row=3)
    for row, title in enumerate(("angle in degrees", "torque in kN m", "error in kN m"), 1):
        figure.update_yaxes(title=title, row=row, col=1)
    return figure


def _angles_and_torques(solution: Solution) -> np.ndarray:
    """In degrees and kN m, shape (2, joints, times)."""
    angles = np.rad2deg([solution.angle, solution.deflection])
    return np.array([angles, 1e-3 * np.array([solution.torque, solution.section])])


def _surface(study: FeedforwardStudy, values: np.ndarray, **style) -> go.Surface:
    axis_2, axis_3 = _degrees(study)
    return go.Surface(x=axis_2, y=axis_3, z=values.T, showscale=False, **style)


def _scene(zaxis: dict) -> dict:
    axes = {f"{name}axis": {"title": f"axis {number} in degrees"} for name, number in (("x", 2), ("y", 3))}
    camera = {"eye": {"x": 1.5, "y": 1.5, "z": 1.0}, "center": {"x": 0.0, "y": 0.0, "z": -0.12}}
    return axes | {"zaxis": zaxis, "camera": camera}


def _contour(study: FeedforwardStudy, values: np.ndarray, **style) -> go.Contour:
    axis_2, axis_3 = _degrees(study)
    hover = "axis 2: %{x:.0f}°<br>axis 3: %{y:.0f}°<br>%{z:.3f}<extra></extra>"
    return go.Contour(x=axis_2, y=axis_3, z=values.T, hovertemplate=hover, **style)


def _degrees(study: FeedforwardStudy) -> tuple[np.ndarray, np.ndarray]:
    return np.rad2deg(study.axis_2), np.rad2deg(study.axis_3)
