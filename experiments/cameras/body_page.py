"""A body before and after its markers were moved: how well its pose is measured, as JSON and as a page."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from experiments.cameras.accuracy import Places, accuracy, information, pose_covariance
from experiments.cameras.plots import SCENE
from experiments.cameras.sweeps import SweepSetup
from experiments.report.figure_style import COLORS
from experiments.report.plot_page import Section, html_table, sortable_table, write_plot_page
from systems.vision.body_design import distinct, spacing

_NAMES = ("as it was", "moved")


@dataclass(frozen=True)
class MovedBody:
    """Two bodies in one cell.

    Attributes:
        setup: cameras, places and the body as it was.
        p_E: markers after they were moved, (m, 3) in m.
        steps: that were tried.
    """

    setup: SweepSetup
    p_E: np.ndarray
    steps: int

    @property
    def markers(self) -> tuple[np.ndarray, np.ndarray]:
        """Before and after, (m, 3) each in m."""
        return self.setup.body.p_E, self.p_E

    @cached_property
    def on_path(self) -> list[np.ndarray]:
        """Covariances (p, 6, 6) along the path, before and after."""
        return [covariance(self.setup, each, self.setup.path) for each in self.markers]

    @cached_property
    def in_workspace(self) -> list[np.ndarray]:
        """Covariances (p, 6, 6) over the workspace, before and after."""
        return [covariance(self.setup, each, self.setup.workspace) for each in self.markers]

    @cached_property
    def numbers(self) -> dict[str, Any]:
        """As of ``--json``: standard deviations in um before and after, markers in mm."""
        return {
            "path_um": [1e6 * root_mean(each) for each in self.on_path],
            "workspace_um": [1e6 * accuracy(each).position for each in self.in_workspace],
            "markers_mm": np.round(1e3 * self.p_E, 1).tolist(),
            "spacing_mm": 1e3 * spacing(self.p_E),
            "distinct_mm": 1e3 * distinct(self.p_E),
        }

    @property
    def verdict(self) -> str:
        """What was gained, in a sentence."""
        path, workspace = self.numbers["path_um"], self.numbers["workspace_um"]
        return (
            f"Standard deviation of the tool's position: {path[0]:.1f} to {path[1]:.1f} µm in the mean along "
            f"the path, {workspace[0]:.1f} to {workspace[1]:.1f} µm in the median over the workspace."
        )


def covariance(setup: SweepSetup, p_E: np.ndarray, places: Places) -> np.ndarray:
    """Covariances (p, 6, 6) of poses (rad, m) for markers (m, 3) in m; NaN where a pose is not seen."""
    cameras = setup.cell.camera_model(setup.robot.base.pose())
    body = replace(setup.body, markers_mm=1e3 * p_E)
    seen = information(cameras, setup.cell.windows, body, places, setup.robot).sum(1)
    return pose_covariance(seen, setup.pixel_sigma)


def root_mean(covariances: np.ndarray) -> float:
    """Root mean variance of a coordinate at poses in m; infinite if one of them is not seen."""
    variance = np.diagonal(covariances, axis1=1, axis2=2)[:, 3:]
    return float(np.sqrt(variance.mean())) if np.isfinite(variance).all() else np.inf


def write_body_page(path: Path, title: str, moved: MovedBody) -> None:
    """The page; opens offline."""
    noise = f"for pixels of {moved.setup.pixel_sigma:g} px"
    sections = [
        Section(
            "Along the path",
            f"Standard deviation of the tool's position along an axis, {noise}; the moved markers should be "
            "below the former ones everywhere.",
            _path_figure(moved),
            360,
        ),
        Section(
            "Over the workspace",
            "Share of random configurations of the arm at which the position is known at least so well.",
            _workspace_figure(moved),
            360,
        ),
        Section(
            "The markers",
            "In the frame of the tool; a grey line leads from where a marker was to where it is.",
            _marker_figure(moved),
            560,
        ),
        Section("In numbers", "Medians and what a tenth of the poses exceeds.", _accuracy_table(moved)),
        Section("Coordinates", _spaces(moved), _marker_table(moved)),
    ]
    write_plot_page(path, f"Marker body, {title}", moved.verdict, sections)


def _sigmas(covariances: np.ndarray) -> np.ndarray:
    return 1e6 * np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)[:, 3:].mean(1))


def _path_figure(moved: MovedBody) -> go.Figure:
    step = np.linalg.norm(np.diff(moved.setup.path.X_WE[:, :3, 3], axis=0), axis=1)
    length = 1e3 * np.append(0.0, np.cumsum(step))
    figure = go.Figure()
    for name, covariances, color in zip(_NAMES, moved.on_path, COLORS, strict=False):
        line = {"color": color}
        figure.add_trace(go.Scatter(x=length, y=_sigmas(covariances), name=name, mode="lines", line=line))
    return figure.update_layout(
        xaxis={"title": "way along the path in mm"},
        yaxis={"title": "σ along an axis in µm", "rangemode": "tozero"},
    )


def _workspace_figure(moved: MovedBody) -> go.Figure:
    figure, shown = go.Figure(), []
    for name, covariances, color in zip(_NAMES, moved.in_workspace, COLORS, strict=False):
        sigma = np.sort(_sigmas(covariances))  # poses that are not seen, NaN, come last
        share = 100.0 * np.arange(1, len(sigma) + 1) / len(sigma)
        seen = np.isfinite(sigma)
        shown += list(np.quantile(sigma[seen], [0.0, 0.98])) if seen.any() else []
        line = {"color": color, "shape": "hv"}
        figure.add_trace(go.Scatter(x=sigma[seen], y=share[seen], name=name, mode="lines", line=line))
    return figure.update_layout(
        xaxis={"title": "σ along an axis in µm", "range": [0.9 * min(shown), max(shown)] if shown else None},
        yaxis={"title": "configurations in %", "range": [0, 100]},
    )


def _marker_figure(moved: MovedBody) -> go.Figure:
    before, after = (1e3 * each for each in moved.markers)
    ways = np.stack([before, after, np.full_like(after, np.nan)], axis=1).reshape(-1, 3)
    figure = go.Figure()
    line = {"color": "#9aa5b4", "width": 3}
    x, y, z = ways.T
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines", line=line, hoverinfo="skip", showlegend=False))
    numbers = [f"marker {k + 1}" for k in range(len(after))]
    for name, points, color in zip(_NAMES, (before, after), COLORS, strict=False):
        x, y, z = points.T
        dots = {"size": 5, "color": color}
        figure.add_trace(
            go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=dots, name=name, hovertext=numbers)
        )
    axes = {f"{axis}axis": {"title": f"{axis} in mm"} for axis in "xyz"}
    return figure.update_layout(scene=SCENE | axes)


def _accuracy_table(moved: MovedBody) -> str:
    head = ("where", "markers", "position µm", "a tenth exceeds µm", "rotation 0.001°", "seen %")
    rows = []
    for where, both in (("path", moved.on_path), ("workspace", moved.in_workspace)):
        for name, covariances in zip(_NAMES, both, strict=True):
            found = accuracy(covariances).as_dict().values()
            rows.append([where, name, *("-" if number is None else f"{number:.1f}" for number in found)])
    return html_table(head, rows)


def _spaces(moved: MovedBody) -> str:
    before, after = moved.markers
    return (
        f"In mm: of {moved.setup.body.name}, and after {moved.steps} steps. Two markers are at least "
        f"{1e3 * spacing(after):.1f} mm apart (were {1e3 * spacing(before):.1f}), any two distances differ "
        f"by {1e3 * distinct(after):.2f} mm (were {1e3 * distinct(before):.2f}), by which the tracker tells "
        "markers from one another."
    )


def _marker_table(moved: MovedBody) -> str:
    before, after = (1e3 * each for each in moved.markers)
    rows = [
        [f"{k + 1}", *(f"{value:.1f}" for value in (*was, *now)), f"{np.linalg.norm(now - was):.1f}"]
        for k, (was, now) in enumerate(zip(before, after, strict=True))
    ]
    head = ["marker", "x was", "y was", "z was", "x", "y", "z", "moved by"]
    return sortable_table("markers", head, rows)
