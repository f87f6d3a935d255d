"""The torques of drive trains at one instant, compiled: an integrator asks for them at every stage of a step.

The formulas of the parts stand, with their sources, in the classes of this folder; a test holds both to each
other. `DriveTrains` imports this module when it is asked first, see `robots.compiled`.
"""

import math

from robots.compiled import compiled, inner
from robots.drivetrain.backlash import CONTACT_DEPTH
from robots.drivetrain.train_table import (
    EXPONENTIAL,
    LIMITED,
    POLYNOMIAL,
    SIGMOID,
    STRIBECK,
    TANH,
)


@inner
def _spring(spring, x):
    """What a `GearSpring` takes in N m at a deflection in rad."""
    kind, c_0, gamma, c_max, sharpness = spring
    if kind == EXPONENTIAL:
        return x * (c_0 + (c_max - c_0) * (1.0 - math.exp(-gamma * abs(x))))
    cubic = c_0 * (1.0 + gamma * x * x)
    if kind == LIMITED:
        beyond = math.atan((cubic - c_max) * sharpness) / math.pi
        share = math.atan(cubic * sharpness) / math.pi - beyond
        return x * (cubic * share + c_max * (beyond + 0.5))
    return x * cubic


@inner
def _position_error(waves, steps, theta):
    """`FourierRatio.position_error` of one gear; waves (k, 3): amplitude over the ratio, frequency, phase."""
    lead = theta
    for _ in range(steps):
        excess, slope = lead - theta, 1.0
        for weight, frequency, phase in waves:
            angle = frequency * lead + phase
            excess += weight / frequency * math.sin(angle)
            slope += weight * math.cos(angle)
        lead -= excess / slope
    slope = 1.0
    for weight, frequency, phase in waves:
        slope += weight * math.cos(frequency * lead + phase)
    return lead - theta, 1.0 / slope - 1.0


@inner
def _loss(efficiency, load, speed):
    """`DirectionalEfficiency.loss`; the last number is the least efficiency."""
    forward, backward, forward_per_speed, backward_per_speed, rest_width, least = efficiency
    forward = min(max(forward - forward_per_speed * abs(speed), least), 1.0)
    backward = min(max(backward - backward_per_speed * abs(speed), least), 1.0)
    share = 1.0 / forward - 1.0 if load * speed > 0.0 else 1.0 - backward
    return share * abs(load) * math.tanh(speed / rest_width)


@inner
def _friction(kind, part, v, applied, inertia):
    """What a friction takes in N m at a speed in rad/s; one that holds depends on what else is applied."""
    if kind == SIGMOID:
        return part[0] * v + part[1] * math.tanh(0.5 * part[2] * v)
    if kind == TANH:
        return part[0] * v + part[1] * math.tanh(v / part[2])
    if kind == STRIBECK:
        return part[0] * v + part[1] * math.tanh(0.5 * part[2] * v) + v / (part[3] * v * v + part[4])
    if kind == POLYNOMIAL:
        speed = abs(v)
        if speed > 1.0:
            found = part[3] + part[4] * (speed - 1.0)
        elif speed >= part[2]:
            found = ((part[5] * speed + part[6]) * speed + part[7]) * speed + part[8]
        else:
            found = part[0] * math.tanh(0.5 * part[1] * speed)
        return found if v > 0.0 else -found
    viscous, coulomb, breakaway, stribeck_velocity, stopping_time = part[:5]
    driving = applied if applied * v >= 0.0 else 0.0
    needed = driving + inertia / stopping_time * v
    limit = coulomb + (breakaway - coulomb) * math.exp(-((v / stribeck_velocity) ** 2))
    return min(max(needed, -limit), limit) + viscous * v


@compiled
def torques(table, state, motor, deflection, command, viscous, out):
    """The torques at an instant, see `robots.drivetrain.train.DriveTrains`.

    Args:
        table: `TrainTable` of n joints.
        state: (num_states,).
        motor: positions in rad, then velocities in rad/s, (2 n,).
        deflection: q - theta in rad, then its rates in rad/s, (2 n,).
        command: what the motors are told to give in N m, (n,).
        viscous: what of the friction others take from the motors, N m s / rad, (n,).
        out: is written: what is taken from the torques that motors are told to give, what acts on the links,
            both in N m, and the rates of the states; (2 n + num_states,).
    """
    n, elements = len(command), table.elements.shape[2]
    soft_at, elements_at = table.soft_at, table.elements_at
    on_motor = out[:n]
    for j in range(n):
        speed, x, rate, slope = motor[n + j], deflection[j], deflection[n + j], 1.0
        if table.waves.shape[1]:
            error, change = _position_error(table.waves[j], table.newton_steps, motor[j])
            x, rate, slope = x - error, rate - change * speed, 1.0 + change
        damping, half_gap, lubricant, soft, damped, soft_damping = table.gears[j]
        beyond = x - min(max(x, -half_gap), half_gap)
        torque = _spring(table.springs[j], beyond)
        if half_gap > 0.0:
            torque += damping * rate * min(abs(beyond) / CONTACT_DEPTH, 1.0)
            if not torque * beyond > 0.0:
                torque = 0.0
        else:
            torque += damping * rate
        torque += lubricant * rate
        if soft_at >= 0:
            stretch = soft * (x - state[soft_at + j])
            torque += stretch
            out[2 * n + soft_at + j] = (stretch - damped * state[soft_at + j]) / soft_damping
        for k in range(elements):
            at = elements_at + elements * j + k
            torque += table.elements[0, j, k] * state[at]
            out[2 * n + at] = rate - abs(rate) * state[at] / table.elements[1, j, k]
        out[n + j] = -torque
        lag, torque_unit = table.motors[j, 0], table.motors[j, 1]
        on_motor[j] = slope * torque
        if table.has_efficiency:
            on_motor[j] -= _loss(table.efficiencies[j], -on_motor[j], speed)
        drive = command[j]
        if table.has_lag:
            late = torque_unit * state[j]
            out[2 * n + j] = (command[j] - late) / ((lag if lag > 0.0 else 1.0) * torque_unit)
            drive = late if lag > 0.0 else command[j]
        on_motor[j] += drive
    for row in table.frictions:
        j = int(row[0])
        on_motor[j] -= _friction(row[1], row[2:], motor[n + j], on_motor[j], table.motors[j, 2])
    for j in range(n):
        on_motor[j] = command[j] - viscous[j] * motor[n + j] - on_motor[j]
