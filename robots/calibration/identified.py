"""The result of an identification: the robot, its named parameters, and their uncertainties."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robots.calibration.error_model import ErrorModel
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.calibration.reduction import ReducibleModel, Reduction
from robots.calibration.solver.left_over import GravityTest
from robots.calibration.yielding_joints import COMPLIANCE_NAMES
from robots.description.calibration import Calibration
from robots.description.model import NUM_JOINTS, RobotModel
from robots.pose import zyx_from_rotation

_SHOWN = 0.9  # share of what is known that has to come from the data, for a compliance to be named


@dataclass(frozen=True)
class Identified:
    """The outcome of an identification from n rows.

    ``parameters`` are all that there are, redundant; ``names``, ``values`` and ``covariance`` describe the
    same robot by independent ones alone. SI units throughout.
    """

    robot: RobotModel  # the nominal one, in the frame of the instrument
    model: ErrorModel
    measurements: Measurements
    free: np.ndarray  # (f,) indices of the parameters that were free
    parameters: np.ndarray  # (m,) of the error model; then compliances and masses, where these were free
    prior_sizes: np.ndarray  # (m,) standard deviations before the measurement
    free_factor: np.ndarray  # (f, any) F of the covariance F F^T of the free parameters
    residuals: np.ndarray  # (n, 6 or 3) measured less predicted pose: rad, m; rotation first
    noise: MeasurementNoise  # known or estimated
    is_noise_known: bool
    noise_belief: MeasurementNoise | None  # what estimated noise leans on, where the rows hardly tell it
    misfit: float  # size of the residuals in units of the noise: about one where the noise explains them
    gravity: GravityTest | None  # of springs; None where they are parameters, or the rows cannot tell them
    lacks_something: bool  # whether rows that fit together are not explained by these parameters
    design: np.ndarray  # triangle of the whitened derivatives by the free parameters in units of the prior
    outliers: tuple[int, ...]  # the numbers of rows with gross errors
    kept: np.ndarray  # (n,) bool, the rows that were used
    iterations: int
    frame: np.ndarray | None  # (4, 4) world of the robot in the frame of the instrument, None if they are one
    reducible: ReducibleModel

    @cached_property
    def free_covariance(self) -> np.ndarray:
        """Of the free parameters, (f, f); what the data do not show has its prior."""
        return self.free_factor @ self.free_factor.T

    @property
    def x(self) -> np.ndarray:
        """The geometric parameters of the error model, (54,) or (60,)."""
        return self.parameters[: len(self.model)]

    @property
    def compliance(self) -> np.ndarray:
        """Compliances of the joints in rad / (N m), zero where nothing shows them, (6,)."""
        found = np.zeros(NUM_JOINTS)
        if len(self.parameters) > len(self.model):
            found[self._visible] = self.parameters[len(self.model) + self._visible]
        return found

    @cached_property
    def _visible(self) -> np.ndarray:
        """The joints whose compliances the data show, indices."""
        if len(self.parameters) == len(self.model):
            return np.empty(0, dtype=int)
        places = np.searchsorted(self.free, len(self.model) + np.arange(NUM_JOINTS))
        left = np.diagonal(self.free_covariance)[places] / self.prior_sizes[self.free[places]] ** 2
        return np.flatnonzero(1.0 - left > _SHOWN)

    @cached_property
    def reduction(self) -> Reduction:
        """The robot described by independent geometric parameters alone."""
        if len(self.free) < len(self.model) and np.all(self.free < len(self.model)):
            columns = np.eye(len(self.model))[self.free]
            return Reduction(self.free, columns, self.x[self.free])
        return self.reducible.reduce(self.x)

    @property
    def rank(self) -> int:
        """How many geometric parameters the measurements show."""
        return self.reduction.rank

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the independent parameters; compliances as c_1 ... c_6."""
        geometry = tuple(self.model.names[i] for i in self.reduction.independent)
        return (*geometry, *(COMPLIANCE_NAMES[i] for i in self._visible))

    @cached_property
    def values(self) -> np.ndarray:
        """Of the named parameters in m, rad and rad / (N m), shape (n,)."""
        return np.concatenate([self.reduction.values, self.compliance[self._visible]])

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the named parameters in the units of `values`, shape (n, n)."""
        factor = self._named @ self.free_factor
        return factor @ factor.T

    @cached_property
    def _named(self) -> np.ndarray:
        """Named parameters by free ones."""
        geometry = self.free[self.free < len(self.model)]
        T = np.zeros((len(self.names), len(self.free)))
        T[: self.rank, : len(geometry)] = self.reduction.combination[:, geometry]
        for row, joint in enumerate(self._visible, self.rank):
            T[row, np.searchsorted(self.free, len(self.model) + joint)] = 1.0
        return T

    @property
    def sigmas(self) -> np.ndarray:
        """Standard deviations of the values, in their units, shape (n,)."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def correlation(self) -> np.ndarray:
        """Of the values, ones in the diagonal, shape (n, n)."""
        return self.covariance / np.outer(self.sigmas, self.sigmas)

    @cached_property
    def shares(self) -> np.ndarray:
        """Of what is known of each value, the share that is from the data, not the prior: 0 to 1, (n,)."""
        before = self._named**2 @ self.prior_sizes[self.free] ** 2
        return np.clip(1.0 - np.diagonal(self.covariance) / before, 0.0, 1.0)

    @cached_property
    def condition(self) -> float:
        """Condition number of the whitened derivatives by the named parameters, in units of the prior."""
        named = [*self.reduction.independent, *(len(self.model) + self._visible)]
        s = np.linalg.svd(self.design[:, np.searchsorted(self.free, named)], compute_uv=False)
        return float(s[0] / s[-1]) if s[-1] > 0.0 else float("inf")

    def calibrated_robot(self, of: str = "") -> RobotModel:
        """The robot with its true geometry and its compliances, as far as they were found.

        Args:
            of: the robot that was calibrated, as `robots.description.model.load_robot` takes it.
        """
        robot = self.model.robot_with_errors(self.x)
        number = len(self.model) + (NUM_JOINTS if len(self.parameters) > len(self.model) else 0)
        covariance = np.zeros((number, number))
        inside = self.free[self.free < number]
        count = len(inside)
        covariance[np.ix_(inside, inside)] = self.free_covariance[:count, :count]
        names = [*self.model.names, *COMPLIANCE_NAMES][:number]
        calibration = Calibration(
            of,
            self.compliance.tolist(),
            f"identified from {int(self.kept.sum())} measurements, {len(self.names)} parameters",
            names,
            self.parameters[:number].tolist(),
            [row[: i + 1].tolist() for i, row in enumerate(covariance)],
        )
        errors = self.model.joint_errors
        calibration.joint_errors = dict(zip(errors, self.x[-len(errors) :].tolist(), strict=False))
        if self.frame is not None:
            calibration.frame_translation = self.frame[:3, 3].tolist()
            calibration.frame_zyx_deg = np.rad2deg(zyx_from_rotation(self.frame[:3, :3])).tolist()
        return replace(robot, name=f"{self.robot.name}, calibrated", calibration=calibration)
