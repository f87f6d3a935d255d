"""Identifies the geometry of a robot, and how its joints yield, from measured poses or positions.

All 54 parameters of the complete error model are estimated at once, with a prior in the sizes that errors
of robots have; no rank is decided on the way. The noise is known or estimated from the residuals, and rows
with gross errors are found before they can hide each other.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtri

from robots.calibration.error_model import ErrorModel
from robots.calibration.identified import Identified
from robots.calibration.instrument_frame import in_frame_of_instrument
from robots.calibration.loads import Loads
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.calibration.prior import CENTRE_OF_MASS, MASS, not_to_be_believed, parameter_sizes
from robots.calibration.reduction import ReducibleModel
from robots.calibration.solver.left_over import gravity_test, misfit, spring_columns
from robots.calibration.solver.levenberg_marquardt import Fit, minimise
from robots.calibration.solver.noise_belief import BELIEVED, ENOUGH, WEIGHT, taken
from robots.calibration.solver.noise_model import FLOOR, JOINT, POSITION, ROTATION, NoiseModel, row_sigmas
from robots.calibration.solver.problem import Problem
from robots.calibration.solver.robust import CleanRows, lacks_something, least_distances
from robots.calibration.solver.variance_components import (
    VarianceComponents,
    components_to_estimate,
    parameter_factor,
    variance_components,
)
from robots.calibration.yielding_joints import yielding_sizes
from robots.description.model import NUM_JOINTS, RobotModel

_UPRIGHT = 3.0  # deg, as far as the base of a robot may itself be off
_PERFECT = 1e-9  # m or rad, rms of residuals that are rounding
_NO_NOISE = 0.01  # share of the assumed sigma below which residuals are no noise
_PRIOR_FADES = 0.01  # of the rms: then the prior weighs nothing
_ROUNDS = 30
_SETTLED = 0.02  # of its own standard deviation: change of a variance that ends the search
_ROBUST_ROUNDS = 4
_SPRING_SIGMAS = 3.0  # of the prior of compliances: a row that is farther off is no matter of springs
_MOST = 0.5  # share of the rows
_RISK = 1e-4  # that a clean table of known noise is searched for gross errors
_REDUNDANCY_OF_A_POSE = 30  # directions that a robot of six axes has


class IdentificationError(ValueError):
    """The measurements do not determine the parameters, or no parameters explain them."""


@dataclass(frozen=True)
class IdentificationConfig:
    """What is identified, and how."""

    compliance: bool = False  # whether the joints' compliances are identified too
    joint_errors: tuple[str, ...] = ()  # which kinds of errors of joints are: scale, eccentricity, coupling
    fixed: tuple[str, ...] = ()  # names of parameters that stay zero
    noise: MeasurementNoise = field(default_factory=MeasurementNoise)  # estimated if it is not known
    search_outliers: bool = True  # False takes every row as good, which is five times faster
    leave_out_outliers: bool = True  # they are reported in any case
    mass: float = MASS  # relative standard deviation of the masses in the robot file
    centre_of_mass: float = CENTRE_OF_MASS  # m, of the centres of mass


def identify(
    robot: RobotModel, measurements: Measurements, config: IdentificationConfig | None = None
) -> Identified:
    """Finds the errors of a robot.

    Args:
        robot: the nominal robot, with the masses that bend it.
        measurements: poses, or positions only; with one payload or several; in the world of the robot or in
            a frame of the instrument's own.
        config: what to identify.

    Raises:
        IdentificationError: if the measurements are too few or too alike (the message names what they do not
            show), if the search does not converge, or if nothing explains them.
        ValueError: if a fixed parameter is unknown, or the robot is a calibrated one.
    """
    config = config or IdentificationConfig()
    if robot.is_calibrated:
        raise ValueError(
            f"calibration of {robot.name}: it is calibrated already; start from the nominal robot, "
            f"{robot.calibration.of or 'the one that was calibrated'}"
        )
    robot, frame = in_frame_of_instrument(robot, measurements)
    if config.compliance and frame is not None:
        _refuse_tilted(frame)
    problem, reducible = _problem(robot, measurements, config, frame is not None)
    if len(measurements) * problem.width < problem.width + NUM_JOINTS:
        raise IdentificationError(f"{len(measurements)} measurements are too few to identify anything")
    yielding = None
    is_borne = measurements.payload.max() <= robot.payload.largest_mass
    if not config.compliance and _tilt(frame) <= _UPRIGHT and is_borne:
        yielding, _ = _problem(robot, measurements, replace(config, compliance=True), frame is not None)
    return _Search(problem, config, yielding).result(robot, frame, reducible)


def _tilt(frame: np.ndarray | None) -> float:
    """By how many degrees the z axis of an instrument is off the vertical; none where it is the world."""
    return 0.0 if frame is None else float(np.rad2deg(np.arccos(np.clip(frame[2, 2], -1.0, 1.0))))


def _refuse_tilted(frame: np.ndarray) -> None:
    """Raises IdentificationError if the instrument's z is not up: gravity acts along it in what follows."""
    tilt = _tilt(frame)
    if tilt > _UPRIGHT:
        raise IdentificationError(
            f"compliances need measurements in an upright frame, and the z axis of the instrument is "
            f"{tilt:.0f} degrees off the vertical; give the table a column instrument, whose frame is found "
            f"beside the robot, or turn it"
        )


def _problem(
    robot: RobotModel, measurements: Measurements, config: IdentificationConfig, is_own_frame: bool
) -> tuple[Problem, ReducibleModel]:
    model = ErrorModel(robot, config.joint_errors)
    reducible = ReducibleModel(model, measurements.rotation is None)
    sizes, loads, free = parameter_sizes(model.names, is_own_frame), None, np.arange(len(model))
    unknown = [name for name in config.fixed if name not in model.names]
    if unknown:
        raise ValueError(
            f"identification: no parameter is called {unknown[0]}; there are {', '.join(model.names)}"
        )
    if config.fixed:
        # In redundant parameters another would take its place: only independent ones are free then.
        fixed = np.array([model.names.index(name) for name in config.fixed])
        free = np.setdiff1d(reducible.independent_with(fixed), fixed)
    if config.compliance:
        loads = Loads(robot, measurements.payload)
        geometry = len(model)
        sizes = np.concatenate([sizes, yielding_sizes(robot, config.mass, config.centre_of_mass)])
        free = np.concatenate([free, np.arange(geometry, len(sizes))])
    return Problem(model, measurements, sizes, free, loads), reducible


@dataclass(frozen=True)
class _RobustRows:
    """What a search for gross errors leaves."""

    kept: np.ndarray  # (n,) bool
    least: np.ndarray  # (m,) scaled parameters with the least sum of distances
    u: np.ndarray  # (m,) those of the rows that are kept
    theta: np.ndarray  # (3,) variances


class _Search:
    """From a problem to its solution: outliers, noise, parameters."""

    def __init__(
        self, problem: Problem, config: IdentificationConfig, yielding: Problem | None = None
    ) -> None:
        self._problem, self._config = problem, config
        self._yielding = yielding  # the same with compliances, where they can be told
        rows, given = row_sigmas(problem.measurements), config.noise
        self._shape = rows.shape
        self._known = rows.named | given.is_known
        self._theta = np.array([given.joint_sigma, given.position_sigma, given.rotation_sigma]) ** 2
        if not given.is_known:
            self._theta = np.array([0.0, 1e-7, 1e-7])
        else:
            self._theta[[POSITION, ROTATION]] = np.maximum(self._theta[[POSITION, ROTATION]], FLOOR**2)
        self._theta = np.where(rows.named, rows.theta, self._theta)
        self._has_rotation = problem.width == 6
        needed = [POSITION, ROTATION] if self._has_rotation else [POSITION]
        self._is_known = bool(self._known[needed].all())
        self._iterations = 0
        self._lacks_something = False
        self._nominal = problem.linearise(np.zeros(len(problem.columns)))
        belief = self._belief(np.ones(len(problem), dtype=bool))
        self._is_believed = belief is not None  # what noise there is, to begin with
        self._theta = self._theta if belief is None else belief

    def _belief(self, kept: np.ndarray) -> np.ndarray | None:
        """Variances (3,) that noise is believed to have; None where it is known or the rows tell it."""
        numbers = int(kept.sum()) * self._problem.width
        if self._is_known or numbers - len(self._problem.columns) >= ENOUGH:
            return None
        believed = np.where(self._known, self._theta, BELIEVED)
        noise = NoiseModel(believed, self._shape[kept])
        return believed if numbers - taken(self._nominal.select(kept), noise) < ENOUGH else None

    def result(self, robot: RobotModel, frame: np.ndarray | None, reducible: ReducibleModel) -> Identified:
        """Searches. Raises IdentificationError."""
        problem = self._problem
        n = len(problem)
        clean, start, theta = self._clean_rows()
        kept = clean if self._config.leave_out_outliers else np.ones(n, dtype=bool)
        fit, noise, found = self._solve(kept, start, theta)
        if not fit.is_converged:
            self._refuse_what_is_hidden(fit, kept, reducible)  # too few rows are a reason that one can mend
            rms = 1e3 * float(np.sqrt(np.mean(fit.at.residuals[kept, -3:] ** 2)))
            raise IdentificationError(
                f"the identification has not converged after {self._iterations} iterations and leaves "
                f"{rms:.3g} mm"
            )
        if clean.all() or self._config.leave_out_outliers:
            self._refuse_the_implausible(fit.at.residuals[kept], fit.u)
        at, rows, belief = fit.at.select(kept), noise.select(kept), self._belief(kept)
        gravity = None
        if self._yielding is not None:
            gravity = gravity_test(at, fit.u, spring_columns(self._yielding, fit.u)[kept], rows)
        factor = parameter_factor(at, rows, self._estimated(kept), found)
        self._refuse_what_is_hidden(fit, kept, reducible)
        return Identified(
            robot=robot,
            model=problem.model,
            measurements=problem.measurements,
            free=problem.columns,
            parameters=problem.parameters(fit.u),
            prior_sizes=problem.sizes,
            free_factor=problem.sizes[problem.columns, None] * factor,
            residuals=fit.at.residuals,
            noise=noise.as_noise(),
            is_noise_known=self._is_known,
            noise_belief=None if belief is None else NoiseModel(belief, self._shape).as_noise(),
            misfit=misfit(at, rows),
            gravity=gravity,
            lacks_something=self._lacks_something,
            design=at.triangle(rows),
            outliers=tuple(map(int, problem.measurements.rows[~clean])),
            kept=kept,
            iterations=self._iterations,
            frame=frame,
            reducible=reducible,
        )

    def _minimise(
        self, start: np.ndarray, noise: NoiseModel, kept: np.ndarray, is_rough: bool = False
    ) -> Fit:
        fit = minimise(self._problem, start, noise, kept.astype(float), is_rough=is_rough)
        self._iterations += fit.iterations
        return fit

    def _clean_rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The rows without gross errors, (n,) bool, and parameters and variances to begin with."""
        problem = self._problem
        everything = np.ones(len(problem), dtype=bool)
        noise = NoiseModel(self._theta, self._shape)
        fit = self._minimise(np.zeros(len(problem.columns)), noise, everything, is_rough=True)
        if fit.is_converged:
            if self._is_as_expected(fit, noise):
                return everything, fit.u, self._theta
            perfect = None if self._is_believed else self._perfect(fit)
            if perfect is not None:
                return everything, *perfect
        if not self._config.search_outliers:
            return everything, fit.u, self._theta
        rows = self._robust_rows(problem)
        noise = NoiseModel(self._theta, self._shape)
        usable = None if rows.kept.all() else self._explained_by_springs(rows)
        if usable is None:
            usable = lacks_something(problem, noise, rows.least, rows.u, rows.kept)
        if usable is None:
            return rows.kept, rows.u, rows.theta
        self._lacks_something = True
        return usable, rows.least, self._theta

    def _robust_rows(self, problem: Problem) -> _RobustRows:
        """Rows that a problem's parameters explain, in turns with these and with the noise."""
        least, theta = least_distances(problem)
        u = least
        is_given = self._is_known or self._is_believed
        theta = self._theta if is_given else np.where(self._known, self._theta, theta)
        kept = np.ones(len(problem), dtype=bool)
        for turn in range(_ROBUST_ROUNDS):
            noise = NoiseModel(theta, self._shape)
            at = problem.linearise(u)
            rows = CleanRows(at, u, noise, WEIGHT if self._is_believed else 0.0)
            if not rows.num_directions:
                self._refuse_the_implausible(at.residuals, u)
                break
            clean = rows.find(np.random.default_rng(turn))
            if turn and np.array_equal(clean, kept):
                break
            kept = clean
            fit = minimise(problem, u, noise, kept.astype(float))
            self._iterations += fit.iterations
            u = fit.u
            if not self._is_known:
                at = problem.linearise(u).select(kept)
                estimated, belief = self._estimated(kept), self._belief(kept)
                theta = variance_components(at, u, noise.select(kept), estimated, belief).theta
        return _RobustRows(kept, least, u, theta)

    def _explained_by_springs(self, rows: _RobustRows) -> np.ndarray | None:
        """The rows that joints which yield explain, if these are most of those that stiff ones do not.

        A few rows at the corners of the ranges may be all that shows springs; together they miss by far, as
        gross errors do, but torques of gravity explain them.
        """
        if self._yielding is None:
            return None
        problem = self._yielding
        reach = _SPRING_SIGMAS * np.linalg.norm(spring_columns(problem, rows.u)[:, -3:], axis=(1, 2))
        missed = np.linalg.norm(self._problem.residuals(rows.u)[:, -3:], axis=1)
        if np.mean((missed < reach)[~rows.kept]) <= _MOST:
            return None
        kept = self._robust_rows(problem).kept
        return kept if np.mean(kept[~rows.kept]) > _MOST else None

    def _is_as_expected(self, fit: Fit, noise: NoiseModel) -> bool:
        """Whether residuals are what known noise makes them: then no row needs to be tested."""
        e = fit.at.residuals
        if not (self._is_known or self._is_believed):
            return False
        squares = np.sum(np.einsum("nij,nj->ni", noise.whitening(fit.at.J), e) ** 2, axis=1)
        n, k = e.shape
        total = squares.sum() <= chdtri(max(n * k - _REDUNDANCY_OF_A_POSE, k), 0.05)
        return bool(total and squares.max() <= chdtri(k, _RISK / n))

    def _perfect(self, fit: Fit) -> tuple[np.ndarray, np.ndarray] | None:
        """Parameters and variances where all rows fit to rounding: there are no noise and no gross errors."""
        everything = np.ones(len(self._problem), dtype=bool)
        theta = self._theta
        for _ in range(4):
            rms = float(np.sqrt(np.mean(fit.at.residuals**2)))
            if rms < _PERFECT:
                return fit.u, theta
            if self._is_known or rms > _NO_NOISE * np.sqrt(theta[POSITION]):
                return None
            noise = self._without_noise(rms)
            theta = noise.theta
            fit = self._minimise(fit.u, noise, everything)
        return None

    def _without_noise(self, rms: float) -> NoiseModel:
        """Noise so small that the prior weighs nothing."""
        theta = np.array([0.0, 1.0, 1.0]) * max(_PRIOR_FADES * rms, FLOOR) ** 2
        return NoiseModel(theta, np.ones_like(self._shape))

    def _estimated(self, kept: np.ndarray) -> list[int]:
        redundancy = int(kept.sum()) * self._problem.width - _REDUNDANCY_OF_A_POSE
        return components_to_estimate(self._known, self._has_rotation, redundancy)

    def _solve(
        self, kept: np.ndarray, start: np.ndarray, theta: np.ndarray
    ) -> tuple[Fit, NoiseModel, VarianceComponents | None]:
        """Parameters and noise, in turns until both stand still."""
        noise, found = NoiseModel(theta, self._shape), None
        fit = self._minimise(start, noise, kept, is_rough=not self._is_known)
        if self._is_known:
            return fit, noise, None
        estimated, before, belief = self._estimated(kept), np.inf, self._belief(kept)
        for _ in range(_ROUNDS):
            theta = noise.theta.copy()
            if theta[POSITION] * self._shape[:, POSITION].max() <= 1.01 * FLOOR**2:
                break  # down to rounding
            rms = float(np.sqrt(np.mean(fit.at.residuals[kept] ** 2)))
            is_settled = False
            if belief is None and rms < _PERFECT and noise.theta[JOINT] == 0.0 and rms > 0.5 * before:
                break  # the prior weighs nothing any more, and what is left is rounding
            before = rms
            if belief is None and (rms < _PERFECT or rms < _NO_NOISE * np.sqrt(theta[POSITION])):
                theta = np.array([0.0, 1.0, 1.0]) * max(_PRIOR_FADES * rms, FLOOR) ** 2
            else:
                if theta[JOINT] == 0.0 and JOINT in estimated:
                    theta[JOINT] = 0.01 * theta[POSITION]
                at = fit.at.select(kept)
                rows = NoiseModel(theta, self._shape[kept])
                found = variance_components(at, fit.u, rows, estimated, belief)
                change = np.abs(found.theta - theta)[estimated]
                is_settled = bool(np.all(change < _SETTLED * np.sqrt(np.diag(found.covariance))))
                theta = found.theta
            noise = noise.with_variances(theta)
            fit = self._minimise(fit.u, noise, kept, is_rough=not is_settled)
            if is_settled:
                break
        else:
            fit = replace(fit, is_converged=False)
        return fit, noise, found

    def _refuse_the_implausible(self, residuals: np.ndarray, u: np.ndarray) -> None:
        model, x = self._problem.model, self._problem.parameters(u)
        distances, angles = (np.linalg.norm(e, axis=1) for e in (residuals[:, -3:], residuals[:, :-3]))
        why = not_to_be_believed(model.names, x[: len(model)], distances, angles)
        if why:
            raise IdentificationError(
                f"no geometry near that of {model.robot.name} explains the measurements: {why}"
            )

    def _refuse_what_is_hidden(self, fit: Fit, kept: np.ndarray, reducible: ReducibleModel) -> None:
        """Names what the robot's ranges would show and these rows do not."""
        geometry = self._problem.columns < len(self._problem.model)
        x = self._problem.parameters(fit.u)[: len(self._problem.model)]
        columns = self._problem.columns[geometry]
        A = fit.at.A[kept][:, :, geometry].reshape(-1, len(columns)) / self._problem.sizes[columns]
        hidden = reducible.hidden(A, columns, x)
        if hidden:
            raise IdentificationError(
                f"{int(kept.sum())} measurements do not determine {', '.join(hidden)}; "
                f"measure at more, and at more different configurations, or fix these parameters"
            )
