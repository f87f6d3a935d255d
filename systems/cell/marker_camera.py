"""A pose camera whose pose comes from markers: blobs in the images of many cameras, tracked, and late.

On the level of *features* the blobs are projected centres with noise; on the level of *images* they are found
in simulated pictures of windows about where the tracker expects the body. From there on both are the same.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues
from scipy.special import ndtri

from robots.configuration.quantity import file_name
from robots.description.model import NUM_JOINTS, RobotModel
from robots.kinematics.arm_capsules import ArmCapsules
from robots.pose import pose_error
from systems.cell.imaging.features import FeatureConfig, FeatureSource
from systems.cell.imaging.image_blobs import ImageBlobs
from systems.cell.imaging.images import ImageConfig
from systems.cell.pose_camera import BLOCK, ExposureConfig
from systems.sampled_system import SampledSystem
from systems.samples import PoseSample
from systems.vision.blobs.centroids import CentroidConfig
from systems.vision.camera_rig import load_cell
from systems.vision.marker_body import load_body
from systems.vision.tracking.tracker import Tracker, TrackerConfig, TrackerState

_WIDTH = 15  # time, valid, the rows of the 3 x 4 pose matrix, residual
_EPSILON = 1e-9  # s, a sample that is due at a tick arrives at it in spite of rounding


@dataclass
class MarkerCameraConfig(ExposureConfig):
    """Which cameras look at which body, and how well; read from a scenario file."""

    kind: ClassVar[str]

    cell: str = file_name("probst")  # a shipped cell or the path of a cell file
    # The cell as the tracker knows it, such as `truetip cameras calibrate --write` makes; none: as it is.
    calibration: str = file_name()
    body: str = file_name("probst")  # a shipped detection body or the path of a body file
    features: FeatureConfig = field(default_factory=FeatureConfig)
    images: ImageConfig = field(default_factory=ImageConfig)
    centroids: CentroidConfig = field(default_factory=CentroidConfig)
    tracker: TrackerConfig = field(default_factory=TrackerConfig)

    def camera(self, robot: RobotModel) -> "MarkerCamera":
        """The camera of a station with this robot. Raises ValueError as `MarkerCamera`."""
        return MarkerCamera(self, robot)


@dataclass
class MarkerFeaturesConfig(MarkerCameraConfig):
    """Blobs are projected centres of markers with noise."""

    kind: ClassVar[str] = "features"


@dataclass
class MarkerImagesConfig(MarkerCameraConfig):
    """Blobs are found in simulated pictures."""

    kind: ClassVar[str] = "images"


class MarkerCamera(SampledSystem):
    """Measures the pose of the tool at t = 0, period, 2 period, ... by the markers of a body at it.

    Ports, those of `systems.cell.pose_camera.PoseCamera`:
        in  ``X_WE``         RigidTransform, the true tool in the world
        in  ``noise``        vector, standard normal, drawn anew every `BLOCK` periods
        out ``pose_sample``  PoseSample, the newest one that has arrived; a lost exposure arrives as invalid
        out ``exposure``     vector 14, the last exposure before it arrives: time, validity, rows of X_WE
    and one more, which may stay unconnected:
        in  ``motor_state``  vector 12, of which the positions (rad) place the arm that hides markers

    Gears are too stiff for their deflection to matter for what the arm hides. How far an image is blurred by
    motion follows from where the tool was an exposure before. The ``residual`` of a sample is the standard
    deviation of its position that follows from the scatter of the pixels. A frame without a pose repeats the
    last one as invalid.
    """

    def __init__(self, config: MarkerCameraConfig, robot: RobotModel | None = None) -> None:
        """Reads cell and body.

        Args:
            config: when exposures are made, what the pose is measured with, and where blobs come from.
            robot: whose base the cell stands about, and whose arm hides markers; None for a base at the
                origin of the world.

        Raises:
            ValueError: if something is out of its range, or a file is missing or wrong.
        """
        super().__init__()
        config.check()
        cell, body = load_cell(config.cell), load_body(config.body)
        X_WB = robot.base.pose() if robot else None
        cameras = cell.camera_model(X_WB)
        known = load_cell(config.calibration) if config.calibration else cell
        names, known_names = ([camera.name for camera in each.cameras] for each in (cell, known))
        if known_names != names:
            raise ValueError(
                f"marker camera: the calibration {config.calibration} must have the cameras of the cell, "
                f"{', '.join(names)}, got {', '.join(known_names)}; station.camera.cell names another cell"
            )
        self._config = config
        # Both are made, so that a wrong number is refused on either level.
        self._features = FeatureSource(cameras, cell.windows, body, config.features)
        self._images = ImageBlobs(cameras, cell.windows, body, config.images, config.centroids)
        self._tracker = Tracker(known.camera_model(X_WB), body, config.tracker)
        self._arm = ArmCapsules(robot) if robot else None
        self._lost_below = ndtri(config.dropout_probability)
        source = self._features if config.kind == "features" else self._images
        self._per_exposure = source.noise_size + 1  # the last one for a lost exposure
        self._X_WE = self.DeclareAbstractInputPort("X_WE", Value(RigidTransform()))
        self._noise = self.DeclareVectorInputPort(
            "noise", BLOCK * self._per_exposure, RandomDistribution.kGaussian
        )
        self._motor_state = self.DeclareVectorInputPort("motor_state", 2 * NUM_JOINTS)
        in_flight = int(np.floor(config.delay / config.period + _EPSILON)) + 2
        empty = np.concatenate([[-np.inf, 0.0], np.eye(4)[:3].ravel(), [0.0]])
        newest = self.DeclareDiscreteState(empty[:-1])
        self._in_flight = self.DeclareDiscreteState(np.tile(empty, in_flight))
        self._memory = self.DeclareDiscreteState(TrackerState().to_vector())
        self._before = self.DeclareDiscreteState(empty[:-1])  # time and true pose of the last exposure
        self.DeclareStateOutputPort("exposure", newest)
        self.DeclareAbstractOutputPort(
            "pose_sample",
            lambda: Value(PoseSample()),
            self._calc_sample,
            {self.time_ticket(), self.xd_ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(config.period, 0.0, self._expose)

    def _expose(self, context: Context, discrete_state: DiscreteValues) -> None:
        time = context.get_time()
        first = round(time / self._config.period) % BLOCK * self._per_exposure
        noise = self._noise.Eval(context)[first : first + self._per_exposure]
        lost = noise[-1] < self._lost_below
        for start, end in self._config.dropouts:
            lost = lost or start <= time < end
        state = TrackerState.from_vector(context.get_discrete_state(self._memory).value())
        true = self._X_WE.Eval(context).GetAsMatrix4()
        X_WE, valid, residual = state.X_WE, False, 0.0
        if not lost:
            blobs = self._blobs(context, state, true, noise[:-1])
            state, found = self._tracker.track(state, time, blobs)
            valid, residual = found.valid, found.position_sigma
            X_WE = state.X_WE
        exposure = np.concatenate([[time, valid], X_WE[:3].ravel(), [residual]])
        in_flight = discrete_state.get_mutable_value(self._in_flight)
        in_flight[_WIDTH:] = in_flight[:-_WIDTH].copy()
        in_flight[:_WIDTH] = exposure
        discrete_state.set_value(0, exposure[:-1])
        discrete_state.set_value(self._memory, state.to_vector())
        discrete_state.set_value(self._before, np.concatenate([[time, 1.0], true[:3].ravel()]))

    def _blobs(
        self, context: Context, state: TrackerState, X_WE: np.ndarray, noise: np.ndarray
    ) -> np.ndarray:
        """What the cameras see of the body at its true pose."""
        arm = None
        if self._arm is not None and self._motor_state.HasValue(context):
            arm = self._arm.at(self._motor_state.Eval(context)[:NUM_JOINTS])
        if self._config.kind == "features":
            return self._features.blobs(X_WE, noise, arm)
        time, V_WE = context.get_time(), np.zeros(6)
        before = context.get_discrete_state(self._before).value()
        if before[1]:
            X_before = np.vstack([before[2:].reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
            V_WE = pose_error(X_WE, X_before) / (time - before[0])
        return self._images.blobs(X_WE, V_WE, self._tracker.predict(state, time), noise, arm)

    def _calc_sample(self, context: Context, output) -> None:
        due = context.get_time() - self._config.delay + _EPSILON
        in_flight = context.get_discrete_state(self._in_flight).value().reshape(-1, _WIDTH)
        entry = next(candidate for candidate in in_flight if candidate[0] <= due)
        # Orthonormal by construction; checking it again would cost more than the rest.
        X_WE = RigidTransform.MakeUnchecked(entry[2:14].reshape(3, 4))
        stamp = self._config.stamp(float(entry[0]))
        output.set_value(PoseSample(stamp, X_WE, bool(entry[1]), float(entry[14])))
