"""A robot's kinematics written out as straight-line Python: no loops, no products with zero or one.

The code is made once for a robot and runs on floats, for one configuration, and on arrays, for many. For
one configuration it takes half the time of a loop over the joints, in which Python does little else than
take tuples apart; and six joint axes along coordinate axes leave a third of the multiplications.
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel

_ROUNDING = 1e-15  # direction cosines and lengths below this come from turning degrees into radians

# A number that is known when the code is written, or the name of one that is not.
Term = float | str
Vector = tuple[Term, Term, Term]


class _Lines:
    """Assignments to fresh names, one a line."""

    def __init__(self) -> None:
        self.text: list[str] = []

    def sum_of_products(self, *products: tuple[Term, Term]) -> Term:
        """a * b + c * d + ...; what is known already is not computed again."""
        constant, terms = 0.0, []
        for a, b in products:
            if isinstance(a, str) and isinstance(b, str):
                terms.append(f" + {a} * {b}")
            elif isinstance(a, str) or isinstance(b, str):
                name, factor = (a, b) if isinstance(a, str) else (b, a)
                if factor == 0.0:
                    continue
                sign = "-" if float(factor) < 0.0 else "+"
                size = abs(float(factor))
                terms.append(f" {sign} {name}" if size == 1.0 else f" {sign} {size!r} * {name}")
            else:
                constant += a * b
        if not terms:
            return constant
        if len(terms) == 1 and constant == 0.0 and terms[0].startswith(" + ") and "*" not in terms[0]:
            return terms[0].removeprefix(" + ")
        start = [f" + {constant!r}"] if constant else []
        name = f"x{len(self.text)}"
        self.text.append(f"{name} = {''.join(start + terms).removeprefix(' + ').strip()}")
        return name

    def times(self, columns: list[Vector], vector: Iterable[Term]) -> Vector:
        """R v, for the columns of R."""
        v = tuple(vector)
        x, y, z = (
            self.sum_of_products(*((column[row], v[k]) for k, column in enumerate(columns)))
            for row in range(3)
        )
        return x, y, z

    def plus(self, a: Vector, b: Vector) -> Vector:
        """a + b."""
        x, y, z = (self.sum_of_products((1.0, p), (1.0, q)) for p, q in zip(a, b, strict=True))
        return x, y, z


def kinematics_code(robot: RobotModel) -> Callable[..., tuple[tuple, tuple]]:
    """The kinematics of a robot with its base and its tool.

    The links get working frames that are parallel to the base at zero joint angles. In these a robot of
    the usual kind turns about coordinate axes only, which moves two columns of a rotation matrix and
    leaves the third; no constant rotations remain between the joints. A joint about any other axis gets
    a frame of its own, turned so that its axis becomes z.

    Returns:
        A function of the six sines and then the six cosines of the joint positions. It returns the first
        three rows of X_WE, and the entries of the geometric Jacobian, column by column, rotation first (36).
    """
    lines = _Lines()
    X_WB = robot.base.pose()
    columns: list[Vector] = [_constants(column) for column in X_WB.rotation().matrix().T]
    p: Vector = _constants(X_WB.translation())
    axes: list[Vector] = []
    origins: list[Vector] = []
    R_BL = np.eye(3)  # the frame of the link at zero joint angles, as the robot file has it
    R_BS = np.eye(3)  # its working frame
    for number, (joint, axis) in enumerate(zip(robot.joints, robot.axes, strict=True)):
        p = lines.plus(p, lines.times(columns, _constants(R_BS.T @ R_BL @ joint.placement.translation)))
        R_BL = R_BL @ joint.placement.pose().rotation().matrix()
        axis_S = R_BS.T @ R_BL @ axis
        k = int(np.argmax(axis_S))
        if np.abs(axis_S - np.eye(3)[k]).max() >= _ROUNDING:
            turn, k = z_to(axis_S), 2
            R_BS = R_BS @ turn
            columns = [lines.times(columns, _constants(column)) for column in turn.T]
        axes.append(columns[k])
        origins.append(p)
        i, j = (k + 1) % 3, (k + 2) % 3
        s, c = f"s{number}", f"c{number}"
        minus_s = lines.sum_of_products((-1.0, s))
        columns[i], columns[j] = (
            _combined(lines, columns[i], columns[j], c, s),
            _combined(lines, columns[i], columns[j], minus_s, c),
        )
    X_FE, R_SF = robot.tool.pose(), R_BS.T @ R_BL
    p = lines.plus(p, lines.times(columns, _constants(R_SF @ X_FE.translation())))
    columns = [lines.times(columns, _constants(column)) for column in (R_SF @ X_FE.rotation().matrix()).T]
    pose = [f"({', '.join(str(column[row]) for column in (*columns, p))})" for row in range(3)]
    jacobian = [entry for a, o in zip(axes, origins, strict=True) for entry in _twist(lines, a, o, p)]
    return _compiled(lines, pose, jacobian, robot.name)


def _constants(vector: Iterable[float]) -> Vector:
    """Numbers without the dust that trigonometric functions of whole degrees leave."""
    x, y, z = (
        float(round(value)) if abs(value - round(value)) < _ROUNDING else float(value) for value in vector
    )
    return x, y, z


def z_to(axis: np.ndarray) -> np.ndarray:
    """A rotation whose third column is the given unit vector."""
    helper = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x = helper / np.linalg.norm(helper)
    return np.column_stack([x, np.cross(axis, x), axis])


def _combined(lines: _Lines, u: Vector, v: Vector, a: Term, b: Term) -> Vector:
    """a u + b v."""
    x, y, z = (lines.sum_of_products((p, a), (q, b)) for p, q in zip(u, v, strict=True))
    return x, y, z


def _twist(lines: _Lines, axis: Vector, origin: Vector, p: Vector) -> tuple[Term, ...]:
    """The column of a joint in the Jacobian: its axis, then axis x (p - origin)."""
    x, y, z = axis
    dx, dy, dz = (lines.sum_of_products((1.0, a), (-1.0, b)) for a, b in zip(p, origin, strict=True))
    minus_x, minus_y, minus_z = (lines.sum_of_products((-1.0, a)) for a in axis)
    return (
        *axis,
        lines.sum_of_products((y, dz), (minus_z, dy)),
        lines.sum_of_products((z, dx), (minus_x, dz)),
        lines.sum_of_products((x, dy), (minus_y, dx)),
    )


def _compiled(
    lines: _Lines, pose: list[str], jacobian: list[Term], name: str
) -> Callable[..., tuple[tuple, tuple]]:
    arguments = ", ".join(f"{letter}{number}" for letter in "sc" for number in range(NUM_JOINTS))
    results = (", ".join(map(str, entries)) for entries in (pose, jacobian))
    body = [*lines.text, "return ({}), ({})".format(*results)]
    source = f"def kinematics({arguments}):\n    " + "\n    ".join(body)
    made: dict[str, Any] = {}
    exec(compile(source, f"<kinematics of {name}>", "exec"), made)
    return made["kinematics"]
