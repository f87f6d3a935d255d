"""Fits the unknowns of an elastic arm to recorded motions, and says how well each of them is known."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from robots.identification.arm_response import ArmResponse, Response
from robots.identification.elastic_parameters import ElasticParameters

_ROBUST = 3.0  # in units of the spread: larger residuals, as where teeth meet, count less and less
_MAD = 1.4826  # of a normal distribution, standard deviation over median of the absolute value


@dataclass(frozen=True)
class ArmFit:
    """The unknowns of an arm, found; n unknowns, c cases."""

    parameters: ElasticParameters
    values: np.ndarray  # (n,)
    covariance: np.ndarray  # (n, n), with what cases and sensors disagree
    noise_covariance: np.ndarray  # (n, n), what it would be if nothing but noise were wrong
    spread: np.ndarray  # (channels,) of the residuals in rad/s or m/s^2
    evaluations: int
    condition: float  # of the whitened sensitivities in units of the prior

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations of the values, shape (n,)."""
        return np.sqrt(np.diagonal(self.covariance))


class ArmProblem:
    """Residuals of a model of all cases, weighted, with priors as further residuals."""

    def __init__(self, response: ArmResponse, measured: np.ndarray, parameters: ElasticParameters) -> None:
        """Takes readings (m, cases, channels) at the samples of the response, NaN where there are none."""
        self.response, self.parameters = response, parameters
        self.measured, self._known = measured, np.isfinite(measured)
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

    def _response(self, p: np.ndarray, sensitivity: bool) -> Response:
        if self._last is not None and np.array_equal(self._last[0], p):
            found = self._last[1]
            if found.sensitivity is not None or not sensitivity:
                return found
        self.evaluations += 1
        found = self.response(p, sensitivity)
        self._last = p.copy(), found
        return found

    def jacobian(self, p: np.ndarray) -> np.ndarray:
        """Of the residuals, (m, cases, channels, n)."""
        sensitivity = self._response(p, True).sensitivity
        assert sensitivity is not None
        return sensitivity * self._known[..., None]

    def solve(self, p: np.ndarray, spread: np.ndarray, loss: str, steps: int, tolerance: float) -> np.ndarray:
        """The best unknowns from a start, by scipy's trust-region Levenberg-Marquardt with bounds."""
        prior = self.parameters

        def residuals(p: np.ndarray) -> np.ndarray:
            return np.concatenate(
                [(self.residuals(p) / spread).ravel(), (p - prior.start) / prior.prior_sigma]
            )

        def jacobian(p: np.ndarray) -> np.ndarray:
            whitened = (self.jacobian(p) / spread[:, None]).reshape(-1, len(p))
            return np.concatenate([whitened, np.diag(1.0 / prior.prior_sigma)])

        found = least_squares(
            residuals,
            np.clip(p, prior.lower + 1e-9, prior.upper - 1e-9),
            jacobian,  # pyright: ignore[reportArgumentType]  # its stub knows names alone
            bounds=(prior.lower, prior.upper),
            loss=loss,
            f_scale=_ROBUST,
            max_nfev=steps,
            xtol=tolerance,
            ftol=0.01 * tolerance,  # of a sum that is noise for the most part
            gtol=1e-12,
            x_scale="jac",
        )
        return found.x

    def fit(self, p: np.ndarray, spread: np.ndarray, evaluations: int) -> ArmFit:
        """What is known of the unknowns p where `solve` has ended."""
        prior = np.diag(1.0 / self.parameters.prior_sigma**2)
        residuals, J = self.residuals(p) / spread, self.jacobian(p) / spread[:, None]
        # As soft_l1 weighs them.
        weight = 1.0 / np.sqrt(1.0 + np.square(residuals / _ROBUST))
        # By case and sensor, whose three channels belong together.
        m, cases, channels, n = J.shape
        J = J.reshape(m, cases, channels // 3, 3, n)
        weight = weight.reshape(J.shape[:-1])
        gradient = np.einsum("mcsk,mcskn->csn", weight * residuals.reshape(weight.shape), J)
        flat = J.reshape(-1, n)
        information = (flat * weight.reshape(-1, 1)).T @ flat
        covariance = np.linalg.inv(information + prior)
        scatter = _scatter(gradient, covariance)
        sigma = self.parameters.prior_sigma
        singular = np.linalg.svd(information * np.outer(sigma, sigma), compute_uv=False)
        condition = float(np.sqrt(singular[0] / max(singular[-1], 1e-300)))
        return ArmFit(
            self.parameters,
            p,
            covariance + scatter,
            covariance,
            spread,
            evaluations + self.evaluations,
            condition,
        )


def _scatter(gradient: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """How far cases and sensors pull the unknowns apart: the sandwich covariance with two ways of clusters.

    What the model lacks is another thing in each case and to each sensor. At the solution their gradients add
    up to zero, but none of them is zero; how large they are says how much they disagree. Cameron, Gelbach and
    Miller (2011), without the term that they subtract, which is on the safe side. What is wrong alike for all
    cases and sensors is not in it.

    Args:
        gradient: of each case and sensor, (c, s, n).
        covariance: of noise alone, the inverse of the information, (n, n).
    """
    of_cases, of_sensors = gradient.sum(1), gradient.sum(0)
    return covariance @ (of_cases.T @ of_cases + of_sensors.T @ of_sensors) @ covariance
