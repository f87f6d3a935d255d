"""Planned motions as a robot program: moves with the durations or speeds that controllers take.

A controller times a move by itself, so a program cannot have the planned course of the speed. RAPID takes the
duration; KRL takes the largest speed and an acceleration, and these are chosen so that a move that
speeds up evenly, goes on and brakes evenly takes as long as the planned one and is as fast.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.programs.measurement_run import EXTERNAL, krl_axes, listed, spelled

_FASTEST_KRL = 3.0  # m/s, the largest $VEL.CP
_NAME = "plan"
FILES = {"rapid": f"{_NAME}.mod", "krl": f"{_NAME}.src"}  # by language
_TURN = 1e-4  # rad, of the tool along a line: less does not count


@dataclass(frozen=True)
class PlannedMove:
    """One motion from rest to rest.

    Attributes:
        name: for people.
        q: where it begins and ends, in rad, shape (2, 6).
        duration: s.
        joint_speed: of each joint over what it may be, the largest, shape (6,).
        joint_acceleration: likewise.
        is_straight: whether the tool goes along a line; else the joints go in proportion.
        way: of the tool along a line, in the base of the robot, in m, shape (3,).
        turn: of the tool along the line, in rad.
        speed: of the tool, the largest, in m/s.
    """

    name: str
    q: np.ndarray
    duration: float
    joint_speed: np.ndarray
    joint_acceleration: np.ndarray
    is_straight: bool
    way: np.ndarray
    turn: float
    speed: float


def even_acceleration(length: float, speed: float, duration: float) -> tuple[float, float]:
    """Speed and acceleration of a move that speeds up and brakes evenly and takes a given time.

    Args:
        length: m.
        speed: m/s, that it shall have in between.
        duration: s.

    Returns:
        The speed, which is at most twice the mean one, in m/s, and the acceleration in m/s^2.
    """
    speed = min(speed, 2.0 * length / duration)
    return speed, speed / (duration - length / speed)


def rapid_moves(moves: Sequence[PlannedMove]) -> dict[str, str]:
    """A RAPID module by the name of its file. Raises ValueError if a line turns the tool."""
    _refuse_turns(moves)
    lines = [f"MODULE {_NAME}", "    ! Planned motions; \\T is the duration of each in s."]
    for number, q in enumerate(_stops(moves)):
        lines.append(f"    CONST jointtarget p{number} := [[{listed(np.rad2deg(q))}],{EXTERNAL}];")
    lines += [f"    PROC {_NAME}_run()", "        MoveAbsJ p0, v200, fine, tool0;"]
    for number, move in enumerate(moves, 1):
        kind, to = ("MoveL", f"CalcRobT(p{number},tool0)") if move.is_straight else ("MoveAbsJ", f"p{number}")
        lines.append(f"        {kind} {to}, vmax\\T:={move.duration:.3f}, fine, tool0; ! {move.name}")
    return {FILES["rapid"]: "\n".join([*lines, "    ENDPROC", "ENDMODULE", ""])}


def krl_moves(moves: Sequence[PlannedMove]) -> dict[str, str]:
    """A KRL source by the name of its file.

    Raises:
        ValueError: if a line turns the tool, or is faster than KRL allows.
    """
    _refuse_turns(moves)
    lines = [
        f"DEF {_NAME}()",
        "; Planned motions. Speeds and accelerations are such that evenly accelerated moves take as long.",
        "BAS(#INITMOV,0)",
        "$TOOL=$NULLFRAME",
        "$BASE=$NULLFRAME",
        "BAS(#VEL_PTP,20)",
        f"PTP {krl_axes(np.rad2deg(moves[0].q[0]))}",
    ]
    for move in moves:
        lines.append(f"; {move.name}, {move.duration:.3f} s")
        if move.is_straight:
            speed, acceleration = even_acceleration(
                float(np.linalg.norm(move.way)), move.speed, move.duration
            )
            if speed > _FASTEST_KRL:
                raise ValueError(
                    f"{move.name}: KRL takes at most {_FASTEST_KRL:g} m/s along a line, the plan has "
                    f"{speed:.2f} m/s; plan with --tool-speed {_FASTEST_KRL:g}"
                )
            x, y, z = (spelled(1e3 * each) for each in move.way.tolist())
            lines += [f"$VEL.CP={speed:.4f}", f"$ACC.CP={acceleration:.4f}"]
            lines.append(f"LIN_REL {{X {x},Y {y},Z {z}}} #BASE")
        else:
            speed, acceleration = move.joint_speed.max(), move.joint_acceleration.max()
            lines += [f"BAS(#VEL_PTP,{_percent(speed)})", f"BAS(#ACC_PTP,{_percent(acceleration)})"]
            lines.append(f"PTP {krl_axes(np.rad2deg(move.q[1]))}")
    return {FILES["krl"]: "\n".join([*lines, "END", ""])}


MOVES = {"rapid": rapid_moves, "krl": krl_moves}


def _stops(moves: Sequence[PlannedMove]) -> list[np.ndarray]:
    return [moves[0].q[0], *(move.q[1] for move in moves)]


def _percent(share: float) -> int:
    return int(np.clip(np.ceil(100.0 * share - 1e-6), 1, 100))


def _refuse_turns(moves: Sequence[PlannedMove]) -> None:
    """These programs move the flange, which goes as far as the tool only where the tool does not turn."""
    for move in moves:
        if move.is_straight and abs(move.turn) > _TURN:
            raise ValueError(
                f"{move.name}: a line that turns the tool, here by {np.rad2deg(move.turn):.3g} deg, cannot "
                "be written as a program; --write has it"
            )
