"""Setup and results of a camera study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.cameras.accuracy import (
    Accuracy,
    accuracy,
    information,
    places_in_workspace,
    places_on_path,
    pose_covariance,
)
from experiments.cameras.laws import LawResult
from experiments.cameras.sweeps import SWEEPS, SweepPoint, SweepSetup
from experiments.cli.prepare import Prepared
from systems.cell.marker_camera import MarkerCamera, MarkerCameraConfig
from systems.reference.paths import make_path
from systems.vision.camera_rig import load_cell
from systems.vision.marker_body import load_body

PATH_PLACES, WORKSPACE_PLACES = 60, 200


@dataclass(frozen=True)
class CamerasStudy:
    """The results of a study."""

    setup: SweepSetup
    covariance_on_path: np.ndarray  # (p, 6, 6) in rad and m, NaN where a pose is not seen
    covariance_in_workspace: np.ndarray
    sweeps: Mapping[str, Sequence[SweepPoint]]
    laws: Sequence[LawResult]

    @property
    def on_path(self) -> Accuracy:
        """Of the cell as it is, along the path."""
        return accuracy(self.covariance_on_path)

    @property
    def varied(self) -> Mapping[str, Sequence[SweepPoint]]:
        """The sweeps that compare something: two cameras are one number of cameras."""
        return {name: points for name, points in self.sweeps.items() if len(points) > 1}


def study_setup(prepared: Prepared) -> SweepSetup:
    """The cell, the body and the noise of a scenario, and where they are looked at.

    Raises:
        ValueError: if a file is missing or wrong, or the path is out of reach.
    """
    scenario, robot = prepared.scenario, prepared.nominal_robot
    markers, path = prepared.scenario.station.camera, make_path(scenario.reference)
    if not isinstance(markers, MarkerCameraConfig):
        raise ValueError("a study of cameras needs a camera that sees markers: station.camera=images")
    times = np.linspace(path.path_start, path.dwell_start, 2_000)
    speed = np.linalg.norm(path.sample(times)[1][:, 3:], axis=1).max()
    cell, body = load_cell(markers.cell), load_body(markers.body)
    # Values of a sweep may fail, those that were given may not.
    MarkerCamera(markers, robot)
    return SweepSetup(
        cell=cell,
        body=body,
        robot=robot,
        path=places_on_path(scenario, robot, path, PATH_PLACES),
        workspace=places_in_workspace(robot, WORKSPACE_PLACES, scenario.seed),
        pixel_sigma=markers.features.pixel_sigma,
        images=markers.images,
        speed=float(speed),
        seed=scenario.seed,
    )


def covariances(setup: SweepSetup) -> tuple[np.ndarray, np.ndarray]:
    """Of the cell as it is, on the path and in the workspace, (p, 6, 6) each."""
    cameras = setup.cell.camera_model(setup.robot.base.pose())
    on_path, in_workspace = (
        pose_covariance(
            information(cameras, setup.cell.windows, setup.body, places, setup.robot).sum(1),
            setup.pixel_sigma,
        )
        for places in (setup.path, setup.workspace)
    )
    return on_path, in_workspace


def study_json(study: CamerasStudy) -> dict[str, Any]:
    """The numbers of a study."""
    return {
        "pixel_sigma": study.setup.pixel_sigma,
        "path_speed_m_s": study.setup.speed,
        "path": study.on_path.as_dict(),
        "workspace": accuracy(study.covariance_in_workspace).as_dict(),
        "sweeps": {
            name: {"axis": SWEEPS[name].axis, "points": [point.as_dict() for point in points]}
            for name, points in study.sweeps.items()
        },
        "laws": [
            {"law": result.law, "camera": result.camera, "rate_hz": result.rate_hz, "true": result.errors}
            for result in study.laws
        ],
    }


def study_verdict(study: CamerasStudy) -> str:
    """What was found, in words."""
    found = study.on_path
    if found.seen == 0.0:
        return "No pose of the path is seen by enough cameras."
    return (
        f"With {study.setup.pixel_sigma:g} px of noise the position on the path is known to "
        f"{1e6 * found.position:.1f} µm along an axis and the orientation to "
        f"{1e3 * np.rad2deg(found.rotation):.1f} millidegrees, at best; {100.0 * found.seen:.0f} % of its "
        "poses are seen."
    )
