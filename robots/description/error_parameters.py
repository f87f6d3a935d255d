"""The 48 geometric error parameters of a robot: their names, their order and where each one acts.

Body 0 is the base, bodies 1 to 6 are the links and body E is the tool. Translations carry the name of the
frame and its parent (``pl_I0x`` moves the base in the world, ``pl_6Ez`` the tool in the flange), rotations
the letter of their axis and the body (``p_alpha2``: about x, at joint 2).
"""

from dataclasses import dataclass

import numpy as np

from robots.description.model import NUM_JOINTS, RobotModel

NUM_PARAMETERS = 48
FRAMES = ("I0", "01", "12", "23", "34", "45", "56", "6E")
TOOL = len(FRAMES) - 1  # body E in the count of the bodies

# How a parameter acts on the placement of its body.
OFFSET, SHIFT, BEFORE, AFTER = "offset", "shift", "before", "after"

_FREE = 0.1  # of a radian by which the axis of a joint moves, for a radian of what turns it
_LETTERS = ("alpha", "beta", "gamma")  # about x, y, z; the tool's ZYX Euler angles about z, y, x


@dataclass(frozen=True)
class ErrorParameter:
    """One error parameter.

    Attributes:
        name: for example ``p_q2``, ``pl_23x``, ``p_gamma2``, ``p_alpha_E``.
        kind: ``"offset"`` of a joint, ``"shift"`` of a frame along an axis of its parent, or rotation
            ``"before"`` or ``"after"`` the rotation of the joint.
        body: 0 for the base, 1 to 6 for the links, 7 for the tool.
        axis: 0, 1, 2 for x, y, z; of an offset the coordinate axis nearest to that of the joint.
    """

    name: str
    kind: str
    body: int
    axis: int

    @property
    def unit(self) -> str:
        """``"m"`` or ``"rad"``."""
        return "m" if self.kind == SHIFT else "rad"


def joint_axes(robot: RobotModel) -> list[int]:
    """The coordinate axis (0, 1, 2) of its link frame that each joint's axis is nearest to, six of them."""
    return np.argmax(np.abs(robot.axes), axis=1).tolist()


def error_parameters(robot: RobotModel) -> tuple[ErrorParameter, ...]:
    """All 48 parameters in their order: joint offsets, translations, rotations.

    A joint near axis k has rotation errors about the two other axes: about those that come before k in
    x, y, z ahead of the joint's rotation, about the others behind it. For a joint about y this is
    exp(x alpha) R exp(z gamma), Probst (2024) eq. (2.49), corrected. The base has all three rotations. The
    errors of the tool are added to its ZYX Euler angles, alpha about z, beta about y, gamma about x.

    Probst's frames are parallel where all joints are zero. In others, as in those of a UR10, an error ahead
    may turn what the joint before or an error behind that one turns already, and nothing would turn the axis
    the other way. Then another one acts ahead, or both do: there it is exp(z gamma) R exp(x alpha).
    """
    axes = joint_axes(robot)
    ahead = _turned_ahead(robot, axes)
    parameters = [ErrorParameter(f"p_q{i}", OFFSET, i, k) for i, k in enumerate(axes, 1)]
    for body, frame in enumerate(FRAMES):
        parameters += [ErrorParameter(f"pl_{frame}{'xyz'[k]}", SHIFT, body, k) for k in range(3)]
    parameters += [ErrorParameter(f"p_{_LETTERS[k]}0", BEFORE, 0, k) for k in range(3)]
    for i, own in enumerate(axes, 1):
        for k in range(3):
            if k != own:
                kind = BEFORE if k in ahead[i - 1] else AFTER
                parameters.append(ErrorParameter(f"p_{_LETTERS[k]}{i}", kind, i, k))
    parameters += [ErrorParameter(f"p_{_LETTERS[2 - k]}_E", BEFORE, TOOL, k) for k in (2, 1, 0)]
    return tuple(parameters)


def _turned_ahead(robot: RobotModel, axes: list[int]) -> list[set[int]]:
    """Of each joint the axes (0, 1, 2) of its frame about which a rotation error acts ahead of it."""
    chosen: list[set[int]] = []
    behind = {0, 1, 2}  # of the base
    for own, joint in zip(axes, robot.joints, strict=True):
        R, usual = joint.placement.pose().rotation().matrix(), {k for k in range(3) if k < own}
        across = {0, 1, 2} - {own}
        options = [usual, *({k} for k in sorted(across, reverse=True)), across]
        chosen.append(next((ahead for ahead in options if _is_free(R, own, behind, ahead)), usual))
        behind = {own} | (across - chosen[-1])
    return chosen


def _is_free(R: np.ndarray, own: int, behind: set[int], ahead: set[int]) -> bool:
    """Whether the axis of a joint is turned both ways.

    Args:
        R: its frame in that of the link before, (3, 3).
        own: the axis in its frame.
        behind: axes of the link before about which that joint, or an error behind it, turns.
        ahead: axes of its frame about which an error turns.
    """
    turns = np.column_stack([np.eye(3)[:, sorted(behind)], R[:, sorted(ahead)]])
    moves = np.cross(turns.T, R[:, own])
    return int(np.sum(np.linalg.svd(moves, compute_uv=False) > _FREE)) == 2


def parameter_names(robot: RobotModel) -> tuple[str, ...]:
    """The names of the 48 parameters in their order."""
    return tuple(parameter.name for parameter in error_parameters(robot))


def checked(p: np.ndarray) -> np.ndarray:
    """A parameter vector of shape (48,).

    Raises:
        ValueError: if it has another shape or is not finite.
    """
    p = np.asarray(p, dtype=float)
    if p.shape != (NUM_PARAMETERS,):
        raise ValueError(f"error parameters must have the shape ({NUM_PARAMETERS},), got {p.shape}")
    if not np.isfinite(p).all():
        raise ValueError(
            f"error parameters must be finite, number {np.flatnonzero(~np.isfinite(p))[0]} is not"
        )
    return p


# The parameters of a robot stand in joint order at the front of the vector.
OFFSETS = slice(0, NUM_JOINTS)
