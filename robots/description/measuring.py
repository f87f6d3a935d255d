"""The ranges in which a robot is measured, where its file names others than those of its joints."""

from dataclasses import dataclass

from robots.configuration.quantity import numbers

_JOINTS = 6


@dataclass
class MeasuringRange:
    """Where the joints stand when the robot is measured; empty lists for their whole ranges."""

    lower_deg: list[float] = numbers((), (0, _JOINTS), unit="deg")  # six; empty: the limits of the joints
    upper_deg: list[float] = numbers((), (0, _JOINTS), unit="deg")  # six; empty: the limits of the joints
    source: str = ""  # where the numbers come from, or ``assumed``

    def problem(self) -> str:
        """Why there are no such ranges, or an empty string."""
        lower, upper = self.lower_deg, self.upper_deg
        if len(lower) != len(upper) or any(a >= b for a, b in zip(lower, upper, strict=False)):
            return f"measuring: lower_deg must be below upper_deg joint by joint, got {lower} and {upper}"
        return ""
