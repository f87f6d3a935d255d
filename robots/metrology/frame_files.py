"""Points, poses and transformations from text files, in SI units, with plausibility checks.

Units and conventions are never guessed: the caller states them, and numbers that cannot be meant so are
refused with file and line.
"""

import math
from collections.abc import Collection, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from robots.metrology.number_table import NumberTable

UNITS = {"mm": 1e-3, "m": 1.0}  # of lengths, in m
ANGLES = {"deg": math.pi / 180.0, "rad": 1.0}  # in rad
# Orientations by the columns that follow x, y, z. Capitals turn about moving axes, small letters about fixed
# ones, as in scipy; the angles stand in the order of the letters.
ORIENTATIONS = {
    "ZYX": "angles about z, then y, then x, moving axes (KUKA A B C, Probst alpha beta gamma)",
    "XYZ": "angles about x, y, z, moving axes",
    "ZYZ": "angles about z, y, z, moving axes (Kawasaki O A T)",
    "xyz": "angles about x, y, z, fixed axes (Fanuc W P R)",
    "rotvec": "axis times angle (Universal Robots)",
    "wxyz": "quaternion, real part first (ABB)",
    "xyzw": "quaternion, real part last",
}

LARGEST_LENGTH = 100.0  # m, of any coordinate; a larger one is in another unit
_LARGEST_ANGLE = 4.0 * math.pi  # rad, two turns
_ROTATION_TOLERANCE = 1e-3  # of R^T R against I, and of the length of a quaternion
_SINGULAR = 1e-6  # smallest over largest singular value


def points_of(table: NumberTable, unit: str, columns: slice = slice(None)) -> np.ndarray:
    """Points from a table of three columns, or from three of its columns, in m, shape (n, 3).

    Raises:
        NumberFileError: if there are no such columns, or a coordinate is beyond `LARGEST_LENGTH`.
        ValueError: if the unit is not one of `UNITS`.
    """
    values = table.values[:, columns]
    if values.shape[1] != 3:
        raise table.error(f"a point takes three numbers, got {values.shape[1]}")
    return _lengths(table, values, unit)


def poses_of(
    table: NumberTable, unit: str, angles: str, orientation: str, columns: slice = slice(None)
) -> np.ndarray:
    """Poses from the columns of a table: x, y, z, then the orientation; shape (n, 4, 4), in m.

    Twelve columns are the upper three rows of a homogeneous matrix, row by row, whatever ``orientation``.

    Raises:
        NumberFileError: if the number of columns does not fit, an orientation is left-handed, singular
            or no rotation, an angle is beyond two turns, or a row seems to be in another unit.
        ValueError: if a unit or convention is unknown.
    """
    _refuse_unknown("angles", angles, ANGLES)
    _refuse_unknown("orientation", orientation, ORIENTATIONS)
    values = table.values[:, columns]
    if values.shape[1] == 12:
        M = values.reshape(-1, 3, 4)
        R = np.array([_rotation(table, [row], M[row, :, :3]) for row in range(len(M))])
        p = _lengths(table, M[:, :, 3], unit)
    else:
        R = _orientations(table, values, angles, orientation)
        p = _lengths(table, values[:, :3], unit)
    _refuse_mixed_units(table, p)
    X = np.tile(np.eye(4), (len(values), 1, 1))
    X[:, :3, :3], X[:, :3, 3] = R, p
    return X


def transform_of(table: NumberTable, unit: str) -> np.ndarray:
    """A transformation from a file with the four rows of its homogeneous matrix, (4, 4), in m.

    The rotation may be rounded; the nearest true one is taken.

    Raises:
        NumberFileError: if it is not a right-handed homogeneous matrix.
        ValueError: if the unit is unknown.
    """
    rows, columns = table.values.shape
    if (rows, columns) != (4, 4):
        raise table.error(f"a transformation takes 4 rows of 4 numbers, got {rows} of {columns}")
    if not np.allclose(table.values[3], [0.0, 0.0, 0.0, 1.0], rtol=0.0, atol=1e-6):
        raise table.error("the last row of a transformation must be 0 0 0 1", [3])
    X = np.eye(4)
    X[:3, :3] = _rotation(table, [0, 1, 2], table.values[:3, :3])
    X[:3, 3] = _lengths(table, table.values[:3, 3:], unit)[:, 0]
    return X


def _refuse_unknown(name: str, value: str, allowed: Collection[str]) -> None:
    if value not in allowed:
        raise ValueError(f"{name} must be one of {', '.join(allowed)}, got '{value}'")


def _lengths(table: NumberTable, values: np.ndarray, unit: str) -> np.ndarray:
    """Lengths of the rows of a table in m, of a plausible size."""
    _refuse_unknown("unit", unit, UNITS)
    lengths = UNITS[unit] * values
    far = np.flatnonzero(np.abs(lengths).max(axis=1) > LARGEST_LENGTH)
    if far.size:
        raise table.error(
            f"{np.abs(lengths[far[0]]).max():.4g} m is beyond {LARGEST_LENGTH:g} m (is the unit {unit}?)",
            far[:1],
        )
    return lengths


def _orientations(table: NumberTable, poses: np.ndarray, angles: str, orientation: str) -> np.ndarray:
    is_quaternion = orientation in ("wxyz", "xyzw")
    values, wanted = poses[:, 3:], 4 if is_quaternion else 3
    if values.shape[1] != wanted:
        raise table.error(
            f"a pose takes {3 + wanted} columns (x, y, z, {orientation}) or 12 (matrix), got {poses.shape[1]}"
        )
    if is_quaternion:
        wrong = np.flatnonzero(np.abs(np.linalg.norm(values, axis=1) - 1.0) > _ROTATION_TOLERANCE)
        if wrong.size:
            length = np.linalg.norm(values[wrong[0]])
            raise table.error(f"a quaternion must have length 1, got {length:.4g}", wrong[:1])
        return Rotation.from_quat(
            np.roll(values, -1, axis=1) if orientation == "wxyz" else values
        ).as_matrix()
    turned = ANGLES[angles] * values
    wrong = np.flatnonzero(np.abs(turned).max(axis=1) > _LARGEST_ANGLE)
    if wrong.size:
        largest = np.abs(values[wrong[0]]).max()
        raise table.error(
            f"an angle of {largest:g} {angles} is beyond two turns (are they {angles}?)", wrong[:1]
        )
    if orientation == "rotvec":
        return Rotation.from_rotvec(turned).as_matrix()
    return Rotation.from_euler(orientation, turned).as_matrix()


def _rotation(table: NumberTable, rows: Sequence[int], M: np.ndarray) -> np.ndarray:
    """The rotation nearest to a matrix that is one but for rounding."""
    U, s, Vt = np.linalg.svd(M)
    if s[-1] < _SINGULAR * s[0]:
        raise table.error("the rotation matrix is singular", rows)
    if np.linalg.det(M) < 0.0:
        raise table.error(
            f"the rotation matrix is left-handed, its determinant is {np.linalg.det(M):.3g}", rows
        )
    if np.abs(M.T @ M - np.eye(3)).max() > _ROTATION_TOLERANCE:
        raise table.error("the columns of the rotation matrix must be orthogonal and of length 1", rows)
    return U @ Vt


def _refuse_mixed_units(table: NumberTable, p: np.ndarray) -> None:
    """A robot is never a thousand times nearer to its base than usual, unless a row is in another unit."""
    distance = np.linalg.norm(p, axis=1)
    typical = float(np.median(distance))
    if not typical > 0.0:
        return
    ratio = np.maximum(distance, 1e-9 * typical) / typical
    # Within a factor of three of a thousand, either way.
    strange = np.flatnonzero(np.abs(np.abs(np.log10(ratio)) - 3.0) < np.log10(3.0))
    if strange.size:
        raise table.error(
            f"a position {1e3 * distance[strange[0]]:.4g} mm from the origin, but {1e3 * typical:.4g} mm in "
            "the median of all rows (are units mixed?)",
            strange[:1],
        )
