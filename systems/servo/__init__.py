"""Visual-servo laws, one file each, all with the same ports."""

from systems.servo.compensation import Compensation
from systems.servo.law import LawConfig, ServoLaw
from systems.servo.numerical_ik import NumericalIk
from systems.servo.open_loop import OpenLoop
from systems.servo.pbvs import Pbvs
from systems.servo.position_level import PositionLevel

LAWS: dict[str, type[ServoLaw]] = {
    "open_loop": OpenLoop,
    "numerical_ik": NumericalIk,
    "pbvs": Pbvs,
    "position_level": PositionLevel,
    "compensation": Compensation,
}
# What `truetip compare` compares: the path as planned, and the three laws that see the tip.
COMPARED_LAWS = ("open_loop", "numerical_ik", "pbvs", "position_level")
# These do without the camera.
BLIND_LAWS = ("open_loop", "compensation")

__all__ = [
    "BLIND_LAWS",
    "COMPARED_LAWS",
    "LAWS",
    "Compensation",
    "LawConfig",
    "NumericalIk",
    "OpenLoop",
    "Pbvs",
    "PositionLevel",
    "ServoLaw",
]
