"""One adjustment of a robot, of the targets on its tool and of the instruments that saw them."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from robots.calibration.error_model import ErrorModel
from robots.calibration.identification import IdentificationError
from robots.calibration.instrument_frame import instrument_frame
from robots.calibration.instruments.noise import JOINT, InstrumentNoise, instrument_noise
from robots.calibration.instruments.observations import MeasuringCell, Observations
from robots.calibration.instruments.problem import InstrumentProblem, Setting, Start
from robots.calibration.prior import not_to_be_believed
from robots.calibration.solver.left_over import GravityTest, gravity_test, spring_columns
from robots.calibration.solver.levenberg_marquardt import Fit, minimise
from robots.calibration.solver.noise_belief import BELIEVED, ENOUGH, taken
from robots.calibration.solver.noise_model import FLOOR, POSITION
from robots.calibration.solver.variance_components import parameter_factor, variance_components
from robots.calibration.yielding_joints import COMPLIANCE_NAMES
from robots.configuration.suggestion import did_you_mean
from robots.description.calibration import Calibration
from robots.description.model import RobotModel
from robots.metrology.least_squares import UndeterminedError

_FIRST_SIGMA = 3e-4  # m, of an instrument of which nothing is known, to begin with
_BELIEVED = float(np.sqrt(BELIEVED[POSITION]))  # m, of such a one where lines are too few to tell it
_L1_ROUNDS, _NEAREST = 8, 0.3  # of the median residual: no line weighs more than one at that distance
_SLIP = 10.0, 1.0  # medians and m, beyond which a line is left out until the others are explained
_LONG = 5.0  # medians, beyond which a distance says nothing of where its anchor is
_RISK = 1e-3  # that a clean table loses a line
_MANY = 10  # numbers per parameter, from which a bad line cannot hide in a fit
_SEARCHES = 8
_ROUNDS, _SETTLED = 20, 0.02  # of its own standard deviation: change of a variance that ends the search
_NO_NOISE, _PRIOR_FADES, _ROUNDING = 0.01, 0.01, 1e-9
_ENOUGH_FOR_JOINTS = (
    90  # redundant numbers, below which noise of the joints looks like that of the instrument
)
_EVERYWHERE = -1.0  # m: every frame is one of its own


@dataclass(frozen=True)
class InstrumentCalibration:
    """The outcome of an adjustment."""

    robot: RobotModel  # the nominal one
    model: ErrorModel
    observations: Observations
    names: tuple[str, ...]  # of the free parameters
    values: np.ndarray  # (f,) m, rad
    covariance: np.ndarray  # (f, f)
    shares: np.ndarray  # (f,) of what is known of each, how much comes from the data: 0 to 1
    x: np.ndarray  # parameters of the error model
    compliance: np.ndarray  # (6,) of the joints in rad / (N m), zeros if they are taken as stiff
    setting: Setting  # targets, frames and anchors
    nominal_setting: Setting  # those with which the nominal robot fits best
    before: np.ndarray  # (m, 3) m, measured less predicted by it, NaN where nothing was
    residuals: np.ndarray  # (m, 3) m, with the calibrated one
    noise: np.ndarray  # standard deviations: of the joints in rad, of every instrument in m
    is_noise_believed: bool  # whether it leans on what is usual, as the lines hardly tell it
    used: np.ndarray  # (m,) bool
    rank: int  # directions that the data show better than what was known before
    condition: float  # of these directions, in units of what was known before
    standardised: np.ndarray  # (any,) residuals of the lines used, made white and of unit size by the noise
    gravity: GravityTest | None  # of compliances that were not sought; None if they were or cannot be
    spread: float  # their standard deviation where the noise is right: a fit makes it less than one
    iterations: int

    @property
    def outliers(self) -> tuple[int, ...]:
        """The lines with gross errors."""
        return tuple(map(int, self.observations.lines[~self.used]))

    @property
    def correlation(self) -> np.ndarray:
        """Of the free parameters, (f, f)."""
        sigmas = np.sqrt(np.diagonal(self.covariance))
        return self.covariance / np.outer(sigmas, sigmas)

    def calibrated_robot(self, of: str = "") -> RobotModel:
        """The robot as it is, in its own world; ``of`` is the one that was calibrated."""
        robot = self.model.robot_with_errors(self.x)
        instruments = ", ".join(self.observations.instruments)
        known = (*self.model.names, *COMPLIANCE_NAMES)
        inside = [k for k, name in enumerate(self.names) if name in known]
        covariance = self.covariance[np.ix_(inside, inside)]
        errors = self.model.joint_errors
        calibration = Calibration(
            of,
            self.compliance.tolist(),
            source=f"identified from {int(self.used.sum())} lines of {instruments}",
            names=[self.names[k] for k in inside],
            values=self.values[inside].tolist(),
            covariance=[row[: i + 1].tolist() for i, row in enumerate(covariance)],
            joint_errors=dict(zip(errors, self.x[len(self.x) - len(errors) :].tolist(), strict=True)),
        )
        return replace(robot, name=f"{self.robot.name}, calibrated", calibration=calibration)


def identify_with_instruments(
    robot: RobotModel,
    observations: Observations,
    cell: MeasuringCell | None = None,
    joint_errors: tuple[str, ...] = (),
    compliance: bool = False,
    fixed: Collection[str] = (),
) -> InstrumentCalibration:
    """Finds the errors of a robot, the unknown targets, frames and anchors, and the noise.

    Args:
        robot: the nominal robot.
        observations: lines of all instruments.
        cell: what is known before.
        joint_errors: kinds of `robots.description.joint_errors` that are parameters, too.
        compliance: whether the joints yield to the robot's weight and its loads; their compliances are found.
        fixed: names of parameters that stay zero; what of the robot would take their places stays so, too.

    Raises:
        ValueError: if a fixed parameter is unknown.
        IdentificationError: if nothing says where an instrument stands, or the search does not converge.
    """
    if robot.is_calibrated:
        raise IdentificationError(
            f"calibration of {robot.name}: it is calibrated already; start from the nominal robot"
        )
    cell = cell or MeasuringCell({}, {}, {}, {})
    model = ErrorModel(robot, joint_errors)
    start = _start(model, observations, cell)
    problem = InstrumentProblem(model, observations, cell, start, compliance, fixed)
    yielding = None
    if not compliance and observations.loads.max() <= robot.payload.largest_mass:
        yielding = InstrumentProblem(model, observations, cell, start, True, fixed)
    return _Adjustment(problem, cell, yielding).result(robot)


def _start(model: ErrorModel, seen: Observations, cell: MeasuringCell) -> Start:
    """Frames by rigid registration of the nominal robot, targets at the tool, anchors by their distances."""
    X = model.forward(seen.q, np.zeros(len(model)))
    places = np.array([cell.places.get(name, np.zeros(3)) for name in seen.targets])
    p = np.einsum("mij,mj->mi", X[seen.row, :3, :3], places[seen.target]) + X[seen.row, :3, 3]
    frames, anchors = np.tile(np.eye(4), (len(seen.instruments), 1, 1)), np.zeros((len(seen.instruments), 3))
    for i, name in enumerate(seen.instruments):
        lines = np.flatnonzero(seen.instrument == i)
        if seen.is_bar(i):
            anchors[i] = (
                cell.anchors[name] if name in cell.anchors else _anchor(p[lines], seen.distance[lines])
            )
        elif name in cell.frames:
            frames[i] = cell.frames[name]
        else:
            whole = lines[np.isfinite(seen.position[lines]).all(axis=1)]
            try:
                found = instrument_frame(p[whole], seen.position[whole], _EVERYWHERE, 0.0)
            except (UndeterminedError, ValueError) as error:
                others = [other for other in seen.instruments if other != name]
                raise IdentificationError(
                    f"instrument {name}: nothing says where it stands: {error}{did_you_mean(name, others)}"
                ) from error
            assert found is not None
            frames[i] = found
    return Start(places, frames, anchors)


def _anchor(p: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """The point from which points (n, 3) have these distances (n,), by differences of their squares, m."""
    kept = distance <= _LONG * np.median(distance)
    p, distance = p[kept], distance[kept]
    A = 2.0 * (p - p.mean(axis=0))
    squares = np.sum(p**2, axis=1) - distance**2
    return np.linalg.lstsq(A, squares - squares.mean(), rcond=None)[0]


def _said(seen: Observations, instrument: int, known: float | None) -> tuple[float, bool]:
    """How noisy an instrument is in m, zero if nobody says it, and whether that is all there is to know.

    Its lines say it (then it is the root of their mean square), or the cell does, ``known``. Where only some
    lines say it, the others are as noisy as these to begin with.
    """
    sigmas = seen.sigma[seen.instrument == instrument]
    says = np.isfinite(sigmas)
    if known is not None and not says.all():
        return known, True
    return (float(np.sqrt(np.mean(sigmas[says] ** 2))) if says.any() else 0.0), bool(says.all())


class _Adjustment:
    """From a problem to its solution."""

    def __init__(
        self, problem: InstrumentProblem, cell: MeasuringCell, yielding: InstrumentProblem | None = None
    ) -> None:
        self._yielding = yielding  # the same with compliances, where they were not sought
        self._problem, self._everything, self._iterations = problem, problem.active, 0
        seen = problem.observations
        given = [_said(seen, i, cell.sigmas.get(name)) for i, name in enumerate(seen.instruments)]
        self._estimated = [1 + i for i, (_, is_known) in enumerate(given) if not is_known]
        self._theta, self._believed = (
            np.array([cell.joint_sigma or 0.0, *(sigma or usual for sigma, _ in given)]) ** 2
            for usual in (_FIRST_SIGMA, _BELIEVED)
        )
        if self._belief() is not None:
            self._theta = self._believed
        redundancy = int(self._everything.sum()) - len(problem.columns)
        if cell.joint_sigma is None and self._estimated and redundancy >= _ENOUGH_FOR_JOINTS:
            self._estimated.insert(0, JOINT)

    def _belief(self) -> np.ndarray | None:
        """Variances that noise is believed to have; None where it is known or the active lines tell it."""
        problem = self._problem
        numbers = int(problem.active.sum())
        if not self._estimated or numbers - len(problem.columns) >= ENOUGH:
            return None
        noise = instrument_noise(problem, self._believed, problem.active)
        at = problem.linearise(np.zeros(len(problem.columns)))
        return self._believed if numbers - taken(at, noise) < ENOUGH else None

    def result(self, robot: RobotModel) -> InstrumentCalibration:
        """Searches. Raises IdentificationError."""
        problem = self._problem
        u, used = self._clean_lines()
        self._refuse_the_implausible(u)
        fit, noise, found, is_believed = self._solve(u, used)
        if not fit.is_converged:
            rms = 1e3 * float(np.sqrt(np.mean(fit.at.residuals**2)))
            raise IdentificationError(
                f"the adjustment has not converged after {self._iterations} iterations and leaves "
                f"{rms:.3g} mm"
            )
        self._refuse_the_implausible(fit.u)
        factor = parameter_factor(fit.at, noise, self._estimated, found)
        sizes = problem.sizes[problem.columns]
        covariance = sizes[:, None] * (factor @ factor.T) * sizes
        W = noise.whitening(fit.at.J)
        s = np.linalg.svd(np.linalg.qr((W @ fit.at.A).reshape(-1, len(sizes)), mode="r"), compute_uv=False)
        rank = int(np.sum(s > 1.0))
        white = np.einsum("nij,nj->ni", W, fit.at.residuals)[noise.instrument >= 0]
        gravity = self._gravity(fit, noise)
        problem.active = self._everything
        values = problem.parameters(fit.u)
        seen = self._everything
        found_by_name = dict(zip(problem.names, values.tolist(), strict=True))
        nominal = self._around_nominal(noise, used)
        before = problem.gathered(problem.residuals(nominal[problem.columns] / sizes))
        return InstrumentCalibration(
            robot=robot,
            model=problem.model,
            observations=problem.observations,
            names=tuple(problem.names[k] for k in problem.columns),
            values=values[problem.columns],
            covariance=covariance,
            shares=np.clip(1.0 - np.diagonal(covariance) / sizes**2, 0.0, 1.0),
            x=values[: len(problem.model)],
            compliance=np.array([found_by_name.get(name, 0.0) for name in COMPLIANCE_NAMES]),
            setting=problem.setting(values),
            nominal_setting=problem.setting(nominal),
            before=np.where(seen, before, np.nan),
            residuals=np.where(seen, problem.gathered(problem.residuals(fit.u)), np.nan),
            noise=np.sqrt(noise.theta),
            is_noise_believed=is_believed,
            used=used,
            rank=rank,
            condition=float(s[0] / s[rank - 1]) if rank else float("inf"),
            standardised=white,
            gravity=gravity,
            spread=float(np.sqrt(max(1.0 - np.sum(s**2 / (1.0 + s**2)) / max(white.size, 1), 0.0))),
            iterations=self._iterations,
        )

    def _gravity(self, fit: Fit, noise: InstrumentNoise) -> GravityTest | None:
        """Whether the lines that are active follow the weight; None where that cannot be told."""
        if self._yielding is None:
            return None
        active = self._yielding.active = self._problem.active
        springs = spring_columns(self._yielding, fit.u)
        return gravity_test(fit.at, fit.u, springs, noise, self._problem.spread(active) > 0.0)

    def _refuse_the_implausible(self, u: np.ndarray) -> None:
        """Names the instrument whose lines fit worst if what was found is not the robot."""
        model, x = self._problem.model, self._problem.parameters(u)
        seen, distances = self._problem.observations, self._sizes(u, np.ones((1, 1)))
        worst = int(np.argmax(self._medians(distances)))
        why = not_to_be_believed(model.names, x[: len(model)], distances[seen.instrument == worst])
        if why:
            raise IdentificationError(
                f"no geometry near that of {model.robot.name} explains the lines of "
                f"{seen.instruments[worst]}: {why}"
            )

    def _around_nominal(self, noise: InstrumentNoise, used: np.ndarray) -> np.ndarray:
        """All parameters with which the nominal robot fits best: targets, frames and anchors, in SI units."""
        problem, free = self._problem, self._problem.columns
        problem.active = self._everything & used[:, None]
        problem.columns = free[~problem.is_of_robot[free]]
        start, weights = np.zeros(len(problem.columns)), np.ones(len(problem))
        fit = minimise(problem, start, noise, weights, is_rough=True) if len(start) else None
        nominal = problem.parameters(fit.u if fit else start)
        problem.columns, problem.active = free, self._everything
        return nominal

    def _fit(self, u: np.ndarray, noise: InstrumentNoise, is_rough: bool = False) -> Fit:
        fit = minimise(self._problem, u, noise, np.ones(len(self._problem)), is_rough=is_rough)
        self._iterations += fit.iterations
        return fit

    def _clean_lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Parameters to begin with, and the lines without gross errors, (m,) bool.

        The least sum of distances, by weights that fall with the residual, is not moved by a few bad lines;
        then lines are left out that are farther off than the others explain, until nothing changes. What is
        metres off to begin with, such as a number that lost its decimal point, would move even that.
        """
        problem = self._problem
        noise = instrument_noise(problem, self._theta, self._everything)
        start = np.zeros(len(problem.columns))
        size = self._sizes(start, np.ones((1, 1)))
        usual = self._medians(size)[problem.observations.instrument]
        problem.active = self._everything & (size <= np.maximum(_SLIP[0] * usual, _SLIP[1]))[:, None]
        u = self._fit(start, instrument_noise(problem, self._theta, problem.active), is_rough=True).u
        scale = problem.gathered(np.sqrt(noise.shape * np.append(noise.theta[1:], 1.0)[noise.instrument]))
        is_believed = self._belief() is not None
        is_long = self._everything.sum() > _MANY * len(problem.columns)
        for _ in range(0 if is_long else _L1_ROUNDS):
            size = self._sizes(u, scale)
            weight = np.maximum(size / self._medians(size)[problem.observations.instrument], _NEAREST)
            softer = replace(noise, shape=noise.shape * problem.spread(np.tile(weight[:, None], (1, 3))))
            padded = softer.instrument < 0
            softer = replace(softer, shape=np.where(padded, 1.0, softer.shape))
            u = minimise(problem, u, softer, np.ones(len(problem)), most=1, is_rough=True).u
        used = np.ones(len(problem.observations), dtype=bool)
        count = self._everything.sum(axis=1)
        for _ in range(_SEARCHES):
            size = self._sizes(u, scale)
            typical = self._medians(np.where(used, size, np.nan))[problem.observations.instrument]
            if is_believed:  # a fit through few lines leaves less of them than their noise
                typical = np.maximum(typical, np.sqrt(chdtri(count, 0.5)))
            limit = np.sqrt(chdtri(count, _RISK / len(size)) / chdtri(count, 0.5))
            now = size <= np.maximum(2.0 * limit * typical, 1e-5 / scale[:, 0])
            problem.active = self._everything & now[:, None]
            if np.array_equal(now, used):
                break
            used = now
            u = self._fit(u, instrument_noise(problem, self._theta, problem.active), is_rough=True).u
        return u, used

    def _sizes(self, u: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Lengths of the residuals of all lines in units of a scale in m, (m, 1) or (1, 1): (m,)."""
        active, self._problem.active = self._problem.active, self._everything
        e = self._problem.gathered(self._problem.residuals(u)) / scale
        self._problem.active = active
        return np.sqrt(np.sum(e**2, axis=1))

    def _medians(self, size: np.ndarray) -> np.ndarray:
        """Of every instrument's lines."""
        which = self._problem.observations.instrument
        return np.array([max(np.nanmedian(size[which == i]), 1e-12) for i in range(which.max() + 1)])

    def _solve(self, u: np.ndarray, used: np.ndarray):
        """Parameters and noise in turns, until both stand still."""
        problem = self._problem
        problem.active = self._everything & used[:, None]
        noise, found, before = instrument_noise(problem, self._theta, problem.active), None, np.inf
        fit, belief = self._fit(u, noise), self._belief()
        for _ in range(_ROUNDS if self._estimated else 0):
            theta = noise.theta.copy()
            e = fit.at.residuals[noise.instrument >= 0]
            rms = float(np.sqrt(np.mean(e**2)))
            is_rounding = theta[1:].max() <= 1.01 * FLOOR**2 or (rms < _ROUNDING and rms > 0.5 * before)
            if belief is None and is_rounding:
                break
            before, is_settled = rms, False
            is_exact = rms < _ROUNDING or rms < _NO_NOISE * np.sqrt(theta[self._estimated].max())
            if belief is None and is_exact:
                theta[self._estimated] = max(_PRIOR_FADES * rms, FLOOR) ** 2
                theta[JOINT] = 0.0 if JOINT in self._estimated else theta[JOINT]
            else:
                if JOINT in self._estimated and theta[JOINT] == 0.0:
                    theta[JOINT] = 0.01 * theta[1:].max()
                there = noise.with_variances(theta)
                found = variance_components(fit.at, fit.u, there, self._estimated, belief)
                change = np.abs(found.theta - theta)[self._estimated]
                is_settled = bool(np.all(change < _SETTLED * np.sqrt(np.diag(found.covariance))))
                theta = found.theta
            noise = noise.with_variances(theta)
            fit = self._fit(fit.u, noise)
            if float(np.sqrt(np.mean(fit.at.residuals**2))) < _ROUNDING:
                fit = replace(fit, is_converged=True)  # nothing is left to explain
            if is_settled:
                break
        return fit, noise, found, belief is not None
