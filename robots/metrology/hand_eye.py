"""Robot-world and hand-eye calibration: the camera in the robot base, the marker body on the flange.

For every pose of the robot, the flange F in the base B and the detection body D in the camera C belong
together by X_BF X_FD = X_BC X_CD: two unknown and constant poses around two measured ones (robot-world
calibration, A X = Y B). If the offset X_FD is known from drawings, as in Probst (2024), appendix A.4, one
pose of the robot is enough for X_BC, and the other way round; more of them show how good it is. A camera
on the flange that sees a fixed target T is the same problem with inverse poses (hand-eye calibration).
"""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from robots.metrology.least_squares import FitStatistics, UndeterminedError, fit_statistics
from robots.metrology.tcp_calibration import MINIMUM_POSES, refuse_alike_orientations
from robots.pose import pose_error

# What a camera system is assumed to scatter by; only their ratio matters for the result.
ROTATION_SIGMA = np.deg2rad(0.03)  # rad
TRANSLATION_SIGMA = 1e-4  # m

LARGEST_MISMATCH = np.deg2rad(5.0)  # median angle by which rotations that belong together may differ
_WRONG_SCALES = {1e3: "are units mixed?", 1e-3: "are units mixed?", -1.0: "are the poses left-handed?"}
_SCALE_GAIN = 0.1  # another scale that leaves less than this share of the residuals is the right one
_SMALLEST_MISFIT = 1e-3  # m, residuals that no other scale need explain
_NEGLIGIBLE = 1e-5  # sigmas, residuals that are rounding
_STEPS = 30
_SETTLED = 1e-10  # rad and m


@dataclass(frozen=True)
class Alignment:
    """The result of a robot-world or hand-eye calibration.

    The parameters of ``statistics`` are the errors (rotation vector in rad, translation in m) of X_FD, in F,
    then of X_BC, in B: the true pose is exp(rotation~) R, p + translation; zero for a pose that was known.
    Its sigma is relative to the assumed scatter of the camera.
    """

    X_FD: RigidTransform
    X_BC: RigidTransform
    residual: np.ndarray  # X_CD measured minus expected, (rotation vector in rad, m), in C, (n, 6)
    statistics: FitStatistics

    @property
    def rotation_rms(self) -> float:
        """Root mean square of the angles between measured and expected orientations in rad."""
        return float(np.sqrt(np.mean(np.sum(self.residual[:, :3] ** 2, axis=1))))

    @property
    def translation_rms(self) -> float:
        """Root mean square of the distances between measured and expected positions in m."""
        return float(np.sqrt(np.mean(np.sum(self.residual[:, 3:] ** 2, axis=1))))


def align_camera(
    X_BF: np.ndarray,
    X_CD: np.ndarray,
    X_FD: RigidTransform | None = None,
    X_BC: RigidTransform | None = None,
    rotation_sigma: float = ROTATION_SIGMA,
    translation_sigma: float = TRANSLATION_SIGMA,
) -> Alignment:
    """The camera in the base, the body on the flange, or both, from pairs of poses.

    A closed form makes the start; Gauss-Newton steps then minimise the errors of the camera, weighted by
    its assumed scatter. Outliers are reported, but not left out.

    Args:
        X_BF: poses of the flange in the base, shape (n, 4, 4), in m; taken as exact.
        X_CD: poses of the body in the camera at the same time, shape (n, 4, 4), in m.
        X_FD: the body on the flange, if it is known.
        X_BC: the camera in the base, if it is known.
        rotation_sigma: standard deviation of the camera's orientation about one axis in rad.
        translation_sigma: standard deviation of the camera's position along one axis in m.

    Raises:
        UndeterminedError: if the poses are too few, turn too little or about one axis only, or do not
            belong together.
        ValueError: if the shapes disagree, both poses are known, or a sigma is not positive.
    """
    X_BF, X_CD = np.asarray(X_BF, dtype=float), np.asarray(X_CD, dtype=float)
    if X_BF.shape != X_CD.shape or X_BF.shape[1:] != (4, 4):
        raise ValueError(f"poses must have the same shape (n, 4, 4), got {X_BF.shape} and {X_CD.shape}")
    if X_FD is not None and X_BC is not None:
        raise ValueError("nothing to align: the body on the flange and the camera in the base are both given")
    if not (rotation_sigma > 0.0 and translation_sigma > 0.0):
        raise ValueError(f"sigmas must be positive, got {rotation_sigma} rad and {translation_sigma} m")
    if X_FD is not None:
        unknown, start = slice(6, 12), (X_FD, _mean_pose(X_BF @ X_FD.GetAsMatrix4() @ np.linalg.inv(X_CD)))
    elif X_BC is not None:
        unknown, start = slice(0, 6), (_mean_pose(np.linalg.inv(X_BF) @ X_BC.GetAsMatrix4() @ X_CD), X_BC)
    else:
        if len(X_BF) < MINIMUM_POSES:
            raise UndeterminedError(f"an alignment takes at least {MINIMUM_POSES} poses, got {len(X_BF)}")
        refuse_alike_orientations(X_BF[:, :3, :3], "flange")
        refuse_alike_orientations(X_CD[:, :3, :3], "body seen by the camera")
        unknown, start = slice(0, 12), _closed_form(X_BF, X_CD)
    _refuse_strangers(_residual(X_BF, X_CD, *start))
    _refuse_other_scales(X_BF, X_CD, start[1].rotation().matrix())
    sigmas = np.repeat([rotation_sigma, translation_sigma], 3)
    X_FD, X_BC = _refine(X_BF, X_CD, *start, unknown, sigmas)
    residual = _residual(X_BF, X_CD, X_FD, X_BC)
    jacobian = _jacobian(X_BF, X_FD, X_BC)[..., unknown] / sigmas[:, None]
    statistics = fit_statistics(jacobian, residual / sigmas, _NEGLIGIBLE)
    covariance = np.zeros((12, 12))
    covariance[unknown, unknown] = statistics.covariance
    return Alignment(X_FD, X_BC, residual, replace(statistics, covariance=covariance))


def align_hand_eye(
    X_BF: np.ndarray,
    X_CT: np.ndarray,
    rotation_sigma: float = ROTATION_SIGMA,
    translation_sigma: float = TRANSLATION_SIGMA,
) -> Alignment:
    """A camera C on the flange and the fixed target T that it sees: X_BF X_FC X_CT = X_BT.

    Seen from the flange, the base carries the target and the camera stands still: this is `align_camera`
    with the base and the flange exchanged. In the result X_BC stands for X_FC, and X_FD for X_BT.

    Raises:
        UndeterminedError, ValueError: see `align_camera`.
    """
    X_FB = np.linalg.inv(np.asarray(X_BF, dtype=float))
    return align_camera(X_FB, X_CT, None, None, rotation_sigma, translation_sigma)


def _refuse_strangers(residual: np.ndarray) -> None:
    """Refuses rotations that cannot belong together: wrong order, inverse poses, other Euler angles."""
    angle = np.linalg.norm(residual[:, :3], axis=1)
    if np.median(angle) > LARGEST_MISMATCH:
        raise UndeterminedError(
            f"the rotations of flange and body do not belong together: they differ by "
            f"{np.rad2deg(np.median(angle)):.3g} degrees in the median, must be below "
            f"{np.rad2deg(LARGEST_MISMATCH):g} (other order, inverse poses, other angles, left-handed?)"
        )


def _refuse_other_scales(X_BF: np.ndarray, X_CD: np.ndarray, R_BC: np.ndarray) -> None:
    """Orientations are the same in every unit; positions fit together in one scale only, here one."""
    n, R_BF, p_BF = len(X_BF), X_BF[:, :3, :3], X_BF[:, :3, 3].ravel()
    p_CD_B = (X_CD[:, :3, 3] @ R_BC.T).ravel()
    offsets = np.concatenate([R_BF, np.broadcast_to(-np.eye(3), (n, 3, 3))], axis=-1).reshape(3 * n, 6)
    apart, _ = _rms_of_fit(offsets, p_CD_B - p_BF)
    fitting, solution = _rms_of_fit(np.column_stack([offsets, -p_CD_B]), -p_BF)
    if apart < _SMALLEST_MISFIT or fitting > _SCALE_GAIN * apart:
        return
    # Other scales than these come from a body that turns on the spot: they are noise.
    for scale, reason in _WRONG_SCALES.items():
        if 0.5 < solution[-1] / scale < 2.0:
            raise UndeterminedError(
                f"the positions of the body fit those of the flange if they are multiplied by "
                f"{solution[-1]:.4g} ({reason})"
            )


def _rms_of_fit(A: np.ndarray, b: np.ndarray) -> tuple[float, np.ndarray]:
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    return float(np.sqrt(np.mean(np.square(b - A @ x)))), x


def _closed_form(X_BF: np.ndarray, X_CD: np.ndarray) -> tuple[RigidTransform, RigidTransform]:
    """X_FD and X_BC by the Kronecker product: rotations first, then translations, which are linear.

    With column-wise stacking, R_BF R_FD R_CD^T = R_BC reads (R_CD (x) R_BF) vec(R_FD) = vec(R_BC). Summed
    over n poses, the two stacked rotations are the singular vectors of the largest singular value, n.
    """
    R_BF, R_CD = X_BF[:, :3, :3], X_CD[:, :3, :3]
    summed = np.einsum("nij,nkl->ikjl", R_CD, R_BF).reshape(9, 9)
    U, _, Vt = np.linalg.svd(summed)
    stacked_FD, stacked_BC = Vt[0].reshape(3, 3).T, U[:, 0].reshape(3, 3).T
    sign = np.sign(np.linalg.det(stacked_FD))
    R_FD, R_BC = (_nearest_rotation(sign * stacked) for stacked in (stacked_FD, stacked_BC))
    known = (X_CD[:, :3, 3] @ R_BC.matrix().T - X_BF[:, :3, 3]).ravel()
    minus_one = np.broadcast_to(-np.eye(3), R_BF.shape)
    p = np.linalg.lstsq(np.concatenate([R_BF, minus_one], -1).reshape(-1, 6), known, rcond=None)[0]
    return RigidTransform(R_FD, p[:3]), RigidTransform(R_BC, p[3:])


def _mean_pose(X: np.ndarray) -> RigidTransform:
    """The rotation nearest to all of a batch (n, 4, 4), and the mean of their translations."""
    return RigidTransform(_nearest_rotation(X[:, :3, :3].mean(axis=0)), X[:, :3, 3].mean(axis=0))


def _nearest_rotation(M: np.ndarray) -> RotationMatrix:
    U, _, Vt = np.linalg.svd(M)
    return RotationMatrix(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def _residual(X_BF: np.ndarray, X_CD: np.ndarray, X_FD: RigidTransform, X_BC: RigidTransform) -> np.ndarray:
    """Measured minus expected poses of the body in the camera, shape (n, 6)."""
    return pose_error(X_CD, X_BC.inverse().GetAsMatrix4() @ X_BF @ X_FD.GetAsMatrix4())


def _jacobian(X_BF: np.ndarray, X_FD: RigidTransform, X_BC: RigidTransform) -> np.ndarray:
    """Change of the expected poses with the parameters of `Alignment`, shape (n, 6, 12)."""
    R_CB = X_BC.rotation().matrix().T
    R_BF = X_BF[:, :3, :3]
    p_CD_B = X_BF[:, :3, 3] + R_BF @ X_FD.translation() - X_BC.translation()
    jacobian = np.zeros((len(X_BF), 6, 12))
    jacobian[:, :3, :3] = jacobian[:, 3:, 3:6] = R_CB @ R_BF
    jacobian[:, :3, 6:9] = jacobian[:, 3:, 9:] = -R_CB
    jacobian[:, 3:, 6:9] = R_CB @ np.cross(p_CD_B[:, None, :], np.eye(3)).swapaxes(-1, -2)
    return jacobian


def _refine(
    X_BF: np.ndarray,
    X_CD: np.ndarray,
    X_FD: RigidTransform,
    X_BC: RigidTransform,
    unknown: slice,
    sigmas: np.ndarray,
) -> tuple[RigidTransform, RigidTransform]:
    """Full Gauss-Newton steps on SE(3), which need no line search: start and residuals are small.

    A general solver would need a chart of the group around the start and its derivative instead.
    """
    for _ in range(_STEPS):
        jacobian = _jacobian(X_BF, X_FD, X_BC)[..., unknown] / sigmas[:, None]
        residual = _residual(X_BF, X_CD, X_FD, X_BC) / sigmas
        step = np.zeros(12)
        step[unknown] = np.linalg.lstsq(jacobian.reshape(residual.size, -1), residual.ravel(), rcond=None)[0]
        X_FD, X_BC = _moved(X_FD, step[:6]), _moved(X_BC, step[6:])
        if np.linalg.norm(step) < _SETTLED:
            return X_FD, X_BC
    raise UndeterminedError(
        f"the alignment does not settle in {_STEPS} steps: the poses contradict each other"
    )


def _moved(X: RigidTransform, step: np.ndarray) -> RigidTransform:
    turned = Rotation.from_rotvec(step[:3]).as_matrix() @ X.rotation().matrix()
    return RigidTransform(_nearest_rotation(turned), X.translation() + step[3:])
