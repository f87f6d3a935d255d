"""Parts of drive trains by their names in YAML: ``{kind: cubic_spring, c_0: 2.0e4, gamma: 500}``."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from robots.drivetrain.backlash import Backlash, ViscoElasticGear
from robots.drivetrain.counterbalance import Counterbalance
from robots.drivetrain.dahl import DahlHysteresis
from robots.drivetrain.efficiency import DirectionalEfficiency, SmoothEfficiency
from robots.drivetrain.friction import (
    PolynomialFriction,
    SigmoidFriction,
    StickSlipFriction,
    StribeckFriction,
    TanhFriction,
)
from robots.drivetrain.hysteresis import PrandtlIshlinskii, SmoothPrandtlIshlinskii
from robots.drivetrain.motor import MotorLag
from robots.drivetrain.ratio import FourierRatio
from robots.drivetrain.stiffness import CubicSpring, ExponentialSpring, LimitedSpring

PARTS: dict[str, type] = {
    "sigmoid_friction": SigmoidFriction,
    "tanh_friction": TanhFriction,
    "stribeck_friction": StribeckFriction,
    "polynomial_friction": PolynomialFriction,
    "stick_slip_friction": StickSlipFriction,
    "cubic_spring": CubicSpring,
    "exponential_spring": ExponentialSpring,
    "limited_spring": LimitedSpring,
    "fourier_ratio": FourierRatio,
    "directional_efficiency": DirectionalEfficiency,
    "smooth_efficiency": SmoothEfficiency,
    "backlash": Backlash,
    "visco_elastic_gear": ViscoElasticGear,
    "dahl_hysteresis": DahlHysteresis,
    "prandtl_ishlinskii": PrandtlIshlinskii,
    "smooth_prandtl_ishlinskii": SmoothPrandtlIshlinskii,
    "motor_lag": MotorLag,
    "counterbalance": Counterbalance,
}


def part_from(description: Mapping[str, Any]) -> Any:
    """The part that a mapping describes; parts within it are mappings too, lists become tuples.

    Raises:
        ValueError: if the kind or a parameter is unknown or missing, or the part refuses its parameters.
    """
    parameters = dict(description)
    kind = parameters.pop("kind", None)
    if kind not in PARTS:
        raise ValueError(f"drive train: kind must be one of {', '.join(PARTS)}, got '{kind}'")
    part = PARTS[kind]
    known = [entry.name for entry in fields(part) if entry.init]
    unknown = [name for name in parameters if name not in known]
    if unknown:
        raise ValueError(f"drive train: {kind} has no parameter '{unknown[0]}', it has {', '.join(known)}")
    try:
        return part(**{name: _value(value) for name, value in parameters.items()})
    except TypeError as error:
        raise ValueError(f"drive train: {kind}: {error}") from error


def _value(value: Any) -> Any:
    if isinstance(value, Mapping):
        return part_from(value)
    return tuple(value) if isinstance(value, list) else value
