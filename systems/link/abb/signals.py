"""Test signals of a controller (speeds, torques) on a separate UDP channel with a configurable layout.

RAPID sends either a text or packed numbers; which, in what order and in what units is up to the program that
runs on the controller (Probst 2024, A.2), so the layout is configuration and not protocol.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from robots.description.model import NUM_JOINTS

_NUMBERS = {"float32": "f4", "float64": "f8"}
_ORDERS = {"little": "<", "big": ">"}


@dataclass
class SignalLayout:
    """Layout of a datagram; read from a scenario file."""

    fields: list[str] = field(default_factory=lambda: ["time", "velocity", "torque"])  # in this order
    number: str = "float32"  # float32, float64 or text
    byte_order: str = "little"  # or big; of packed numbers
    separator: str = ";"  # of numbers in a text
    time_unit: float = 1e-3  # s
    velocity_unit_deg_s: float = 180.0 / math.pi  # 1 if the controller sends degrees per second
    torque_unit: float = 1.0  # N m, of the motors' torques and of those estimated from outside


@dataclass(frozen=True)
class ControllerSignals:
    """Content of one datagram; None for absent fields."""

    time: float  # s, the controller's clock; NaN if it is not sent
    velocity: np.ndarray | None = None  # (6,) rad/s
    torque: np.ndarray | None = None  # (6,) N m
    position: np.ndarray | None = None  # (6,) rad
    # (6,) N m, of whatever pushes the robot, as the controller estimates it; 4003 of Probst (2024), B.3
    external_torque: np.ndarray | None = None
    inputs: np.ndarray | None = None  # (2,), digital inputs 1 and 2, 0 or 1; 102 and 103


class SignalError(ValueError):
    """A datagram that does not fit the layout, or an invalid layout."""


_OF_JOINTS = ("velocity", "torque", "position", "external_torque")
_SIZES = {"time": 1, **dict.fromkeys(_OF_JOINTS, NUM_JOINTS), "inputs": 2}


class SignalCodec:
    """Reads and writes datagrams of one layout."""

    def __init__(self, layout: SignalLayout) -> None:
        """Checks the layout.

        Raises:
            SignalError: if it names something unknown, twice, or nothing.
        """
        unknown = [name for name in layout.fields if name not in _SIZES]
        if unknown or not layout.fields or len(set(layout.fields)) < len(layout.fields):
            raise SignalError(
                f"test signals: fields must be some of {', '.join(_SIZES)}, each once, got {layout.fields}"
            )
        if layout.number not in (*_NUMBERS, "text") or layout.byte_order not in _ORDERS:
            raise SignalError(
                "test signals: number must be float32, float64 or text and byte_order little or big, got "
                f"'{layout.number}' and '{layout.byte_order}'"
            )
        if not layout.separator:
            raise SignalError("test signals: a separator is needed")
        self._layout = layout
        self._units = {
            "time": layout.time_unit,
            "velocity": math.radians(layout.velocity_unit_deg_s),
            "torque": layout.torque_unit,
            "position": math.radians(1.0),
            "external_torque": layout.torque_unit,
            "inputs": 1.0,
        }
        self._count = sum(_SIZES[name] for name in layout.fields)
        self._dtype = np.dtype(_ORDERS[layout.byte_order] + _NUMBERS.get(layout.number, "f8"))

    def decode(self, data: bytes) -> ControllerSignals:
        """Reads a datagram.

        Raises:
            SignalError: if it has another size, or a number that is not finite.
        """
        numbers = self._numbers(data)
        if len(numbers) != self._count or not np.isfinite(numbers).all():
            raise SignalError(f"test signals: {self._count} finite numbers are needed, got {len(numbers)}")
        values, start = {}, 0
        for name in self._layout.fields:
            values[name] = self._units[name] * numbers[start : start + _SIZES[name]]
            start += _SIZES[name]
        time = values.pop("time", None)
        return ControllerSignals(math.nan if time is None else float(time[0]), **values)

    def encode(self, signals: ControllerSignals) -> bytes:
        """Writes a datagram.

        Raises:
            SignalError: if the layout has a field that the signals lack.
        """
        parts = []
        for name in self._layout.fields:
            value = getattr(signals, name)
            if value is None:
                raise SignalError(f"test signals: {name} is to be sent, there is none")
            parts.append(np.atleast_1d(value) / self._units[name])
        numbers = np.concatenate(parts)
        if self._layout.number == "text":
            return self._layout.separator.join(f"{number:.9g}" for number in numbers).encode()
        return numbers.astype(self._dtype).tobytes()

    def _numbers(self, data: bytes) -> np.ndarray:
        if self._layout.number != "text":
            if len(data) % self._dtype.itemsize:
                raise SignalError(f"test signals: {len(data)} bytes are no whole numbers")
            with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
                return np.frombuffer(data, self._dtype).astype(float)
        try:
            return np.array([float(part) for part in data.decode("ascii").split(self._layout.separator)])
        except ValueError as error:
            raise SignalError(f"test signals: not a list of numbers: {error}") from error
