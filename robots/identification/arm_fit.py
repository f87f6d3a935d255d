"""Fits the unknowns of an elastic arm to recorded motions, and says how well each of them is known."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import least_squares

from robots.identification.arm_response import ArmResponse, Response
from robots.identification.elastic_parameters import ElasticParameters

_SHIFT = 1.0  # samples, by which the times of robot and sensors may still be apart
_ROBUST = 3.0  # in units of the spread: larger residuals, as where teeth meet, count less and less
_ALONE = 1e-6  # of the information: what the other parts say of it at least
# What is wrong alike in all motions, which no scatter shows: logarithms of springs and dampers, play in its
# unit, share of the hysteresis. Motions that are simulated in steps of a millisecond, in which teeth meet and
# part, are wrong by so much; with a quarter of it the errors of dampers are half as large.
_STEPPED = {"stiffness": 0.002, "time": 0.03, "play": 0.03, "hysteresis": 0.003}
_MAD = 1.4826  # of a normal distribution, standard deviation over median of the absolute value


@dataclass(frozen=True)
class Evidence:
    """What the data say of n unknowns and of the lags of c cases, N = n + c; whitened by the spread."""

    information: np.ndarray  # (N, N), without the priors
    prior: np.ndarray  # (N,), standard deviations of the priors
    # of cases, sensors and phases (N, N) each: how much they disagree, covariance of the gradient
    disagreement: list[np.ndarray]
    alike: np.ndarray  # (n,), standard deviations of what is wrong alike everywhere

    @property
    def covariance(self) -> np.ndarray:
        """Of unknowns and lags if nothing but noise were wrong, (N, N)."""
        return np.linalg.inv(self.information + np.diag(1.0 / self.prior**2))

    def whole(self) -> np.ndarray:
        """The covariance of the unknowns with all that is in `ArmFit.covariance`, (n, n)."""
        n, noise = len(self.alike), self.covariance
        whole = noise + widest([noise @ each @ noise for each in self.disagreement])
        return whole[:n, :n] + np.diag(np.square(self.alike))


@dataclass(frozen=True)
class ArmFit:
    """The unknowns of an arm, found; n unknowns, c cases."""

    parameters: ElasticParameters
    values: np.ndarray  # (n,)
    covariance: np.ndarray  # (n, n), with what cases, sensors and phases of the motions disagree
    noise_covariance: np.ndarray  # (n, n), what it would be if nothing but noise were wrong
    spread: np.ndarray  # (channels,) of the residuals in rad/s or m/s^2
    evaluations: int
    condition: float  # of the whitened sensitivities in units of the prior
    evidence: Evidence | None = None  # which the covariances are from

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations of the values, shape (n,)."""
        return np.sqrt(np.diagonal(self.covariance))


class ArmProblem:
    """Residuals of a model of all cases, weighted, with priors as further residuals."""

    def __init__(
        self,
        response: ArmResponse,
        measured: np.ndarray,
        parameters: ElasticParameters,
        has_own_clock: bool = True,
    ) -> None:
        """Takes readings.

        Args:
            response: of the model.
            measured: (m, cases, channels) at the samples of the response, NaN where there are none.
            parameters: the unknowns.
            has_own_clock: whether the readings may be off in time, each case by some other lag.
        """
        self._clocks = measured.shape[1] if has_own_clock else 0
        self.response, self.parameters = response, parameters
        self.measured, self._known = measured, np.isfinite(measured)
        # By one sample more of lag the readings of a case change by as much.
        filled = np.where(self._known, measured, 0.0)
        around = self._known & np.roll(self._known, 1, axis=0) & np.roll(self._known, -1, axis=0)
        self._by_shift = np.where(around, np.gradient(filled, axis=0), 0.0) / response.step
        self.evaluations = 0
        self._last: tuple[np.ndarray, Response] | None = None

    def readings(self, p: np.ndarray) -> np.ndarray:
        """What the sensors should show with unknowns p, (m, cases, channels)."""
        return self._response(p, False).readings

    def residuals(self, p: np.ndarray) -> np.ndarray:
        """Modelled less measured, zero where nothing is measured, (m, cases, channels)."""
        return np.where(self._known, self._response(p, False).readings - self.measured, 0.0)

    def spread(self, p: np.ndarray, floor: np.ndarray) -> np.ndarray:
        """How far the residuals of each channel scatter, by the median; not below a floor, (channels,)."""
        missing = np.where(self._known, np.abs(self.residuals(p)), np.nan)
        return np.maximum(_MAD * np.nanmedian(missing, axis=(0, 1)), floor)

    def moved(self, p: np.ndarray) -> list[np.ndarray]:
        """How the arm moves with unknowns p, see `Response`."""
        return self._response(p, False).moved

    def cost(self, p: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """Half of the sum of squares of each case, large residuals as `solve` weighs them, (cases,)."""
        scaled = np.square(self.residuals(p) / (_ROBUST * spread))
        return _ROBUST**2 * (np.sqrt(1.0 + scaled) - 1.0).sum(axis=(0, 2))

    def set_rests(self, rests: np.ndarray) -> None:
        """Where gears without load begin within their play from now on, (cases, 6)."""
        self.response.set_rests(rests)
        self._last = None

    def _response(self, p: np.ndarray, sensitivity: bool) -> Response:
        if self._last is not None and np.array_equal(self._last[0], p):
            found = self._last[1]
            if found.sensitivity is not None or not sensitivity:
                return found
        self.evaluations += 1
        found = self.response(p, sensitivity)
        self._last = p.copy(), found
        return found

    def _whitened(self, p: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """Derivatives of the weighted residuals, (m, cases, channels, n)."""
        sensitivity = self._response(p, True).sensitivity
        assert sensitivity is not None
        return sensitivity * (self._known / spread)[..., None]

    def solve(
        self, p: np.ndarray, spread: np.ndarray, steps: int, tolerance: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The best unknowns from a start, by scipy's trust-region Levenberg-Marquardt with bounds.

        How far the times of the sensors are off in each case is found with them: a lag of a tenth of a
        millisecond looks like a damper.

        Returns:
            The unknowns, and the lags that are missing, in samples of the cases, (cases,), or (0,) without
            a clock of their own.
        """
        prior, n, cases = self.parameters, len(p), self._clocks
        # scipy's first step and its last ones are shares of the length of its vector: with ones for the robot
        # that is believed they are shares of a spring, whatever logarithms the dampers have.
        origin = np.append(prior.start, np.zeros(cases)) - 1.0
        sigma = np.append(prior.prior_sigma, np.full(cases, _SHIFT))
        lower, upper = (
            np.append(limit, np.full(cases, sign * np.inf))
            for limit, sign in ((prior.lower, -1.0), (prior.upper, 1.0))
        )

        @lru_cache(maxsize=2)  # scipy asks for residuals and derivatives apart
        def at_point(x: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
            at = np.array(x) + origin
            pull, information, squares = self._normal_equations(at[:n], at[n:], spread)
            off = (np.array(x) - 1.0) / sigma
            information += np.diag(1.0 / sigma**2)
            return condensed(pull + off / sigma, information, squares + float(off @ off))

        start = np.append(np.clip(p, prior.lower + 1e-9, prior.upper - 1e-9), np.zeros(cases))
        found = least_squares(
            lambda x: at_point(tuple(x))[0].copy(),
            start - origin,
            lambda x: at_point(tuple(x))[1].copy(),  # pyright: ignore[reportArgumentType]  # its stub knows names alone
            bounds=(lower - origin, upper - origin),
            max_nfev=steps,
            xtol=tolerance,
            ftol=0.01 * tolerance,  # of a sum that is noise for the most part
            gtol=1e-12,
            x_scale="jac",
        )
        values = found.x + origin
        return values[:n], values[n:]

    def _normal_equations(
        self, p: np.ndarray, shift: np.ndarray, spread: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Gradient, Gauss and Newton's approximation of the Hessian, and sum of squares, by p and the lags.

        Large residuals count less, as soft_l1 of scipy has it: a residual r in units of its spread is taken
        for the g with g^2 = 2 c^2 (sqrt(1 + (r/c)^2) - 1). Case by case, so that no matrix is as long as all
        readings.
        """
        sensitivity = self._response(p, True).sensitivity
        assert sensitivity is not None
        residuals = self._shifted(p, shift) / spread
        root = np.sqrt(1.0 + np.square(residuals / _ROBUST))
        # g / r, which does not cancel where r is small; then d(g) / d(r) = r / (root g).
        ratio = np.sqrt(2.0 / (1.0 + root))
        slope = 1.0 / (root * ratio)
        weight = slope * self._known / spread
        n, clocks = len(p), len(shift)
        pull, information = np.zeros(n + clocks), np.zeros((n + clocks, n + clocks))
        for case in range(residuals.shape[1]):
            J = sensitivity[:, case] * weight[:, case, :, None]
            J = J.reshape(-1, n)
            columns = np.arange(n)
            if clocks:
                J = np.column_stack([J, -(weight[:, case] * self._by_shift[:, case]).ravel()])
                columns = np.append(columns, n + case)
            part = part_of(J, (ratio[:, case] * residuals[:, case]).ravel())
            pull[columns] += part.pull
            information[np.ix_(columns, columns)] += part.information
        return pull, information, float(np.square(ratio * residuals).sum())

    def _shifted(self, p: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Residuals, with readings of each case later by a shift in samples."""
        left = self.residuals(p)
        return left - shift[:, None] * self._by_shift if len(shift) else left

    def _shift_columns(self, spread: np.ndarray) -> np.ndarray:
        """Derivatives of the weighted residuals by the missing lags, (m, cases, channels, cases or 0)."""
        cases = self._clocks
        columns = np.zeros((*self.measured.shape, cases))
        each = np.arange(cases)
        columns[:, each, :, each] = -np.moveaxis(self._by_shift / spread, 1, 0)[:cases]
        return columns

    def fit(
        self, p: np.ndarray, shift: np.ndarray, spread: np.ndarray, phases: np.ndarray, evaluations: int
    ) -> ArmFit:
        """What is known of the unknowns p and the lags where `solve` has ended.

        Args:
            p: the unknowns.
            shift: the missing lags in samples, (cases,).
            spread: of the channels.
            phases: of the motions, a number from zero for each reading, -1 for none, (m, cases).
            evaluations: that were needed before.
        """
        n = len(p)
        sigma = np.append(self.parameters.prior_sigma, np.full(len(shift), _SHIFT))
        residuals = self._shifted(p, shift) / spread
        J = np.concatenate([self._whitened(p, spread), self._shift_columns(spread)], axis=3)
        # As soft_l1 weighs them.
        weight = 1.0 / np.sqrt(1.0 + np.square(residuals / _ROBUST))
        # By case and sensor, whose three channels belong together.
        m, cases, channels, columns = J.shape
        J = J.reshape(m, cases, channels // 3, 3, columns) * np.sqrt(weight).reshape(m, cases, -1, 3, 1)
        residuals = residuals.reshape(J.shape[:-1]) * np.sqrt(weight).reshape(J.shape[:-1])
        of_phases = [part_of(J[phases == k], residuals[phases == k]) for k in range(phases.max() + 1)]
        of_cases = [part_of(J[:, k], residuals[:, k]) for k in range(cases)]
        of_sensors = [part_of(J[:, :, k], residuals[:, :, k]) for k in range(channels // 3)]
        information = np.sum([part.information for part in of_cases], axis=0)
        covariance = np.linalg.inv(information + np.diag(1.0 / sigma**2))
        alike = np.array([_STEPPED.get(kind, 0.0) for kind in self.parameters.kinds])
        apart = [disagreement(parts, covariance) for parts in (of_cases, of_sensors, of_phases)]
        evidence = Evidence(information, sigma, apart, alike)
        of_unknowns = information[:n, :n] * np.outer(sigma[:n], sigma[:n])
        singular = np.linalg.svd(of_unknowns, compute_uv=False)
        condition = float(np.sqrt(singular[0] / max(singular[-1], 1e-300)))
        return ArmFit(
            self.parameters,
            p,
            evidence.whole(),
            covariance[:n, :n],
            spread,
            evaluations + self.evaluations,
            condition,
            evidence,
        )


@dataclass(frozen=True)
class DataPart:
    """What a part of the data says of n unknowns, whitened."""

    pull: np.ndarray  # (n,), the gradient
    information: np.ndarray  # (n, n)


def part_of(J: np.ndarray, residuals: np.ndarray) -> DataPart:
    """From whitened sensitivities, (..., n), and residuals, (...)."""
    flat = J.reshape(-1, J.shape[-1])
    return DataPart(residuals.ravel() @ flat, flat.T @ flat)


def condensed(pull: np.ndarray, information: np.ndarray, squares: float) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n + 1,) and derivatives (n + 1, n) with this gradient, information and sum of squares.

    What a least-squares solver needs of 100,000 readings is in them; it would decompose all of those.
    """
    R = cholesky(information)
    projected = solve_triangular(R.T, pull, lower=True)
    left = max(squares - projected @ projected, 0.0)
    return np.append(projected, np.sqrt(left)), np.vstack([R, np.zeros(len(R))])


def widest(ways: Sequence[np.ndarray]) -> np.ndarray:
    """Of some covariances (n, n) of the same unknowns the first one, stretched to the largest variances."""
    variance = np.diagonal(ways[0])
    largest = np.max([np.diagonal(each) for each in ways], axis=0)
    stretched = np.sqrt(np.divide(largest, variance, out=np.ones_like(largest), where=variance > 0.0))
    return ways[0] * np.outer(stretched, stretched)


def scatter(parts: Sequence[DataPart], covariance: np.ndarray) -> np.ndarray:
    """How far parts of the data pull the unknowns apart: the sandwich covariance, clustered, (n, n)."""
    return covariance @ disagreement(parts, covariance) @ covariance


def disagreement(parts: Sequence[DataPart], covariance: np.ndarray) -> np.ndarray:
    """Covariance of the gradient by how much parts of the data disagree, (n, n).

    What the model lacks is another thing in each case, to each sensor, and in each phase of the motions:
    while the robot speeds up, slows down, and as the ringing dies away. At the solution the gradients of the
    parts add up to zero, but none of them is zero; how large they are says how much the parts disagree.

    A part that is nearly alone in what it says has drawn the solution to itself and seems to agree. With H
    for its share of the information, its gradient counts (1 - H)^(-1/2) times: CR2 of Bell and McCaffrey
    (2002). What is wrong alike for all parts is not in it.

    Args:
        parts: of the data.
        covariance: of noise alone, the inverse of information and priors, (n, n).
    """
    root = np.linalg.cholesky(covariance)
    pulls = []
    for part in parts:
        share, axes = np.linalg.eigh(root.T @ part.information @ root)
        left = np.maximum(1.0 - share, _ALONE)
        pulls.append(axes @ ((axes.T @ root.T @ part.pull) / np.sqrt(left)))
    # A single part is the whole: its gradient is zero.
    if len(parts) < 2:
        return np.zeros_like(covariance)
    corrected = solve_triangular(root.T, np.transpose(pulls))
    return corrected @ corrected.T
