"""What a robot file says of a gear that stiffens under load."""

from dataclasses import dataclass, replace

from robots.drivetrain.parts import part_from
from robots.drivetrain.stiffness import GearSpring

KINDS = ("cubic_spring", "exponential_spring", "limited_spring")


@dataclass
class Stiffening:
    """One of the springs of `robots.drivetrain.stiffness`; its c_0 is the stiffness of the gear.

    What a spring does not have stays zero.
    """

    kind: str = "cubic_spring"  # Reiner (2010) eq. (2.7), exponential_spring (2.8) or limited_spring (2.9)
    gamma: float = 0.0  # 1 / rad^2, of an exponential spring 1 / rad
    c_max: float = 0.0  # N m / rad
    sharpness: float = 0.0  # rad / (N m)
    source: str = ""  # where the numbers come from, or ``assumed``

    def scaled(self, factor: float) -> "Stiffening":
        """For a gear ``factor`` times as stiff at every deflection, see `GearSpring.scaled`."""
        return replace(self, c_max=factor * self.c_max, sharpness=self.sharpness / factor)

    def spring(self, c_0: float) -> GearSpring:
        """The spring of a gear whose stiffness at rest is c_0 in N m / rad.

        Raises:
            ValueError: if there is no such spring, or it has too many or too few parameters or wrong ones.
        """
        if self.kind not in KINDS:
            raise ValueError(f"stiffening: kind must be one of {', '.join(KINDS)}, got '{self.kind}'")
        given = {name: getattr(self, name) for name in ("gamma", "c_max", "sharpness")}
        return part_from({"kind": self.kind, "c_0": c_0} | {name: x for name, x in given.items() if x})
