"""The tool centre point by pivoting: the tip stays on one spot while the flange tilts around it.

The tip E is fixed in the flange F, the spot P in the base B, and neither is known. Every pose of the flange
gives p_BF + R_BF p_FE = p_BP, which is linear in both: Wilms (2016), chapter 3, eqs. (1) and (2).
"""

from dataclasses import dataclass

import numpy as np

from robots.metrology.least_squares import FitStatistics, UndeterminedError, fit_statistics

MINIMUM_POSES = 3
MINIMUM_TILT = np.deg2rad(2.0)  # root mean square of the orientations about their mean
_WANDERING = 5e-3  # m, by which no tip that was put on a spot misses it in the median
_WANDERING_SHARE = 0.1  # likewise, of how far the flange is from its mean

_NEGLIGIBLE = 1e-9  # m, residuals that are rounding


@dataclass(frozen=True)
class ToolCentre:
    """The tool centre point and the pivot point; the parameters of ``statistics`` are (p_FE, p_BP) in m."""

    p_FE: np.ndarray  # m, (3,), the tip in the flange
    p_BP: np.ndarray  # m, (3,), the spot in the base
    residual: np.ndarray  # m, (n, 3), p_BF + R_BF p_FE - p_BP, in the base
    statistics: FitStatistics

    @property
    def standard_deviation_of_a_pose(self) -> float:
        """sqrt(r^T r / n) in m as Wilms (2016) has it: the root mean square distance, n poses.

        It divides by the poses instead of the degrees of freedom 3 n - 6, so that it says how far a tip is
        from the spot, and for few poses too little; ``statistics.sigma`` is the value of one coordinate.
        """
        return float(np.sqrt(np.mean(np.sum(self.residual**2, axis=1))))


def tool_centre(X_BF: np.ndarray) -> ToolCentre:
    """The tip by least squares over all poses; outliers are reported, but not left out.

    Two poses have as many equations as unknowns, which Wilms (2016) takes to be enough. It never is:
    between two orientations lies a rotation, and along its axis the tip could be anywhere.

    Args:
        X_BF: poses of the flange as homogeneous matrices in m, shape (n, 4, 4).

    Raises:
        UndeterminedError: for fewer than three poses, or orientations that are too much alike or differ
            about one axis only, or no tip stays on one spot.
    """
    X_BF = np.asarray(X_BF, dtype=float)
    n = len(X_BF)
    if n < MINIMUM_POSES:
        reason = (
            "; along the axis that turns one pose into the other, the tip stays unknown" if n == 2 else ""
        )
        raise UndeterminedError(f"pivoting takes at least {MINIMUM_POSES} poses, got {n}{reason}")
    R_BF, p_BF = X_BF[:, :3, :3], X_BF[:, :3, 3]
    refuse_alike_orientations(R_BF, "flange")
    jacobian = np.concatenate([R_BF, np.broadcast_to(-np.eye(3), (n, 3, 3))], axis=-1)
    solution = np.linalg.lstsq(jacobian.reshape(3 * n, 6), -p_BF.ravel(), rcond=None)[0]
    residual = p_BF + jacobian @ solution
    statistics = fit_statistics(jacobian, residual, _NEGLIGIBLE)
    if not statistics.outliers:
        _refuse_wandering(residual, p_BF)
    return ToolCentre(solution[:3], solution[3:], residual, statistics)


def _refuse_wandering(residual: np.ndarray, p_BF: np.ndarray) -> None:
    """Refuses poses (n, 3) and (n, 3) in m of which most leave no tip on one spot, as other angles do."""
    missed, moved = (
        float(np.median(np.linalg.norm(each, axis=1))) for each in (residual, p_BF - p_BF.mean(axis=0))
    )
    if missed > max(_WANDERING, _WANDERING_SHARE * moved):
        raise UndeterminedError(
            f"no tip stays on one spot: the best one is {1e3 * missed:.3g} mm off it in the median, while "
            f"the flange is {1e3 * moved:.3g} mm off its mean (other angles or another order of them?)"
        )


def refuse_alike_orientations(R: np.ndarray, body: str) -> None:
    """Refuses orientations that do not determine a lever arm on the body, and names the reason.

    The mean of the rotations shortens every direction of the body that they tilt, to a length s, and
    sqrt(1 - s^2) is how much they do so; a direction along a common axis keeps its length one.

    Args:
        R: rotation matrices, body in a fixed frame, shape (n, 3, 3).
        body: what turns, for the message.

    Raises:
        UndeterminedError: if a direction of the body is tilted by less than `MINIMUM_TILT`.
    """
    _, shortened, directions = np.linalg.svd(R.mean(axis=0))
    tilt = np.arcsin(np.sqrt(np.clip(1.0 - shortened**2, 0.0, 1.0)))
    if tilt[0] >= MINIMUM_TILT:
        return
    least = f"{np.rad2deg(MINIMUM_TILT):g} degrees"
    if tilt[1] < MINIMUM_TILT:
        raise UndeterminedError(
            f"the orientations of the {body} are too much alike: {np.rad2deg(tilt[2]):.2g} degrees about "
            f"their mean, must be at least {least} about every axis (are the angles in the right unit?)"
        )
    axis = directions[0] * np.sign(directions[0][np.argmax(np.abs(directions[0]))])
    x, y, z = axis + 0.0
    raise UndeterminedError(
        f"the {body} turns about one axis only, ({x:.2f}, {y:.2f}, {z:.2f}) in its own frame; tilt it by at "
        f"least {least} about another one, or the offset along that axis stays unknown"
    )
