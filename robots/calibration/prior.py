"""The prior of the error parameters: how large errors of robots usually are.

Every parameter has its own unit here, so that a radian is not weighed as a metre, and a direction that the
measurements do not show stays where a robot most probably is: near its drawing.
"""

from collections.abc import Sequence

import numpy as np

from robots.calibration.loads import CENTRE_NAMES, MASS_NAMES
from robots.description.model import RobotModel

TRANSLATION = 10e-3  # m, standard deviation of each coordinate of a placement
ROTATION = float(np.deg2rad(2.0))  # rad, of each rotation of a placement and of the zero of a joint
SCALE = 1e-3  # of an encoder or a coupling: share of the angle
ECCENTRICITY = 1e-3  # rad, amplitude of what an eccentric disc or gear does
RIPPLE = 1e-4  # rad, of what repeats with the turns of the motor
OWN_FRAME = 1.0  # m and rad, of the base in a frame that has nothing to do with the robot
COMPLIANCES = 3.0  # times what the stiffness in the robot file says
MASS = 0.05  # of the masses in a robot file and of a payload, relative
CENTRE_OF_MASS = 10e-3  # m, of each coordinate
_PLAUSIBLE = 0.03  # m: with half the rows farther off the table belongs to something else
_TURNED = float(np.deg2rad(10.0))  # the same of orientations
_REASONS = "is it another robot, another direction of a joint, another unit, more than one frame?"
_TURNED_REASONS = (
    "in what order do qw, qx, qy, qz stand, are they ZYX Euler angles, of the tool in the world and not the "
    "reverse? --position-only does without them"
)
_NOT_TO_BE_BELIEVED = 10.0  # standard deviations: 100 mm or 20 degrees between two joints is another robot


def parameter_sizes(names: Sequence[str], is_own_frame: bool = False) -> np.ndarray:
    """Standard deviations of geometric parameters before the measurement, in m and rad.

    Args:
        names: as `robots.calibration.error_model` has them.
        is_own_frame: whether the instrument measures in a frame of its own, so that the base of the robot
            may be anywhere in it.
    """
    sizes = []
    for name in names:
        part, _, kind = name.partition("_")
        if part in ("scale", "coupling"):
            sizes.append(SCALE)
        elif part in ("sine", "cosine"):
            sizes.append(ECCENTRICITY)
        elif part in ("motor", "wave"):
            sizes.append(RIPPLE)
        elif part == "base" and is_own_frame:
            sizes.append(OWN_FRAME)
        else:
            sizes.append(TRANSLATION if kind in ("x", "y", "z") else ROTATION)
    return np.array(sizes)


def compliance_sizes(robot: RobotModel) -> np.ndarray:
    """Standard deviations of the joints' compliances before the measurement in rad / (N m), (6,)."""
    return COMPLIANCES / robot.joint_stiffness


def mass_sizes(mass: float = MASS, centre_of_mass: float = CENTRE_OF_MASS) -> np.ndarray:
    """Standard deviations of the masses, relative, and of the centres of mass in m, (28,)."""
    return np.concatenate([np.full(len(MASS_NAMES), mass), np.full(len(CENTRE_NAMES), centre_of_mass)])


def not_to_be_believed(
    names: Sequence[str], x: np.ndarray, distances: np.ndarray, angles: np.ndarray | None = None
) -> str:
    """Why what was found is not the robot, in words.

    A search finds a geometry for much, such as one of no size for a table in metres that claims to be in
    millimetres. Base and tool may stand anywhere.

    Args:
        names: as `robots.calibration.error_model` has them; others are passed over.
        x: their values in m and rad, shape (len(names),).
        distances: of the measured from the predicted positions in m, any shape; NaN where there is none.
        angles: between measured and predicted orientations in rad, any shape; None where there are none.

    Returns:
        For example ``joint3_z would be 350 mm off`` with possible reasons; empty if all can be believed.
    """
    distance = float(np.nanmedian(distances))
    if distance > _PLAUSIBLE:
        return f"half of the positions stay more than {1e3 * distance:.0f} mm off ({_REASONS})"
    angle = 0.0 if angles is None or not angles.size else float(np.median(angles))
    if angle > _TURNED:
        far = f"{np.rad2deg(angle):.0f} degrees"
        return f"half of the orientations stay more than {far} off ({_TURNED_REASONS})"
    sizes, worst, largest = parameter_sizes(names), "", _NOT_TO_BE_BELIEVED
    for name, value, size in zip(names, x.tolist(), sizes.tolist(), strict=True):
        part, _, kind = name.partition("_")
        if not (part.startswith("joint") or part == "zero") or abs(value) / size <= largest:
            continue
        far = (
            f"{1e3 * abs(value):.0f} mm"
            if kind in ("x", "y", "z")
            else f"{np.rad2deg(abs(value)):.0f} degrees"
        )
        worst, largest = f"{name} would be {far} off ({_REASONS})", abs(value) / size
    return worst
