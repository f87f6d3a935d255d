"""Parameters of a robot for people: in words, rounded to what is known of them, with a picture."""

import math

import numpy as np
from markupsafe import Markup

from robots.description.model import RobotModel

_KINDS = {"x": "shift along x", "y": "shift along y", "z": "shift along z"}
_KINDS |= {f"r{axis}": f"turn about {axis}" for axis in "xyz"}
_DIRECTIONS = {"x": (-9.0, 6.0), "y": (12.0, 3.0), "z": (0.0, -12.0)}  # of the axes in the picture, px
_ORIGIN, _SOFT, _INK = (13.0, 16.0), "#9aa5b4", "#d2691e"


def in_words(name: str) -> str:
    """What a parameter is: ``joint3_rz`` is the frame of joint 3, turned about its z."""
    part, _, kind = name.partition("_")
    if part == "zero":
        return f"joint {kind}, zero point"
    if part == "scale":
        return f"joint {kind}, scale of the encoder"
    if part in ("sine", "cosine"):
        return f"joint {kind}, eccentricity ({part})"
    if part in ("motor", "wave"):
        wave, _, joint = kind.partition("_")
        return f"joint {joint}, {'once' if part == 'motor' else 'twice'} per turn of the motor ({wave})"
    if part == "coupling":
        return f"joint {kind[1]}, turned along by joint {kind[0]}"
    if part == "c":
        return f"joint {kind}, compliance"
    if part in ("mass", "centre", "target", "frame", "anchor"):
        return _of_things(part, kind)
    place = f"frame of joint {part.removeprefix('joint')}" if part.startswith("joint") else part
    return f"{place}, {_KINDS[kind]}"


def _of_things(part: str, kind: str) -> str:
    """Of bodies, targets and instruments, whose names may have any letters."""
    if part == "mass":
        return f"{kind.replace('_', ' ')}, mass"
    thing, _, direction = kind.rpartition("_")
    what = {"centre": "centre of mass", "frame": "frame of instrument"}.get(part, part)
    return f"{what} {thing.replace('_', ' ')}, {_KINDS[direction]}"


def unit(name: str) -> tuple[str, float]:
    """The unit in which a parameter is shown, and how many of it are one in SI units."""
    if name.startswith("c_"):
        return "rad / N m", 1.0
    if name.startswith("mass_"):
        return "%", 100.0
    if name.startswith(("scale_", "coupling_")):
        return "ppm", 1e6
    return ("mm", 1e3) if name.endswith(("_x", "_y", "_z")) else ("deg", 180.0 / math.pi)


def rounded(value: float, uncertainty: float) -> tuple[str, str]:
    """A value with as many digits as its uncertainty leaves, and that with two: -1.234 and 0.056."""
    if not (uncertainty > 0.0 and math.isfinite(uncertainty)):
        return f"{value:.6g}", f"{uncertainty:.2g}"
    place = math.floor(math.log10(uncertainty)) - 1
    value = round(value, -place) + 0.0  # no minus zero
    if abs(value) >= 1e-3 and 0 <= -place <= 9:
        return f"{value:.{-place}f}", f"{uncertainty:.{-place}f}"
    if value == 0.0 or abs(value) < uncertainty:
        return f"{round(value, -place):.2g}", f"{uncertainty:.2g}"
    digits = max(math.floor(math.log10(abs(value))) - place, 0)
    return f"{value:.{min(digits, 14)}e}", f"{uncertainty:.1e}"


def icon(name: str, robot: RobotModel) -> Markup:
    """The axes of a frame with an arrow along the one that is shifted, or around the one that is turned.

    Nothing for a mass, which has no direction.
    """
    part, _, kind = name.partition("_")
    if part == "mass":
        return Markup("")
    if part in ("zero", "scale", "c", "sine", "cosine", "motor", "wave", "coupling"):
        axis = "xyz"[int(np.argmax(np.abs(robot.axes[int(kind[-1]) - 1])))]
        is_turn = True
    else:
        axis, is_turn = kind[-1], kind.rpartition("_")[2].startswith("r")
    x, y = _ORIGIN
    lines = []
    for letter, (dx, dy) in _DIRECTIONS.items():
        marked = letter == axis
        colour, width = (_INK, 2.4) if marked and not is_turn else (_SOFT, 1.4)
        lines.append(
            f'<line x1="{x}" y1="{y}" x2="{x + dx}" y2="{y + dy}" stroke="{colour}" stroke-width="{width}"/>'
        )
    dx, dy = _DIRECTIONS[axis]
    if is_turn:
        slant = math.degrees(math.atan2(dy, dx))
        cx, cy = x + 0.6 * dx, y + 0.6 * dy
        lines.append(
            f'<ellipse cx="{cx}" cy="{cy}" rx="2.4" ry="6" transform="rotate({slant:.0f} {cx} {cy})" '
            f'fill="none" stroke="{_INK}" stroke-width="1.8" stroke-dasharray="20 4"/>'
        )
    else:
        length = math.hypot(dx, dy)
        ux, uy = dx / length, dy / length
        tip = (x + 1.25 * dx, y + 1.25 * dy)
        left, right = ((x + dx - 3 * s * uy, y + dy + 3 * s * ux) for s in (1, -1))
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in (tip, left, right))
        lines.append(f'<polygon points="{points}" fill="{_INK}"/>')
    title = in_words(name)
    return Markup(
        f'<svg class=icon viewBox="0 0 30 26" role=img><title>{title}</title>{"".join(lines)}</svg>'
    )
