"""Standard input data of a flexible body as text, as finite-element programs write them.

Wallrapp (1994): blocks within blocks, each from its name to ``end NAME``; matrices have dimensions, a
structure (0 zero, 1 diagonal, 2 symmetric, 3 full, 4 unit) and those of their entries that are not zero.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.dynamics.modal.flexible_body import FlexibleBody

_ENTRY = re.compile(r"^(\w+)\s*(?:\(([\d\s,]*)\))?\s*=\s*(.*)$")
_STRUCTURES = range(5)
_ORDERS = range(3)


class SidFileError(ValueError):
    """A file of standard input data is not what it should be; one line with file and line."""


@dataclass
class _Block:
    name: str
    line: int
    values: dict[tuple[str, tuple[int, ...]], tuple[str, int]] = field(default_factory=dict)
    blocks: list["_Block"] = field(default_factory=list)


def read_sid(path: Path) -> FlexibleBody:
    """The body of a file.

    Raises:
        OSError: if it cannot be read.
        SidFileError: if it is cut off, lacks something, or its dimensions do not fit.
    """
    return _Reader(path.name, path.read_text(encoding="utf-8", errors="replace").splitlines()).body()


class _Reader:
    """Makes a body of the lines of a file; what is wrong is refused with its line."""

    def __init__(self, name: str, lines: list[str]) -> None:
        self._name, self._lines = name, lines

    def body(self) -> FlexibleBody:
        tree = self._tree()
        if not tree.blocks:
            raise self._error(1, "no flexible body is in the file: it would begin with a line 'part'")
        modal = self._within(self._within(tree, "part"), "modal")
        about = self._within(modal, "refmod")
        n = int(self._number(about, "nelastq"))
        if n < 1:
            raise self._error(about.line, f"nelastq must be at least 1, got {n}")
        nodes = [block for block in self._within(modal, "frame").blocks if block.name == "node"]
        if not nodes:
            raise self._error(modal.line, "there are no nodes")
        for name in ("gr", "ge", "ksigma"):  # of first order here, but what is wrong is refused
            for block in modal.blocks:
                if block.name == name:
                    self._matrix(block, None, None, n)
        return FlexibleBody(
            self._number(about, "mass"),
            np.array([self._of(node, "origin", 3, 1, n)[:, 0] for node in nodes]),
            np.array([self._of(node, "phi", 3, n, n) for node in nodes]),
            self._of(modal, "mdcm", 3, 1, n)[:, 0],
            self._of(modal, "j", 3, 3, n),
            self._of(modal, "ct", n, 3, n),
            self._of(modal, "cr", n, 3, n),
            self._of(modal, "me", n, n, n),
            self._of(modal, "ke", n, n, n),
            self._of(modal, "de", n, n, n),
            self._turns(nodes, n),
            self._of(modal, "oe", n, 6, n) if any(each.name == "oe" for each in modal.blocks) else None,
        )

    def _turns(self, nodes: list[_Block], n: int) -> np.ndarray | None:
        """Rotations of the nodes, where all of them have some."""
        if not all(any(inner.name == "psi" for inner in node.blocks) for node in nodes):
            return None
        return np.array([self._of(node, "psi", 3, n, n) for node in nodes])

    def _tree(self) -> _Block:
        root = _Block("file", 1)
        stack = [root]
        for number, text in enumerate(self._lines, 1):
            line = text.strip()
            words = line.lower().split()
            if not words or (len(stack) == 1 and words[0] != "part"):  # remarks before the body
                continue
            entry = _ENTRY.match(line)
            if words[0] == "end":
                if len(stack) == 1 or (len(words) > 1 and words[1] != stack[-1].name):
                    raise self._error(number, f"'{line}' does not end '{stack[-1].name}'")
                stack.pop()
            elif entry is None:
                name = words[1].split("=")[0] if words[0] == "new" and len(words) > 1 else words[0]
                stack.append(_Block(name, number))
                stack[-2].blocks.append(stack[-1])
            else:
                places = tuple(int(place) for place in re.findall(r"\d+", entry[2] or ""))
                stack[-1].values[entry[1].lower(), places] = (entry[3].strip(), number)
        if len(stack) > 1:
            raise self._error(
                len(self._lines),
                f"the file ends within '{stack[-1].name}' of line {stack[-1].line}: cut off?",
            )
        return root

    def _within(self, block: _Block, name: str) -> _Block:
        for inner in block.blocks:
            if inner.name == name:
                return inner
        raise self._error(block.line, f"'{block.name}' has no '{name}'")

    def _of(self, block: _Block, name: str, rows: int, columns: int, n: int) -> np.ndarray:
        return self._matrix(self._within(block, name), rows, columns, n)

    def _matrix(self, block: _Block, rows: int | None, columns: int | None, n: int) -> np.ndarray:
        """The part of order zero; what is of first order must fit, too."""
        found = {key: int(self._number(block, key)) for key in ("order", "nrow", "ncol", "nq", "structure")}
        wanted = {"nrow": rows, "ncol": columns, "nq": n}
        for key, value in wanted.items():
            if value is not None and found[key] != value:
                raise self._error(block.line, f"{block.name}: {key} must be {value}, got {found[key]}")
        for key, allowed in (("order", _ORDERS), ("structure", _STRUCTURES)):
            if found[key] not in allowed:
                raise self._error(
                    block.line, f"{block.name}: {key} must be 0 to {allowed[-1]}, got {found[key]}"
                )
        shape = found["nrow"], found["ncol"]
        if found["structure"] in (1, 2) and shape[0] != shape[1]:
            raise self._error(
                block.line,
                f"{block.name}: structure {found['structure']} is for square matrices, got "
                f"{shape[0]} x {shape[1]}",
            )
        matrix = np.eye(*shape) if found["structure"] == 4 else np.zeros(shape)
        for (key, places), (text, line) in block.values.items():
            sizes = {"m0": shape, "m1": (shape[0], n, shape[1])}.get(key)
            if sizes is None:
                continue
            if len(places) != len(sizes) or not all(
                1 <= p <= size for p, size in zip(places, sizes, strict=True)
            ):
                raise self._error(
                    line, f"{block.name}: {key}{places} is outside of {' x '.join(map(str, sizes))}"
                )
            value = self._value(text, line)
            if key == "m0":
                matrix[places[0] - 1, places[1] - 1] = value
                if found["structure"] == 2:
                    matrix[places[1] - 1, places[0] - 1] = value
        return matrix

    def _number(self, block: _Block, key: str) -> float:
        if (key, ()) not in block.values:
            raise self._error(block.line, f"'{block.name}' has no '{key}'")
        return self._value(*block.values[key, ()])

    def _value(self, text: str, line: int) -> float:
        try:
            value = float(text.upper().replace("D", "E"))
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise self._error(line, f"'{text}' is not a number")
        return value

    def _error(self, line: int, what: str) -> SidFileError:
        return SidFileError(f"standard input data {self._name}, line {line}: {what}")


def sid_text(body: FlexibleBody) -> str:
    """A body as the text that `read_sid` reads."""
    n = len(body.Me)
    lines = ["part", "new modal", "refmod", f"mass = {body.mass!r}", f"nelastq = {n}"]
    lines += [f"ielastq ({i}) = Eigen Mode {i}" for i in range(1, n + 1)]
    lines += ["end refmod", "frame"]
    for number, (place, shape) in enumerate(zip(body.places, body.shapes, strict=True), 1):
        lines += [f"new node = {number}", "rframe = body ref", *_block("origin", place[:, None], n)]
        turn = [] if body.turns is None else _block("psi", body.turns[number - 1], n)
        lines += [*_block("phi", shape, n), *turn, "end node"]
    lines += ["end frame"]
    for name, matrix in (
        ("mdCM", body.first_moment[:, None]),
        ("J", body.inertia),
        ("Ct", body.Ct),
        ("Cr", body.Cr),
        ("Me", body.Me),
        ("Oe", body.Oe),
        ("Ke", body.Ke),
        ("De", body.De),
    ):
        lines += _block(name, matrix, n) if matrix is not None else []
    return "\n".join([*lines, "end modal", "end part", ""])


def _block(name: str, matrix: np.ndarray, n: int) -> list[str]:
    rows, columns = matrix.shape
    head = {"order": 0, "nrow": rows, "ncol": columns, "nq": n, "nqn": 0, "structure": 3}
    entries = [
        f"m0 ({i + 1},{j + 1}) = {float(matrix[i, j])!r}" for i, j in zip(*np.nonzero(matrix), strict=True)
    ]
    return [name, *(f"{key} = {value}" for key, value in head.items()), *entries, f"end {name}"]
