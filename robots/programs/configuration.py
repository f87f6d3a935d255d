"""Which of its many configurations a robot takes at a pose: what ABB and KUKA write beside it.

ABB counts quarters of a turn of axes 1, 4 and 6 (``cf1``, ``cf4``, ``cf6``: 0 for 0 to 90 degrees, -1 for
-90 to 0) and numbers the branches (``cfx``). KUKA has a bit per axis that is set where its angle is negative
(``turn``), and one each for the wrist behind axis 1, the bent elbow and a negative axis 5 (``status``).
Quarters and turns select a configuration; branches, which makers count in different ways for some robots,
decide only where these leave a choice.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from robots.programs.program import Literal, Target

_TURN, _QUARTER = 2.0 * math.pi, 0.5 * math.pi
_ON_EDGE = 1e-6  # rad, this near to a change of the number it may be either
_COUNTED = {"cf1": 0, "cf4": 3, "cf6": 5}  # joints by role

Branch = tuple[bool, bool, bool]  # wrist behind axis 1, forearm behind the upper arm, axis 5 negative


def differences(target: Target, q: Sequence[float], branch: Branch | None) -> tuple[int, int]:
    """How many numbers of a target's configuration another one has: of quarters or turns, and of branches."""
    numbers, certain, likely = target.numbers, 0, 0
    for role, joint in _COUNTED.items():
        if role in numbers:
            certain += int(numbers[role].value) not in _nearby(_quarter, q[joint])
    if "turn" in numbers:
        turn = int(numbers["turn"].value)
        certain += sum((turn >> joint & 1) not in _nearby(_is_negative, q[joint]) for joint in range(6))
    if branch is not None:
        behind, low, negative = branch
        if "cfx" in numbers:
            likely += (int(numbers["cfx"].value) ^ (4 * behind + 2 * low + negative)).bit_count()
        if "status" in numbers:
            likely += (int(numbers["status"].value) & 7 ^ (behind + 2 * (not low) + 4 * negative)).bit_count()
    return certain, likely


def says_configuration(target: Target) -> bool:
    """Whether a target has quarters or turns."""
    return bool({"cf1", "turn"} & target.numbers.keys())


def rewritten(target: Target, before: Sequence[float], after: Sequence[float]) -> dict[Literal, str]:
    """The numbers that change where a joint, moving a little, comes into another quarter or half.

    Only numbers that were right are changed. Whether the wrist is behind or the elbow bent cannot change by
    little; the sign of axis 5 can.
    """
    edits, numbers = {}, target.numbers
    for role, joint in _COUNTED.items():
        if role not in numbers:
            continue
        written = int(numbers[role].value)
        was_right, is_right = (written in _nearby(_quarter, q[joint]) for q in (before, after))
        if was_right and not is_right:
            edits[numbers[role]] = str(_quarter(after[joint]))
    if "turn" in numbers:
        turn = new = int(numbers["turn"].value)
        for joint in range(6):
            bit = turn >> joint & 1
            if bit in _nearby(_is_negative, before[joint]) and bit not in _nearby(_is_negative, after[joint]):
                new ^= 1 << joint
        if new != turn:
            edits[numbers["turn"]] = str(new)
    for role, bit in (("cfx", 1), ("status", 4)):
        if role in numbers and _is_negative(before[4]) != _is_negative(after[4]):
            old = int(numbers[role].value)
            if bool(old & bit) == bool(_is_negative(before[4])):
                edits[numbers[role]] = str(old ^ bit)
    return edits


def turns_within(q: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> list[list[float]]:
    """The same configuration with joints turned by full turns, as far as limits allow, all in rad."""
    choices = []
    for angle, least, most in zip(q.tolist(), lower.tolist(), upper.tolist(), strict=True):
        first, last = math.ceil((least - angle - 1e-9) / _TURN), math.floor((most - angle + 1e-9) / _TURN)
        choices.append([angle + k * _TURN for k in range(first, last + 1)])
    return [list(each) for each in product(*choices)]


def in_words(target: Target, numbers: Mapping[str, Literal]) -> str:
    """The configuration as the maker writes it; empty where the target says none."""
    if "cf1" in target.numbers:
        return " ".join(f"{int(numbers[role].value)}" for role in ("cf1", "cf4", "cf6", "cfx"))
    shown = [
        f"{role[0].upper()} {int(numbers[role].value)}" for role in ("status", "turn") if role in numbers
    ]
    return " ".join(shown)


def _quarter(angle: float) -> int:
    return math.floor(angle / _QUARTER)


def _is_negative(angle: float) -> int:
    return int(angle < 0.0)


def _nearby(count, angle: float) -> set[int]:
    """What a count may be at an angle that may stand on an edge."""
    return {count(angle - _ON_EDGE), count(angle + _ON_EDGE)}
