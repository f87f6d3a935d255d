"""Tracking of a marker body: prediction, matching, pose fit to the pixels, and plausibility checks.

With a pose to start from, the markers are expected where it would show them a frame later. Without one, the
blobs are put together to points by epipolar lines, the points are named by the body's geometry, and the pose
that they give is where the markers are expected. Either way it is refined on the pixels in ever narrower
gates, and it counts only if enough markers agree with it and little of what is seen contradicts it: a pose
with markers exchanged would leave blobs unexplained or pixels far from their place.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from robots.metrology.least_squares import UndeterminedError
from robots.pose import pose_error
from systems.vision.body_pose import body_pose, collinear
from systems.vision.camera_model import Cameras
from systems.vision.marker_body import MINIMUM_MARKERS, DetectionBody
from systems.vision.tracking.correspondence import SceneMatcher, blobs_of_points
from systems.vision.tracking.marker_images import marker_diameters, shared_images, touching
from systems.vision.tracking.marker_names import MarkerNames
from systems.vision.tracking.matching import match_to_prediction, unexplained_share
from systems.vision.tracking.pose_refinement import (
    PixelFit,
    gauss_newton_step,
    linearize,
    moved,
    refine_pose,
    shared,
)
from systems.vision.triangulation import triangulate

_STEPS = 8
_NEAR = 1e-3  # m and rad; a step of this size leaves an error of its square, a hundredth of a pixel
_LARGEST_RATIO = 2.0  # of the scatter of the pixels to what is expected; chance matches have 3
_MERGE_MARGIN = 1.05  # images nearer to each other than this many diameters may be one blob


@dataclass
class TrackerConfig:
    """Parameters of a tracker; read from a scenario file."""

    pixel_sigma: float = 0.1  # px, expected of a blob
    gate: float = 6.0  # px, how far a marker may be from its prediction
    fit_gate: float = 6.0  # times pixel_sigma, how far a blob may be from the pose that it is part of
    distance_tolerance: float = 1e-3  # m, between points of an unknown scene and those of the body
    coast: float = 0.1  # s, how long a pose serves for a prediction
    min_cameras: int = 3  # that must confirm a point of an unknown scene
    largest_position_sigma: float = 1e-3  # m, a pose known less well is none
    largest_unexplained: float = 0.5  # share of the blobs about the body that belong to no marker


@dataclass(frozen=True)
class TrackerState:
    """The state of a tracker between frames."""

    time: float = -np.inf  # s, of the last pose; minus infinity if there was none
    X_WE: np.ndarray = field(default_factory=lambda: np.eye(4))
    V_WE: np.ndarray = field(default_factory=lambda: np.zeros(6))  # rad/s and m/s

    def to_vector(self) -> np.ndarray:
        """As 19 numbers, for the state of a system."""
        return np.concatenate([[self.time], self.X_WE[:3].ravel(), self.V_WE])

    @classmethod
    def from_vector(cls, vector: np.ndarray) -> "TrackerState":
        """The inverse of `to_vector`."""
        X_WE = np.eye(4)
        X_WE[:3] = vector[1:13].reshape(3, 4)
        return cls(float(vector[0]), X_WE, vector[13:].copy())


@dataclass(frozen=True)
class TrackedPose:
    """The pose estimate of one frame."""

    valid: bool
    X_WE: np.ndarray  # homogeneous matrix (4, 4); where it was looked for last, if it is not valid
    blobs: np.ndarray  # of each marker in each camera the blob that it has alone, -1 for none, (n, m)
    fit: PixelFit | None = None  # accuracy and residual; None if it is not valid
    recovered: bool = False  # found without a prediction
    reason: str = ""  # why it is not valid

    @property
    def position_sigma(self) -> float:
        """Standard deviation of the position along an axis in m, as the residuals show it; 0 if not valid."""
        if self.fit is None:
            return 0.0
        return self.fit.sigma * float(np.sqrt(np.trace(self.fit.cofactor[3:, 3:]) / 3.0))


class Tracker:
    """Follows one body with m markers through the images of n cameras."""

    def __init__(self, cameras: Cameras, body: DetectionBody, config: TrackerConfig | None = None) -> None:
        """Prepares geometry and names.

        Raises:
            ValueError: if a number of the configuration is not positive, or the body looks the same in two
                ways.
        """
        self._config = config or TrackerConfig()
        _check(self._config)
        self._cameras, self._body = cameras, body
        self._fit_gate = self._config.fit_gate * self._config.pixel_sigma
        self._gate = max(self._config.gate, self._fit_gate)
        self._scene = SceneMatcher(cameras, 1.5 * self._fit_gate, self._config.min_cameras)
        self._names = MarkerNames(body, self._config.distance_tolerance)
        if self._names.name(body.p_E) is None:
            raise ValueError(
                f"body {body.name}: its markers look the same in two ways, within "
                f"{1e3 * self._config.distance_tolerance:g} mm; move one to make it asymmetric"
            )

    def predict(self, state: TrackerState, time: float) -> np.ndarray | None:
        """Where the body is expected at a time in s, (4, 4); None if it has not been seen for too long."""
        dt = time - state.time
        return moved(state.X_WE, dt * state.V_WE) if 0.0 < dt <= self._config.coast else None

    def track(self, state: TrackerState, time: float, blobs: np.ndarray) -> tuple[TrackerState, TrackedPose]:
        """One frame.

        Args:
            state: what was remembered from the last frame.
            time: of this frame in s.
            blobs: pixels, shape (n, b, 2), b at least one, NaN where there is none.
        """
        expected = self.predict(state, time)
        found = None
        if expected is not None:
            found = self._lock(expected, blobs)
        if found is None or not found.valid:
            guess = self.find(blobs)
            if guess is not None:
                found = replace(self._lock(guess, blobs), recovered=True)
            elif found is None:
                found = self._lost(state.X_WE, "no arrangement of points is that of the markers")
        if not found.valid:
            return state, found
        V_WE = np.zeros(6)
        if expected is not None:
            V_WE = pose_error(found.X_WE, state.X_WE) / (time - state.time)
        return TrackerState(time, found.X_WE, V_WE), found

    def find(self, blobs: np.ndarray) -> np.ndarray | None:
        """The pose (4, 4) of the body in an unknown scene, about; None if nothing in it is the body."""
        points = self._scene.match(blobs)
        seen = triangulate(self._cameras, blobs_of_points(blobs, points.T), self._config.pixel_sigma)
        kept = np.isfinite(seen.residual)
        names = self._names.name(seen.p_W[kept])
        if names is None:
            return None
        markers, of_marker = np.flatnonzero(names >= 0), names[names >= 0]
        try:
            fit = body_pose(
                self._body.p_E[markers], seen.p_W[kept][of_marker], seen.covariance[kept][of_marker]
            )
        except UndeterminedError:
            return None
        return fit.X_WE

    def _lock(self, X_WE: np.ndarray, blobs: np.ndarray) -> TrackedPose:
        """Fits the pose to all that can be told of the body from near a first guess, and checks it."""
        try:
            X_WE, expected = self._approached(X_WE, blobs)
            diameters = self._diameters(X_WE)
            share = shared_images(touching(expected, diameters), np.isfinite(expected[..., 0]), diameters)
            # Matched once: a blob at the edge of its gate could come and go with every step.
            shown = np.concatenate([expected, shared(expected, share)], 1)
            index = match_to_prediction(shown, blobs, self._fit_gate)
            fit = refine_pose(self._cameras, self._body.p_E, blobs_of_points(blobs, index), X_WE, share)
        except UndeterminedError as error:
            return self._lost(X_WE, str(error))
        index = index[:, : len(self._body)]
        problem = self._doubt(fit, index, expected, blobs)
        return self._lost(X_WE, problem) if problem else TrackedPose(True, fit.X_WE, index, fit)

    def _approached(self, X_WE: np.ndarray, blobs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pose (4, 4) after steps in ever narrower gates, by markers whose images stand alone.

        Also where it shows the markers, px, shape (n, m, 2).

        Raises:
            UndeterminedError: if they do not determine it, or it does not come to rest.
        """
        gate, reach = self._gate, _MERGE_MARGIN * self._diameters(X_WE)
        for _ in range(_STEPS):
            expected, J = linearize(self._cameras, self._body.p_E, X_WE)
            crowded = np.any(touching(expected, reach), axis=2)
            index = match_to_prediction(np.where(crowded[..., None], np.nan, expected), blobs, gate)
            step, fit = gauss_newton_step(expected, J, blobs_of_points(blobs, index), X_WE)
            X_WE = fit.X_WE
            if np.abs(step).max() < _NEAR:
                return X_WE, expected + J @ step
            gate = max(0.5 * gate, self._fit_gate)
        raise UndeterminedError("the pose does not come to rest")

    def _diameters(self, X_WE: np.ndarray) -> np.ndarray:
        return marker_diameters(self._cameras, self._body, self._body.p_E @ X_WE[:3, :3].T + X_WE[:3, 3])

    def _doubt(self, fit: PixelFit, index: np.ndarray, expected: np.ndarray, blobs: np.ndarray) -> str:
        """The first reason why a fitted pose should not be believed, or an empty string."""
        config = self._config
        markers = self._body.p_E[(index >= 0).sum(0) >= 2]
        if len(markers) < MINIMUM_MARKERS or collinear(markers):
            return f"{len(markers)} markers are seen by two cameras, needs {MINIMUM_MARKERS} not on a line"
        if fit.sigma > _LARGEST_RATIO * config.pixel_sigma:
            return f"the pixels scatter by {fit.sigma:.2g} px, {config.pixel_sigma:g} px are expected"
        largest = config.pixel_sigma * np.sqrt(np.diag(fit.cofactor)[3:].max())
        if largest > config.largest_position_sigma:
            return f"the position is uncertain by {1e3 * largest:.2g} mm"
        share = unexplained_share(expected, blobs, self._gate)
        if share > config.largest_unexplained:
            return f"{100 * share:.0f} percent of the blobs about the body belong to no marker"
        return ""

    def _lost(self, X_WE: np.ndarray, reason: str) -> TrackedPose:
        nothing = np.full((len(self._cameras), len(self._body)), -1)
        return TrackedPose(False, X_WE, nothing, reason=reason)


def _check(config: TrackerConfig) -> None:
    for name in config.__dataclass_fields__:
        value = getattr(config, name)
        if not 0.0 < value < np.inf:
            raise ValueError(f"tracker: {name} must be positive, got {value}")
