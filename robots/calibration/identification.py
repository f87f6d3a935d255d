"""Identifies geometric errors and joint compliances from measured poses.

Probst (2024), section 4.1: scaled Gauss-Newton with a step size, eq. (4.8), on the exact nonlinear model;
here with whitened residuals where the noise is known, with compliances, and with a search for outliers.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from robots.calibration.identifiability import identifiable_parameters, unseen_parameters
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.description.error_parameters import NUM_PARAMETERS
from robots.description.model import NUM_JOINTS, Calibration, RobotModel
from robots.dynamics.compliant_kinematics import CompliantKinematics
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.pose import pose_error

_MOST_ITERATIONS = 30
_CONVERGED = 1e-14  # of a step in scaled parameters, m or rad at the tool
_SHORTEST_STEP = 1.0 / 64.0
_INDISTINGUISHABLE = 1e-3  # share of a compliance's effect that geometric errors cannot imitate
_OUTLIER_PROBABILITY = 1e-4  # of a good row to be taken for an outlier
_BENEFIT_OF_DOUBT = 3.0  # times as far as noise may lead, where the noise is not known
_OUTLIER_ROUNDS = 6


class IdentificationError(ValueError):
    """The measurements do not determine the parameters."""


@dataclass(frozen=True)
class IdentificationConfig:
    """What is identified, and how."""

    compliance: bool = False  # whether the joints' compliances are identified too
    fixed: tuple[str, ...] = ()  # names of parameters that stay zero
    noise: MeasurementNoise = field(default_factory=MeasurementNoise)  # whitens residuals if it is known
    leave_out_outliers: bool = True  # they are reported in any case


@dataclass(frozen=True)
class Identified:
    """The outcome of an identification, m parameters from n rows."""

    robot: RobotModel  # the nominal one
    p: np.ndarray  # (48,) m and rad; dependent and fixed parameters are zero
    compliance: np.ndarray  # (6,) rad / (N m), zero where not identified
    names: tuple[str, ...]  # (m,) of the identified parameters, compliances as c_1 ... c_6
    values: np.ndarray  # (m,) m, rad, rad / (N m)
    covariance: np.ndarray  # (m, m)
    residuals: np.ndarray  # (n, 6 or 3) measured less predicted pose: rad, m; rotation first
    outliers: tuple[int, ...]  # the numbers of their rows
    iterations: int

    @property
    def sigmas(self) -> np.ndarray:
        """Standard deviations of the values, (m,)."""
        return np.sqrt(np.diagonal(self.covariance))

    def calibrated_robot(self, of: str = "") -> RobotModel:
        """The robot with its true geometry and its compliances, as far as they were found.

        Args:
            of: the robot that was calibrated, as `robots.description.model.load_robot` takes it.
        """
        robot = ErrorKinematics(self.robot).robot_with_errors(self.p)
        source = f"identified from {len(self.residuals)} measurements, {len(self.names)} parameters"
        calibration = Calibration(of, self.compliance.tolist(), source)
        return replace(robot, name=f"{self.robot.name}, calibrated", calibration=calibration)


def identify(
    robot: RobotModel, measurements: Measurements, config: IdentificationConfig | None = None
) -> Identified:
    """Finds the errors of a robot.

    Args:
        robot: the nominal robot, with the masses that bend it.
        measurements: poses, or positions only; with one payload or several.
        config: what to identify.

    Raises:
        IdentificationError: if the measurements are too few or too alike; the message names the parameters
            that cannot be seen.
        ValueError: if a fixed parameter is unknown.
    """
    config = config or IdentificationConfig()
    problem = _Problem(robot, measurements, config)
    kept = problem.first_kept()
    for _ in range(_OUTLIER_ROUNDS):
        solution = problem.solve(kept)
        now_kept = problem.plausible(solution, kept)
        if not config.leave_out_outliers or np.array_equal(now_kept, kept):
            break
        kept = now_kept
    outliers = measurements.rows[~problem.plausible(solution, kept)]
    return replace(solution, outliers=tuple(map(int, outliers)))


class _Problem:
    """The measurements with the parameters that are to explain them."""

    def __init__(self, robot: RobotModel, measurements: Measurements, config: IdentificationConfig) -> None:
        self._robot, self._measurements, self._config = robot, measurements, config
        self._model = ErrorKinematics(robot)
        self._is_position_only = measurements.rotation is None
        self._rows = slice(3, 6) if self._is_position_only else slice(0, 6)
        found = identifiable_parameters(robot, self._is_position_only)
        unknown = [name for name in config.fixed if name not in found.names]
        if unknown:
            raise ValueError(f"identification: no parameter is called {unknown[0]}")
        self._indices = np.array([i for i in found.independent if found.names[i] not in config.fixed])
        self._names = [found.names[i] for i in self._indices]
        self._joints = self._visible_compliances() if config.compliance else np.empty(0, dtype=int)
        self._all_names = (*self._names, *(f"c_{joint + 1}" for joint in self._joints))
        self._X_measured = measurements.X_WE

    def solve(self, kept: np.ndarray) -> Identified:
        """Gauss-Newton from zero on some of the rows."""
        x = np.zeros(len(self._all_names))
        residuals, Theta, weights = self._evaluate(x)
        self._refuse_if_unseen(Theta[kept])
        cost = _cost(residuals, weights, kept)
        iterations = 0
        while iterations < _MOST_ITERATIONS:
            iterations += 1
            A = (weights[kept] @ Theta[kept]).reshape(-1, len(x))
            b = np.einsum("nij,nj->ni", weights[kept], residuals[kept]).ravel()
            scale = np.abs(A).max(axis=0)
            step = np.linalg.lstsq(A / scale, b, rcond=None)[0]
            size = 1.0
            while True:
                candidate = x + size * step / scale
                found = self._evaluate(candidate)
                candidate_cost = _cost(found[0], found[2], kept)
                # Near the minimum the cost is all rounding, and a full step is right.
                if candidate_cost <= cost * (1.0 + 1e-9) + 1e-28 or size <= _SHORTEST_STEP:
                    break
                size *= 0.5
            x, (residuals, Theta, weights), cost = candidate, found, candidate_cost
            if np.abs(step).max() < _CONVERGED * max(1.0, np.abs(weights).max()):
                break
        return self._identified(x, residuals, Theta, weights, kept, iterations)

    def first_kept(self) -> np.ndarray:
        """The rows that are not far beyond the others in their distance from the nominal robot, (n,) bool."""
        residuals, _, weights = self._evaluate(np.zeros(len(self._all_names)))
        distance = np.linalg.norm(np.einsum("nij,nj->ni", weights, residuals), axis=1)
        return distance <= 6.0 * max(float(np.median(distance)), 1e-9)

    def plausible(self, solution: Identified, kept: np.ndarray) -> np.ndarray:
        """The rows whose residuals a normal noise of the found spread explains, (n,) bool."""
        _, _, weights = self._evaluate(solution.values)
        whitened = np.einsum("nij,nj->ni", weights, solution.residuals)
        squared = np.sum(whitened**2, axis=1)
        width = whitened.shape[1]
        # The median is not moved by the outliers that are looked for.
        spread = np.median(squared[kept]) / chi2.median(width)
        largest = chi2.isf(_OUTLIER_PROBABILITY, width)
        if self._config.noise.is_known:
            return squared <= largest * max(spread, 1.0)
        # What the model lacks is not normal: without knowledge of the noise only the absurd is an outlier.
        rounding = (1e-9 * np.abs(weights).max()) ** 2
        return squared <= _BENEFIT_OF_DOUBT**2 * largest * max(spread, rounding)

    def _refuse_if_unseen(self, Theta: np.ndarray) -> None:
        rows = Theta.reshape(-1, Theta.shape[-1])
        unseen = unseen_parameters(rows, list(self._all_names))
        if unseen:
            raise IdentificationError(
                f"{len(Theta)} measurements do not determine {', '.join(unseen)}; "
                f"measure at more, and at more different configurations, or fix these parameters"
            )

    def _visible_compliances(self) -> np.ndarray:
        """The joints whose compliance geometric errors cannot imitate at these configurations."""
        zero = np.zeros(NUM_PARAMETERS)
        Theta = self._model.regressor(self._measurements.q, zero)[:, self._rows]
        geometric = Theta[..., self._indices].reshape(-1, len(self._indices))
        columns = self._compliance_columns(Theta[..., :NUM_JOINTS], self._measurements.q, zero)
        columns = columns.reshape(-1, NUM_JOINTS)
        basis = np.linalg.qr(geometric / np.abs(geometric).max(axis=0))[0]
        found = []
        for joint, column in enumerate(columns.T):
            rest = column - basis @ (basis.T @ column)
            rest -= basis @ (basis.T @ rest)
            size = float(np.linalg.norm(column))
            if size > 1e-9 and np.linalg.norm(rest) > _INDISTINGUISHABLE * size:
                found.append(joint)
                basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
        return np.array(found, dtype=int)

    def _compliance_columns(self, J: np.ndarray, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        torque = np.empty_like(q)
        wrong = self._model.robot_with_errors(p)
        for payload in np.unique(self._measurements.payload):
            rows = self._measurements.payload == payload
            torque[rows] = CompliantKinematics(wrong, float(payload)).gravity_torque(q[rows])
        return J * torque[:, None, :]

    def _evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals (n, k), regressors (n, k, m) and whitening matrices (n, k, k) at x."""
        geometry = len(self._indices)
        p, compliance = np.zeros(NUM_PARAMETERS), np.zeros(NUM_JOINTS)
        p[self._indices], compliance[self._joints] = x[:geometry], x[geometry:]
        q = self._measurements.q
        if len(self._joints):
            wrong = replace(
                self._model.robot_with_errors(p), calibration=Calibration("", compliance.tolist())
            )
            q = q.copy()
            for payload in np.unique(self._measurements.payload):
                rows = self._measurements.payload == payload
                q[rows] = CompliantKinematics(wrong, float(payload)).link_positions(q[rows])
        X, Theta = self._model.forward_and_regressor(q, p)
        if self._is_position_only:
            residuals = self._X_measured[:, :3, 3] - X[:, :3, 3]
        else:
            residuals = pose_error(self._X_measured, X)
        Theta = Theta[:, self._rows]
        columns = [Theta[..., self._indices]]
        if len(self._joints):
            by_compliance = self._compliance_columns(Theta[..., :NUM_JOINTS], q, p)
            columns.append(by_compliance[..., self._joints])
        return residuals, np.concatenate(columns, axis=-1), self._whitening(Theta[..., :NUM_JOINTS])

    def _whitening(self, J: np.ndarray) -> np.ndarray:
        """Matrices that make the noise of every row white; joint noise reaches the tool through J."""
        noise, width = self._config.noise, J.shape[1]
        if not noise.is_known:
            return np.broadcast_to(np.eye(width), (len(J), width, width))
        sigmas = np.repeat([noise.rotation_sigma, noise.position_sigma], 3)[self._rows]
        covariance = noise.joint_sigma**2 * J @ np.swapaxes(J, -1, -2) + np.diag(sigmas**2)
        return np.linalg.inv(np.linalg.cholesky(covariance))

    def _identified(
        self,
        x: np.ndarray,
        residuals: np.ndarray,
        Theta: np.ndarray,
        weights: np.ndarray,
        kept: np.ndarray,
        iterations: int,
    ) -> Identified:
        A = (weights[kept] @ Theta[kept]).reshape(-1, len(x))
        scale = np.abs(A).max(axis=0)
        scaled = np.linalg.inv((A / scale).T @ (A / scale))
        freedom = max(1, A.shape[0] - len(x))
        variance = 1.0 if self._config.noise.is_known else 2.0 * _cost(residuals, weights, kept) / freedom
        geometry = len(self._indices)
        p, compliance = np.zeros(NUM_PARAMETERS), np.zeros(NUM_JOINTS)
        p[self._indices], compliance[self._joints] = x[:geometry], x[geometry:]
        return Identified(
            robot=self._robot,
            p=p,
            compliance=compliance,
            names=self._all_names,
            values=x,
            covariance=variance * scaled / np.outer(scale, scale),
            residuals=residuals,
            outliers=(),
            iterations=iterations,
        )


def _cost(residuals: np.ndarray, weights: np.ndarray, kept: np.ndarray) -> float:
    whitened = np.einsum("nij,nj->ni", weights[kept], residuals[kept])
    return 0.5 * float(np.sum(whitened**2))
