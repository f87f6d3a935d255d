"""A path and a camera of one's own: one class each, which a scenario takes as it takes the shipped ones."""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, cast

import numpy as np

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from robots.configuration.nodes import parse
from robots.configuration.quantity import positive
from robots.configuration.typed import typed
from robots.description.model import RobotModel
from systems.cell.pose_camera import ExposureConfig, PoseCamera, PoseCameraConfig
from systems.reference.paths import ReferenceConfig, make_path
from systems.reference.segment import Segment, line
from systems.reference.shapes import Circle


@dataclass
class Slope:
    """Up and away along a straight line."""

    kind: ClassVar[str] = "slope"
    length: ClassVar[float] = 1.0
    rests: ClassVar[bool] = False
    rise_mm: float = positive(50.0, "mm")

    def segments(self) -> list[Segment]:
        start = Circle().segments()[0].pose[0].reshape(4, 4)  # its tool and centre
        end = start.copy()
        end[:3, 3] += 1e-3 * self.rise_mm * np.array([0.0, 1.0, 1.0])
        return [line(start, end)]


@dataclass
class SlowCamera(ExposureConfig):
    """Every exposure arrives five periods late, without noise."""

    def camera(self, robot: RobotModel) -> PoseCamera:
        return PoseCamera(PoseCameraConfig(period=self.period, delay=5.0 * self.period))


@dataclass
class Own:
    path: Circle | Slope = field(default_factory=Circle)
    camera: PoseCameraConfig | SlowCamera = field(default_factory=PoseCameraConfig)


def test_a_path_and_a_camera_of_ones_own_are_read_checked_and_run():
    own = typed(parse("path: !Slope {rise_mm: 80}\ncamera: !SlowCamera {period: 0.008}", "own"), Own)
    path = make_path(ReferenceConfig(cast(Any, own.path)))
    rise = path.sample(path.duration)[0][:3, 3] - path.sample(0.0)[0][:3, 3]
    np.testing.assert_allclose(rise, [0.0, 0.08, 0.08], atol=1e-12)
    scenario = load_scenario("nominal", ["station.elasticity=rigid"])
    station = replace(scenario.station, camera=own.camera)
    scenario = replace(scenario, station=station, reference=ReferenceConfig(cast(Any, own.path)))
    experiment = Experiment(scenario, "numerical_ik")
    experiment.advance(0.1)
    sample = experiment.station.read(experiment.context, "pose_sample")
    assert 0.04 - 1e-9 <= 0.1 - sample.time < 0.048  # the newest exposure that is five periods old
    assert sample.valid
