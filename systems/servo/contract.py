"""What a servo asks of a law: its ports, and the traits that stand on its class."""

import re
from dataclasses import dataclass
from typing import Any

from pydrake.systems.framework import System

from robots.description.model import NUM_JOINTS
from systems.servo.law_config import LawConfig

SIZES = {  # of ports of numbers; all others are abstract
    "V_WE_desired": 6,
    "deviation": NUM_JOINTS,
    "position_command": NUM_JOINTS,
    "velocity_command": NUM_JOINTS,
    "correction": 6,
    "measurement": 3,
    "torque_feedforward": NUM_JOINTS,
    "speed_share": 1,
    "look_ahead": 1,
}
_PATH = ("X_WE_desired", "V_WE_desired")
_INPUTS = (*_PATH, "reference", "joint_sample", "pose_sample", "deviation")
_COMMANDS = ("position_command", "velocity_command")


_FIELDS = "__dataclass_fields__"  # what a dataclass has, and has from its base if it is none itself
_COLOUR = re.compile("(#[0-9a-fA-F]{6})?")


@dataclass(frozen=True)
class LawTraits:
    """What a law is, as its class says it; each has a default."""

    title: str  # for people
    colour: str  # in reports, #rrggbb; empty to be given one
    uses_camera: bool = True  # False: a camera that sees nothing does not stop it
    learns_from_camera: bool = False  # it goes on without samples, but a run begins with the camera
    commands_motors: bool = False  # its positions start from the motors': gears are wound up in them already
    # Whether it needs the joints of a tick for it, while the robot runs, and not just to learn from, later
    awaits_joints: bool = True
    is_compared: bool = False  # whether a comparison has it unless told otherwise
    Config: type[LawConfig] = LawConfig  # its gains and limits


def law_traits(law: type | System) -> LawTraits:
    """The traits of a law, given its class or the system.

    Raises:
        ValueError: if ``Config`` is not a dataclass that extends `LawConfig`, title or colour are none.
    """
    kind = law if isinstance(law, type) else type(law)
    config: Any = getattr(kind, "Config", LawConfig)
    # What a class without the decorator says beside its base would not be read.
    if not (isinstance(config, type) and issubclass(config, LawConfig) and _FIELDS in vars(config)):
        raise ValueError(
            f"law {kind.__name__}: Config must be a dataclass that extends LawConfig, "
            f"with a @dataclass of its own, got {config}"
        )
    title, colour = getattr(kind, "title", kind.__name__), getattr(kind, "colour", "")
    if not isinstance(title, str):
        raise ValueError(f"law {kind.__name__}: title must be a text, got {title!r}")
    if not (isinstance(colour, str) and _COLOUR.fullmatch(colour)):
        raise ValueError(f"law {kind.__name__}: colour must look like #7a5195, or be empty, got {colour!r}")
    return LawTraits(
        title=title,
        colour=colour,
        uses_camera=getattr(kind, "uses_camera", True),
        learns_from_camera=getattr(kind, "learns_from_camera", False),
        commands_motors=getattr(kind, "commands_motors", False),
        # Not inherited: who extends a law may use joints where that law did not.
        awaits_joints=vars(kind).get("awaits_joints", True),
        is_compared=getattr(kind, "is_compared", False),
        Config=config,
    )


def check_ports(law: System) -> None:
    """Refuses a law that a servo cannot connect.

    It needs ``joint_sample``, ``pose_sample`` if it uses the camera, the wanted pose and twist or
    ``reference``, and gives both commands.

    Raises:
        ValueError: if a port is missing, unknown, or of another size; one line.
    """
    name = type(law).__name__
    inputs = {law.get_input_port(i).get_name(): law.get_input_port(i) for i in range(law.num_input_ports())}
    outputs = {
        law.get_output_port(i).get_name(): law.get_output_port(i) for i in range(law.num_output_ports())
    }
    needed = ["joint_sample", *(["pose_sample"] if law_traits(law).uses_camera else [])]
    needed += [] if "reference" in inputs else _PATH
    for port in needed:
        if port not in inputs:
            raise ValueError(f"law {name}: input port '{port}' is missing")
    for port in inputs:
        if port not in _INPUTS:
            raise ValueError(
                f"law {name}: a servo has nothing for input port '{port}', only {', '.join(_INPUTS)}"
            )
    for port in _COMMANDS:
        if port not in outputs:
            raise ValueError(f"law {name}: output port '{port}' is missing")
    for port, size in SIZES.items():
        for found in (inputs.get(port), outputs.get(port)):
            if found is not None and found.size() != size:
                raise ValueError(f"law {name}: port '{port}' must have {size} numbers, got {found.size()}")
