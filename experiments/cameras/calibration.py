"""Results of a camera calibration as JSON, as a table and as a page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.cameras.plots import SCENE
from experiments.cli.console import print_table
from experiments.report.plot_page import Section, html_table, write_plot_page
from systems.vision.calibration.camera_parameters import LENS_NAMES, NUM_LENS, change_between
from systems.vision.calibration.wand import CalibrationKit
from systems.vision.calibration.wand_calibration import WandCalibration
from systems.vision.camera_model import Cameras

HEAD = ("camera", "x mm", "y mm", "z mm", "± mm", "points", "out", "rms px", "ray mm")
_COLOR = "#0f7cc0"


@dataclass(frozen=True)
class CamerasFound:
    """A calibration with its inputs, and the true cameras if they were simulated."""

    calibration: WandCalibration
    names: list[str]
    kit: CalibrationKit
    seconds: float
    truth: Cameras | None

    @property
    def ratios(self) -> np.ndarray | None:
        """Errors of the parameters over their standard deviations, (n, 15); None without a truth."""
        if self.truth is None:
            return None
        sigmas = np.sqrt(np.einsum("nii->ni", self.calibration.covariance))
        return change_between(self.truth, self.calibration.cameras) / sigmas

    @property
    def lens_sigmas(self) -> np.ndarray:
        """Standard deviations of the lens parameters, (n, 9)."""
        return np.sqrt(np.einsum("nii->ni", self.calibration.covariance)[:, :NUM_LENS])


def lens_parameters(cameras: Cameras) -> np.ndarray:
    """The parameters in the order of `LENS_NAMES`, px and coefficients, (n, 9)."""
    return np.hstack([cameras.focal, cameras.center, cameras.radial, cameras.tangential])


def calibration_json(found: CamerasFound) -> dict[str, Any]:
    """The numbers of a calibration."""
    calibration = found.calibration
    lens = lens_parameters(calibration.cameras)
    cameras = []
    for i, name in enumerate(found.names):
        camera = {
            "name": name,
            "position_mm": (1e3 * calibration.cameras.p_WC[i]).tolist(),
            "position_standard_deviation_mm": float(1e3 * calibration.position_sigma[i]),
            "points": int(calibration.points[i]),
            "left_out": int(calibration.outliers[i]),
            "unused": int(calibration.unused[i]),
            "rms_px": float(calibration.rms_px[i]),
            "average_residual_mm": float(1e3 * calibration.mean_distance[i]),
            "lens": {
                parameter: {"value": float(value), "standard_deviation": float(sigma)}
                for parameter, value, sigma in zip(LENS_NAMES, lens[i], found.lens_sigmas[i], strict=True)
            },
        }
        if found.truth is not None:
            off = np.linalg.norm(calibration.cameras.p_WC[i] - found.truth.p_WC[i])
            camera["position_error_mm"] = float(1e3 * off)
        cameras.append(camera)
    return {
        "cameras": cameras,
        "pixel_standard_deviation": calibration.sigma,
        "wand_places": len(calibration.wand_lengths),
        "wand_length_mm": found.kit.wand_length_mm,
        "wand_length_mean_mm": float(1e3 * calibration.wand_lengths.mean()),
        "wand_length_standard_deviation_mm": 1e3 * calibration.wand_deviation,
        "wand_length_by_frame_mm": 1e3 * calibration.wand_by_frame,
        "wand_length_by_frame_standard_deviation_mm": 1e3 * calibration.wand_by_frame_sigma,
        "largest_error_over_standard_deviation": None
        if found.ratios is None
        else float(np.abs(found.ratios).max()),
        "seconds": found.seconds,
    }


def print_calibration(console: Console, found: CamerasFound) -> None:
    """The table of Probst (2024), figure A.10, with what it leaves open."""
    table = Table(
        box=box.SIMPLE_HEAD, title="Cameras", title_justify="left", title_style="italic", pad_edge=False
    )
    for head in HEAD:
        table.add_column(head, justify="left" if head == "camera" else "right", no_wrap=True)
    for row in _rows(found):
        table.add_row(*(escape(cell) for cell in row))
    print_table(console, table)
    console.print(escape(verdict(found)))


def verdict(found: CamerasFound) -> str:
    """What was reached, in words."""
    calibration = found.calibration
    text = (
        f"Measured at {len(calibration.wand_lengths)} places, the wand's length has a standard deviation of "
        f"{1e3 * calibration.wand_deviation:.4f} mm; pixels scatter by {calibration.sigma:.3f} px."
    )
    if calibration.contradicts_frame:
        given, by_frame = found.kit.wand_length_mm, 1e3 * calibration.wand_by_frame
        sigma = 1e3 * calibration.wand_by_frame_sigma
        text += (
            f" By the L-frame the wand is {by_frame:.2f} mm long ({sigma:.2f} mm standard deviation) "
            f"and not {given:g}: one of the two is wrong, and if it is the wand, all "
            f"lengths are wrong by {1e3 * abs(given / by_frame - 1.0):.2f} mm in a metre."
        )
    if found.ratios is not None:
        largest = np.abs(found.ratios).max()
        text += (
            f" Of {found.ratios.size} parameters of lenses and places none is off by more than {largest:.1f} "
            "standard deviations."
        )
    return text


def write_calibration_page(path: Path, title: str, found: CamerasFound) -> None:
    """The page of a calibration; opens offline."""
    note = (
        "Positions in the frame of the L-frame with their standard deviations along an axis; points used, "
        "and left out as they contradict the other cameras; root mean square residuals in px, and average "
        "distances between points and rays in mm, as in Probst (2024), figure A.10."
    )
    note_map = (
        "Cameras with their optical axes, where the wand was (grey) and the L-frame at the origin (orange)."
    )
    note_lenses = (
        "Focal lengths f and principal points c in px, radial distortion k and tangential p as in OpenCV, "
        "with their standard deviations."
    )
    sections = [
        Section(
            "Length of the wand",
            "In each place, by triangulation alone: the narrower about zero, the better.",
            _lengths(found),
            320,
        ),
        Section("Cameras", note, html_table(HEAD, _rows(found))),
        Section("Where they stand", note_map, _map(found), 620),
        Section("Lenses", note_lenses, html_table(*_lens_table(found))),
    ]
    write_plot_page(path, f"Cameras, {title}", verdict(found), sections)


def _rows(found: CamerasFound) -> list[list[str]]:
    calibration = found.calibration
    rows = []
    for i, name in enumerate(found.names):
        position = [f"{value:.2f}" for value in 1e3 * calibration.cameras.p_WC[i]]
        rows.append(
            [
                name,
                *position,
                f"{1e3 * calibration.position_sigma[i]:.2f}",
                str(calibration.points[i]),
                str(calibration.outliers[i]),
                f"{calibration.rms_px[i]:.3f}",
                f"{1e3 * calibration.mean_distance[i]:.4f}",
            ]
        )
    return rows


def _lens_table(found: CamerasFound) -> tuple[list[str], list[list[str]]]:
    thousandths = np.array([1e3 if name.startswith("p") else 1.0 for name in LENS_NAMES])
    values, sigmas = (
        thousandths * numbers for numbers in (lens_parameters(found.calibration.cameras), found.lens_sigmas)
    )
    rows = []
    for name, value, sigma in zip(found.names, values, sigmas, strict=True):
        rows.append([name, *(_rounded(v, s) for v, s in zip(value, sigma, strict=True))])
    return ["camera", *(f"1000 {name}" if name.startswith("p") else name for name in LENS_NAMES)], rows


def _rounded(value: float, sigma: float) -> str:
    """A value and its standard deviation, to the first digit of the latter."""
    digits = max(0, -int(np.floor(np.log10(sigma)))) if sigma > 0.0 else 6
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def _map(found: CamerasFound) -> go.Figure:
    cameras = found.calibration.cameras
    figure = go.Figure()
    x, y, z = found.calibration.wand.reshape(-1, 3).T
    dots = {"size": 1.5, "color": "#9aa5b4"}
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=dots, name="wand"))
    ahead = cameras.p_WC + cameras.R_WC[:, :, 2]
    lines = np.stack([cameras.p_WC, ahead, np.full_like(ahead, np.nan)], axis=1).reshape(-1, 3)
    x, y, z = lines.T
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines", line={"color": _COLOR}, name="axes"))
    x, y, z = cameras.p_WC.T
    dots = {"size": 4, "color": _COLOR}
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="markers+text", text=found.names, marker=dots))
    frame = found.kit.p_Q
    x, y, z = np.stack([frame[[0, -1]], frame[[0, 2]]]).reshape(-1, 3).T
    figure.add_trace(go.Scatter3d(x=x, y=y, z=z, mode="lines", line={"color": "#d2691e", "width": 6}))
    return figure.update_layout(scene=SCENE, showlegend=False)


def _lengths(found: CamerasFound) -> go.Figure:
    off = 1e3 * found.calibration.wand_lengths - found.kit.wand_length_mm
    figure = go.Figure(go.Histogram(x=off, marker_color=_COLOR, nbinsx=60))
    return figure.update_layout(
        xaxis={"title": "measured minus given length in mm"}, yaxis={"title": "places"}
    )
