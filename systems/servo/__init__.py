"""Visual-servo laws, one file each, all with the same ports."""

from systems.named_classes import NamedClasses
from systems.servo.law_config import LawConfig

LAWS = NamedClasses(
    "law",
    {
        "open_loop": "systems.servo.open_loop:OpenLoop",
        "numerical_ik": "systems.servo.numerical_ik:NumericalIk",
        "pbvs": "systems.servo.pbvs:Pbvs",
        "position_level": "systems.servo.position_level:PositionLevel",
        "compensation": "systems.servo.compensation:Compensation",
        "disturbance_observer": "systems.servo.baselines.disturbance_observer:DisturbanceObserver",
        "iterative_learning": "systems.servo.baselines.iterative_learning:IterativeLearning",
        "self_calibrating": "systems.servo.self_calibrating.law:SelfCalibrating",
    },
)

__all__ = ["LAWS", "LawConfig"]
