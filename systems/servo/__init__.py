"""Visual-servo laws, one file each, all with the same ports."""

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
}

__all__ = ["LAWS", "LawConfig", "NumericalIk", "OpenLoop", "Pbvs", "PositionLevel", "ServoLaw"]
