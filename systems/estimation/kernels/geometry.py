"""Poses of the links and the tool, and how the tool moves with every parameter, compiled."""

import math

import numpy as np

from robots.compiled import compiled, inner
from systems.estimation.kernels.arrays import SHIFTS, TURNS_BEFORE, TURNS_BEHIND
from systems.estimation.kernels.poses import multiply


@inner
def _turn(R, axis, angle):
    """R exp(axis~ angle) for a coordinate axis, in place."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    s, c = math.sin(angle), math.cos(angle)
    for k in range(3):
        a, b = R[k, i], R[k, j]
        R[k, i], R[k, j] = c * a + s * b, c * b - s * a


@inner
def _reset(R, origin):
    for i in range(3):
        origin[i] = 0.0
        for j in range(3):
            R[i, j] = 1.0 if i == j else 0.0


@inner
def _note(column, R, axis, origin, axes, points):
    if column >= 0:
        for k in range(3):
            axes[column, k], points[column, k] = R[k, axis], origin[k]


@compiled
def fill_constants(drawing, c):
    """Works out all of `Constants` but p and frame; the arrays are zero before."""
    number = len(drawing.axes)
    axes, points = np.empty((number, 3)), np.zeros((number, 3))
    for j in range(number):
        for k in range(3):
            axes[j, k] = drawing.axes[j, k]
    R, product, origin, length = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    _reset(R, origin)
    e, entries = 0, drawing.entries
    for body in range(8):
        for k in range(3):
            length[k] = drawing.translation[body, k]
        while e < len(entries) and entries[e, 1] == body and entries[e, 2] == SHIFTS:
            _note(entries[e, 4], R, entries[e, 3], origin, axes, points)
            length[entries[e, 3]] += c.p[entries[e, 0]]
            e += 1
        for k in range(3):
            origin[k] += R[k, 0] * length[0] + R[k, 1] * length[1] + R[k, 2] * length[2]
        multiply(R, drawing.rotation[body], product)
        R, product = product, R
        while e < len(entries) and entries[e, 1] == body and entries[e, 2] == TURNS_BEFORE:
            _note(entries[e, 4], R, entries[e, 3], origin, axes, points)
            _turn(R, entries[e, 3], c.p[entries[e, 0]] + drawing.nominal[entries[e, 0]])
            e += 1
        if body == 0:
            continue
        if body == 7:
            for k in range(3):
                c.tool[k, 3] = origin[k]
                for j in range(3):
                    c.tool[k, j] = R[k, j]
            break
        multiply(R, drawing.joint_turns[0, body - 1], c.along[body - 1])
        multiply(R, drawing.joint_turns[1, body - 1], c.sine[body - 1])
        multiply(R, drawing.joint_turns[2, body - 1], c.cosine[body - 1])
        for k in range(3):
            c.along[body - 1, k, 3] = origin[k]
        _reset(R, origin)
        while e < len(entries) and entries[e, 1] == body and entries[e, 2] == TURNS_BEHIND:
            _note(entries[e, 4], R, entries[e, 3], origin, axes, points)
            _turn(R, entries[e, 3], c.p[entries[e, 0]] + drawing.nominal[entries[e, 0]])
            e += 1
    for j in range(number):
        a, b = axes[j], points[j]
        if drawing.is_shift[j]:
            for k in range(3):
                c.way[j, k] = a[k]
            continue
        for k in range(3):
            c.turn[j, k] = a[k]
        c.way[j, 0] = a[2] * b[1] - a[1] * b[2]
        c.way[j, 1] = a[0] * b[2] - a[2] * b[0]
        c.way[j, 2] = a[1] * b[0] - a[0] * b[1]


@inner
def place_links(c, q, X_WE, frames):
    """The poses of `place` without its columns."""
    step = np.empty((3, 4))
    for k in range(4):
        for j in range(4):
            frames[0, k, j] = 1.0 if j == k else 0.0
    for i in range(7):
        if i < 6:
            angle = q[i] + c.p[i]
            s, co = math.sin(angle), math.cos(angle)
            for k in range(3):
                for j in range(4):
                    step[k, j] = c.along[i, k, j] + s * c.sine[i, k, j] + co * c.cosine[i, k, j]
        else:
            for k in range(3):
                for j in range(4):
                    step[k, j] = c.tool[k, j]
        here, there = frames[i], frames[i + 1] if i < 6 else X_WE
        multiply(here, step, there)
        for k in range(3):
            there[k, 3] = (
                here[k, 0] * step[0, 3] + here[k, 1] * step[1, 3] + here[k, 2] * step[2, 3] + here[k, 3]
            )
            there[3, k] = 0.0
        there[3, 3] = 1.0


@compiled
def place(c, q, X_WE, frames, columns):
    """Poses and columns of one configuration.

    Args:
        c: `Constants`.
        q: joints behind the gears in rad, (6,).
        X_WE: the tool, (4, 4), is written.
        frames: of the world and the links, (7, 4, 4), likewise.
        columns: (6, C), likewise.
    """
    place_links(c, q, X_WE, frames)
    for j in range(columns.shape[1]):
        R = frames[c.frame[j]]
        x, y, z = c.turn[j, 0], c.turn[j, 1], c.turn[j, 2]
        a = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z
        b = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
        d = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z
        u, v, w = X_WE[0, 3] - R[0, 3], X_WE[1, 3] - R[1, 3], X_WE[2, 3] - R[2, 3]
        x, y, z = c.way[j, 0], c.way[j, 1], c.way[j, 2]
        columns[0, j], columns[1, j], columns[2, j] = a, b, d
        columns[3, j] = b * w - d * v + (R[0, 0] * x + R[0, 1] * y + R[0, 2] * z)
        columns[4, j] = d * u - a * w + (R[1, 0] * x + R[1, 1] * y + R[1, 2] * z)
        columns[5, j] = a * v - b * u + (R[2, 0] * x + R[2, 1] * y + R[2, 2] * z)


@compiled
def place_all(c, q, X_WE, frames, columns):
    """`place` for n configurations."""
    for i in range(len(q)):
        place(c, q[i], X_WE[i], frames[i], columns[i])
