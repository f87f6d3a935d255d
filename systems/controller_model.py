"""What the controller believes of robot, load and delays: all that a controller system is told of them."""

from dataclasses import dataclass, field

import numpy as np

from robots.configuration.quantity import choice, file_name, numbers, quantity
from robots.description.model import RobotModel
from robots.dynamics.plant import ELASTICITIES

_CARRIES = 7.0  # kg, of the robot for which absolute sizes of loads are given


@dataclass(frozen=True)
class ControllerModel:
    """Beliefs, which may differ from what the station is; laws, feedforwards and observers are built from it.

    The robot is complete: believed factors of stiffness and friction and the centre of the payload are in it
    already, so that who asks it for a stiffness or builds a plant from it gets what is believed.
    """

    robot: RobotModel  # nominal or calibrated, with the believed springs, friction and payload centre
    payload: float = 0.0  # kg at the flange
    period: float = 4e-3  # s, between two commands
    preview: float = 0.0  # s, how far ahead of time the wanted pose is that a law is given
    camera_period: float = 4e-3  # s, between two exposures
    camera_delay: float = 0.0  # s, from an exposure to the arrival of its pose
    command_delay: float = 0.0  # s, from a command to its motion: transport and dead time
    elasticity: str = "joints"  # what yields: rigid (nothing), joints or structure
    takes_torque: bool = True  # whether the drives take a torque feedforward

    @property
    def payload_centre(self) -> np.ndarray:
        """Centre of mass of the payload in the frame of the flange in m, shape (3,)."""
        return self.robot.payload.center_of_mass

    @property
    def load_scale(self) -> float:
        """By how much larger loads may be off than those of a robot that carries 7 kg; 1 for smaller ones."""
        return max(1.0, self.robot.payload.largest_mass / _CARRIES)


@dataclass
class Mismatch:
    """Random deviations of the belief from the station, uniform within +- the share; the seed draws them."""

    stiffness: float = quantity(0.0, 0.0, 0.9)  # of every spring: gears, bearings, beams
    payload: float = quantity(0.0, 0.0, 0.9)  # of its mass
    friction: float = quantity(0.0, 0.0, 0.9)  # of every joint
    seed: int = quantity(0, 0, 2**32 - 1)  # of the random draw


@dataclass
class ControllerModelConfig:
    """What the controller believes, as a scenario says it; what is left empty is as in the station."""

    robot: str = file_name()  # a shipped robot or the path of a robot file
    payload: float | None = quantity(None, 0.0, 1000.0, "kg")  # at the flange
    payload_centre_mm: list[float] = numbers((), (0, 3), unit="mm")  # three, in the frame of the flange
    camera_period: float | None = quantity(None, 5e-4, 1.0, "s")  # between two exposures
    camera_delay: float | None = quantity(None, 0.0, 1.0, "s")  # from an exposure to the arrival of its pose
    command_delay: float | None = quantity(None, 0.0, 1.0, "s")  # transport and dead time
    stiffness: list[float] = numbers((), (0, 1, 6), 0.01, 100.0)  # of the gears: one factor, or six
    structure: float | None = quantity(None, 0.01, 100.0)  # one factor of all bearings and beams
    friction: list[float] = numbers((), (0, 1, 6), 0.01, 100.0)  # one factor, or six
    elasticity: str = choice("", ("", *ELASTICITIES))  # rigid, joints or structure
    mismatch: Mismatch = field(default_factory=Mismatch)
