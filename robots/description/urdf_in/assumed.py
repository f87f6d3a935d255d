"""What a URDF does not say of a robot: gears, motors, friction, bearings, the load that it may carry.

All of it follows from the inertia that a joint has to move. The shipped robots have reflected inertias of a
tenth to once that of the arm at the large axes, gears that let the arm swing at 10 to 25 Hz against a held
motor, and wrists whose drives are made for much more than they carry.
"""

import math
from collections.abc import Sequence

import numpy as np

RATIO = 100.0
_REFLECTED = 0.25  # of the largest inertia that a joint moves
_SMALLEST = 0.03  # of the largest of all joints: nobody builds a drive to the inertia of a flange
_SWING = 15.0  # Hz, of the arm against a held motor
_DAMPING = 0.06  # of that swing
_VISCOUS = 5.0  # 1/s, friction over reflected inertia
_COULOMB = 1.5  # rad/s^2, friction over reflected inertia
_BEARING = 3.0  # stiffness of a bearing over that of its gear
_PAYLOAD = 1.0 / 7.0  # of the mass that moves
_DENSITY = 2700.0  # kg/m^3, of a cube that is carried: aluminium
SOURCE = "assumed: in proportion to the inertia that the joint moves"


def rounded(value: float) -> float:
    """The value to three digits: an assumption has no more."""
    return float(f"{value:.3g}")


def assumed_drive_trains(inertia: np.ndarray) -> list[dict]:
    """Drive trains of six joints, as a robot file says them.

    Args:
        inertia: the largest that each joint has to move, without its rotor, kg m^2, shape (6,).
    """
    return [_drive_train(float(each)) for each in reflected(inertia)]


def reflected(inertia: np.ndarray) -> np.ndarray:
    """Inertias of the rotors behind their gears in kg m^2, shape (6,); see `assumed_drive_trains`."""
    return np.maximum(_REFLECTED * inertia, _SMALLEST * inertia.max())


def _drive_train(reflected_inertia: float) -> dict:
    moved = reflected_inertia / _REFLECTED
    stiffness = moved * (2.0 * math.pi * _SWING) ** 2
    return {
        "ratio": RATIO,
        "rotor_inertia": rounded(reflected_inertia / RATIO**2),
        "stiffness": rounded(stiffness),
        "damping": rounded(2.0 * _DAMPING * math.sqrt(stiffness * moved)),
        "viscous_friction": rounded(_VISCOUS * reflected_inertia / RATIO**2),
        "coulomb_friction": rounded(_COULOMB * reflected_inertia / RATIO),
        "source": SOURCE,
    }


def assumed_tilting(drive_train: dict) -> dict:
    """The bearing beside a gear."""
    return {
        "stiffness": [rounded(_BEARING * drive_train["stiffness"])] * 2,
        "damping": [rounded(drive_train["damping"])] * 2,
        "source": SOURCE,
    }


def assumed_payload(masses: Sequence[float], p_FE: np.ndarray, largest: float | None = None) -> dict:
    """The largest load, a cube of aluminium at the tool.

    Args:
        masses: of the links that move, kg.
        p_FE: the tool in the frame of the flange, m, shape (3,).
        largest: its mass in kg; None for a seventh of the mass that moves.
    """
    mass = rounded(_PAYLOAD * sum(masses)) if largest is None else largest
    share = "a seventh of the mass that moves, " if largest is None else ""
    edge = (mass / _DENSITY) ** (1.0 / 3.0)
    return {
        "largest_mass": mass,
        "inertia": [rounded(mass * edge**2 / 6.0)] * 3,
        "source": f"assumed: {share}as a cube of aluminium",
        "center_of_mass": [rounded(float(each)) for each in p_FE],
        "center_of_mass_source": "assumed: at the tool",
    }


def assumed_radius(mass: float, moments: np.ndarray, reach: float) -> float:
    """The radius of a solid cylinder of a link's smallest moment, at most 8 % of the reach, in m."""
    radius = math.sqrt(max(0.0, 2.0 * float(moments.min()) / mass))
    return rounded(min(max(radius, 0.01 * reach), 0.08 * reach))
