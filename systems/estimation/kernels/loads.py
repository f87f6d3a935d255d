"""Newton and Euler's equations from the base to the flange and back, compiled."""

import math

import numpy as np

from robots.compiled import compiled, inner

GRAVITY = 9.81  # m/s^2, as Drake has it


@inner
def _turned(R, v, out):
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]


@inner
def _turned_back(R, v, out):
    for i in range(3):
        out[i] = R[0, i] * v[0] + R[1, i] * v[1] + R[2, i] * v[2]


@inner
def _add_cross(a, b, out):
    """``out += a x b``."""
    out[0] += a[1] * b[2] - a[2] * b[1]
    out[1] += a[2] * b[0] - a[0] * b[2]
    out[2] += a[0] * b[1] - a[1] * b[0]


@inner
def _copy(a, out):
    for i in range(3):
        out[i] = a[i]


@inner
def _acceleration(w, alpha, r, out):
    """What a way r from the origin of a turning body adds to the acceleration, alpha x r + w x (w x r)."""
    x, y, z = w[1] * r[2] - w[2] * r[1], w[2] * r[0] - w[0] * r[2], w[0] * r[1] - w[1] * r[0]
    _add_cross(alpha, r, out)
    out[0] += w[1] * z - w[2] * y
    out[1] += w[2] * x - w[0] * z
    out[2] += w[0] * y - w[1] * x


@inner
def _body(masses, k, frame, motion, total, room):
    """Adds force and moment about the world's origin, (2, 3), that a body k needs.

    Args:
        masses: `Masses`.
        k: the body.
        frame: of its link, (4, 4).
        motion: angular velocity, its derivative, and acceleration of the link's origin, (3, 3) rows.
        total: (2, 3).
        room: (6, 3), for what is worked out on the way.
    """
    m, w, alpha = masses.mass[k], motion[0], motion[1]
    centre, force, own = room[0], room[1], room[2]
    momentum, couple, turned = room[3], room[4], room[5]
    _turned(frame, masses.centres[k], centre)
    _copy(motion[2], force)
    _acceleration(w, alpha, centre, force)
    for i in range(3):
        force[i] *= m
        centre[i] += frame[i, 3]
        total[0, i] += force[i]
    _add_cross(centre, force, total[1])
    # Euler's equation in the axes of the link, where the inertia is constant.
    _turned_back(frame, alpha, own)
    _turned(masses.inertia[k], own, couple)
    _turned_back(frame, w, own)
    _turned(masses.inertia[k], own, momentum)
    _add_cross(own, momentum, couple)
    _turned(frame, couple, turned)
    for i in range(3):
        total[1, i] += turned[i]


@inner
def _counterbalance(spring, q):
    """`robots.drivetrain.counterbalance.Counterbalance.torque` at rest."""
    preload, stiffness, base, arm = spring[1], spring[0], spring[2], spring[3]
    angle, lateral, shortest = q - spring[4], spring[5], spring[6]
    length = math.sqrt(base * base + arm * arm - 2.0 * base * arm * math.cos(angle) + lateral**2)
    return -(preload + stiffness * (length - shortest)) * base * arm * math.sin(angle) / length


@compiled
def load(masses, frames, q, velocity, acceleration, loads):
    """Loads of one configuration.

    Args:
        masses: `Masses`.
        frames: of the world and the links in the world, (7, 4, 4).
        q, velocity, acceleration: of the joints, (6,).
        loads: (5, 18) as `systems.estimation.arm_loads.ArmLoads.at` gives them, is written.
    """
    motion = np.zeros((6, 3, 3))  # of the links
    w, alpha, a, way = np.zeros(3), np.zeros(3), np.zeros(3), np.empty(3)
    spin, axis, about, room = np.empty(3), np.empty(3), np.empty((5, 3)), np.empty((6, 3))
    a[2] = GRAVITY
    for i in range(6):
        if i > 0:
            for k in range(3):
                way[k] = frames[i + 1, k, 3] - frames[i, k, 3]
            _acceleration(w, alpha, way, a)
        _turned(frames[i + 1], masses.axes[i, 0], axis)
        for k in range(3):
            spin[k] = axis[k] * velocity[i]
            w[k] += spin[k]
            alpha[k] += axis[k] * acceleration[i]
        _add_cross(w, spin, alpha)
        _copy(w, motion[i, 0])
        _copy(alpha, motion[i, 1])
        _copy(a, motion[i, 2])
    flange = frames[6]
    wrench = np.zeros((5, 2, 3))  # force, and moment about the world's origin
    # A mass m at c exerts m (a + A c) and the moment c x m (a + A c) about the flange. With a way d from c
    # that changes by d x m (a + A c) + c x m A d.
    centre, there = room[0], about[0]
    _turned(flange, masses.centres[6], centre)
    _copy(a, there)
    _acceleration(w, alpha, centre, there)
    for s in range(3):
        for k in range(3):
            axis[k], way[k] = flange[k, s], flange[k, 3] + centre[k]
        _acceleration(w, alpha, axis, wrench[2 + s, 0])
        _add_cross(way, wrench[2 + s, 0], wrench[2 + s, 1])
        _add_cross(axis, there, wrench[2 + s, 1])
    for body in range(6, -1, -1):
        i = min(body, 5)
        frame = frames[i + 1]
        _body(masses, body, frame, motion[i], wrench[1 if body == 6 else 0], room)
        if body == 6:
            continue
        for k in range(3):
            way[k] = frame[k, 3]
        for s in range(5):
            _copy(wrench[s, 1], about[s])
            _add_cross(wrench[s, 0], way, about[s])
        for j in range(3):
            _turned(frame, masses.axes[i, j], axis)
            column = i if j == 0 else 5 + 2 * i + j
            for s in range(5):
                loads[s, column] = axis[0] * about[s, 0] + axis[1] * about[s, 1] + axis[2] * about[s, 2]
    if masses.spring[0] > 0.0:
        loads[0, 1] -= _counterbalance(masses.spring, q[1])


@compiled
def load_all(masses, frames, q, velocity, acceleration, loads):
    """`load` for n configurations."""
    for i in range(len(frames)):
        load(masses, frames[i], q[i], velocity[i], acceleration[i], loads[i])


@compiled
def hold(masses, payload, frames, q, torques):
    """What holds an arm at rest: the torques in N m of its six motors, without what bends.

    Args:
        masses: `Masses`.
        payload: kg.
        frames, q: as of `load`.
        torques: (6,), is written.
    """
    mass = x = y = 0.0  # of all that is carried, and its first moment
    for body in range(6, -1, -1):
        i, m = min(body, 5), masses.mass[body] * (payload if body == 6 else 1.0)
        R, centre, axis = frames[i + 1], masses.centres[body], masses.axes[i, 0]
        mass += m
        x += m * (R[0, 0] * centre[0] + R[0, 1] * centre[1] + R[0, 2] * centre[2] + R[0, 3])
        y += m * (R[1, 0] * centre[0] + R[1, 1] * centre[1] + R[1, 2] * centre[2] + R[1, 3])
        about_x = R[0, 0] * axis[0] + R[0, 1] * axis[1] + R[0, 2] * axis[2]
        about_y = R[1, 0] * axis[0] + R[1, 1] * axis[1] + R[1, 2] * axis[2]
        torques[i] = GRAVITY * (about_x * (y - mass * R[1, 3]) - about_y * (x - mass * R[0, 3]))
    if masses.spring[0] > 0.0:
        torques[1] -= _counterbalance(masses.spring, q[1])
