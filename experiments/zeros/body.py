"""Zeros of a joint that turns a flexible body of a file: which of its nodes have a stable inverse."""

from pathlib import Path

import numpy as np

from experiments.report.plot_page import Section, html_table
from experiments.zeros.example import Example
from experiments.zeros.plots import plane_figure, zeros_note
from experiments.zeros.study import one_json
from robots.dynamics.modal.sid_file import read_sid


def body_zeros(path: Path, load: float) -> Example:
    """Zeros from the torque of a joint about z to the nodes of a body, with a load (kg) at the last one.

    Raises:
        OSError, SidFileError: if the file cannot be read or is not what it should be.
        ValueError: if the load is negative.
    """
    if not load >= 0.0:
        raise ValueError(f"--payload must not be negative, got {load:g}")
    body = read_sid(path)
    away = np.hypot(body.places[:, 0], body.places[:, 1])
    zeros = {node: body.zeros(node, load) for node in map(int, np.flatnonzero(away > 1e-9 * away.max()))}
    hertz = body.frequencies() / (2.0 * np.pi)
    rows = []
    for node, each in zeros.items():
        slowest = "-" if each.slowest_rhp is None else f"{each.slowest_rhp:.4g}"
        rows.append([f"{node + 1}", f"{away[node]:.4f}", slowest])
    # Finite-element programs number nodes in any order.
    unstable = sorted(
        (node for node, each in zeros.items() if not each.is_minimum_phase), key=away.__getitem__
    )
    outputs = f"{len(unstable)} of {len(zeros)} nodes as its output" if unstable else "no node as its output"
    nearest = (
        f", the nearest is node {unstable[0] + 1}, {away[unstable[0]]:.3f} m from it" if unstable else ""
    )
    verdict = (
        f"{path.name}: {len(hertz)} modes from {hertz[0]:.4g} Hz, {body.mass:.4g} kg and {load:g} kg at the "
        f"last of {len(away)} nodes; turned by a joint about z, the exact inverse is unstable with {outputs}"
        f"{nearest}."
    )
    last = zeros[max(zeros)]
    note = "Across the line from the joint to the node; - where the inverse is stable."
    head = ("node", "from the joint in m", "slowest zero in the right half-plane in 1/s")
    sections = [
        Section("Nodes", note, html_table(head, rows)),
        Section("Zeros of the last node", zeros_note(last), plane_figure(last)),
    ]
    numbers = {
        "body": path.name,
        "load_kg": load,
        "frequencies_hz": hertz.tolist(),
        **one_json(last),
        "nodes": {str(node + 1): each.slowest_rhp for node, each in zeros.items()},
    }
    return Example(numbers, verdict, sections)
