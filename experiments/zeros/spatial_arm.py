"""An arm with three axes whose forearm bends in two planes and twists under a load beside its line.

Reiner (2010), section 3.7, figures 3.16 to 3.18: what load and clamp of the beam do while the axes move as
prescribed, by what the equations of the beam leave out; and the zeros from the axes to the load.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from experiments.report.plot_page import Section, html_table
from experiments.zeros.example import Example
from experiments.zeros.plots import plane_figure, time_figure, zeros_note
from experiments.zeros.runge_kutta import march
from experiments.zeros.study import one_json
from robots.dynamics.modal.arm_equations import NOMINAL, VARIANTS, Terms
from robots.dynamics.modal.modal_body import rigid_body
from robots.dynamics.modal.rayleigh_beam import RayleighBeam
from robots.dynamics.modal.spatial_arm import SpatialArm, SpatialLink
from robots.dynamics.transmission_zeros import Zeros, transmission_zeros

STEP = 1e-4  # s; the fastest mode, of torsion, has some thousands of 1/s
TIMES = STEP * np.arange(12001)
MODES = (2, 2, 2)  # bending in two planes, torsion
TIP = (0.1, 0.15, 0.1)  # m, where the load is in the frame of the beam's end
_START = np.array([0.0, -0.4, 0.9])  # rad
_SWING, _HERTZ, _RISE = 0.3, 1.5, 0.3  # rad, 1/s, s until the sine has its whole amplitude
_DAMPING = 0.02  # of the modes, relative to the critical one
_EVERY = 5  # steps, from one curve's point to the next


@dataclass(frozen=True)
class Response:
    """What comes of a motion of the axes, at every `_EVERY`-th of `TIMES`."""

    load: np.ndarray  # (n, 3) m in the world
    force: np.ndarray  # (n, 3) N on the beam at its clamp, in its frame
    moment: np.ndarray  # (n, 3) N m


def arm(modes: tuple[int, int, int] = MODES, terms: Terms = NOMINAL, is_rigid: bool = False) -> SpatialArm:
    """Column, rigid lever and beam with a load."""
    beam = RayleighBeam(1.0, 6.0, (2e4, 1.5e4), 8e3, (0.03, 0.025), modes, _DAMPING).body()
    up, ahead = np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.0])
    column = rigid_body(40.0, 0.5 * up, np.diag([1.0, 1.0, 0.5]), up)
    lever = rigid_body(20.0, 0.5 * ahead, np.diag([0.2, 1.8, 1.8]), ahead)
    load = rigid_body(5.0, TIP, np.zeros((3, 3)))
    level = (0.0, 1.0, 0.0)
    return SpatialArm(
        [
            SpatialLink(column),
            SpatialLink(lever, level),
            SpatialLink(beam.rigid if is_rigid else beam, level, load=load),
        ],
        terms,
        tip=TIP,
    )


def swing(times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles of the three axes in rad and their two derivatives, (n, 3) each: a sine that begins smoothly."""
    t = ca.SX.sym("t")
    s = ca.fmin(t / _RISE, 1.0)
    angle = _SWING * s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3) * ca.sin(2.0 * np.pi * _HERTZ * t)
    rate = ca.jacobian(angle, t)
    every = ca.Function("swing", [t], [angle, rate, ca.jacobian(rate, t)]).map(len(times))(times[None])
    angle, rate, acceleration = (np.tile(np.asarray(each).T, (1, 3)) for each in every)
    return _START + angle, rate, acceleration


def response(model: SpatialArm) -> Response:
    """The beam under the motion of the axes, at first at rest."""
    q, joints = np.eye(model.size)[model.modes], np.eye(model.size)[model.joints]
    n = len(q)
    inputs = np.hstack(swing(0.5 * STEP * np.arange(2 * len(TIMES) - 1)))
    at_rest = q @ model.at_rest(_START)
    if n:
        state, moved = ca.SX.sym("state", 2 * n), ca.SX.sym("moved", 9)
        angle, rate, acceleration = ca.vertsplit(moved, 3)
        bend, bending = ca.vertsplit(state, n)
        x, v = joints.T @ angle + q.T @ bend, joints.T @ rate + q.T @ bending
        M = model.mass(x)
        pull = q @ (M @ (joints.T @ acceleration) + model.bias(x, v))
        derivative = ca.vertcat(bending, -ca.solve(q @ M @ q.T, pull))
        rates = ca.Function("rates", [state, moved], [derivative], {"cse": True})
        bent = march(rates, np.concatenate([at_rest, np.zeros(n)]), inputs, STEP)[::_EVERY]
        accelerations = np.asarray(rates.map(len(bent))(bent.T, inputs[:: 2 * _EVERY].T))[n:].T
    else:
        bent, accelerations = np.zeros((len(TIMES[::_EVERY]), 0)), np.zeros((len(TIMES[::_EVERY]), 0))
    of_joints = np.split(inputs[:: 2 * _EVERY], 3, axis=1)
    x, v, a = (
        axes @ joints + modal @ q
        for axes, modal in zip(of_joints, (bent[:, :n], bent[:, n:], accelerations), strict=True)
    )
    load = np.asarray(model.end.map(len(x))(x.T, v.T)[0]).T
    force, moment = (np.asarray(each).T for each in model.clamp.map(len(x))(x.T, v.T, a.T))
    return Response(load, force, moment)


def zeros_of(model: SpatialArm) -> Zeros:
    """From the axes to the three coordinates of the load, about rest at the beginning."""
    x, still = model.at_rest(_START), np.zeros(model.size)
    damping = np.stack(
        [0.5 * np.asarray(model.bias(x, each) - model.bias(x, -each))[:, 0] for each in np.eye(model.size)],
        axis=1,
    )
    J = np.asarray(model.end(x, still)[1])
    return transmission_zeros(np.asarray(model.mass(x)), damping, np.asarray(model.tangent(x)), model.B, J)


def frequencies(model: SpatialArm) -> np.ndarray:
    """Of the beam with its load in Hz, the axes held at the beginning; shape (modes,)."""
    x = model.at_rest(_START)
    M, K = (np.asarray(f(x))[np.ix_(model.modes, model.modes)] for f in (model.mass, model.tangent))
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)) / (2.0 * np.pi)


def spatial_arm() -> Example:
    """Reiner (2010), section 3.7, figures 3.16 to 3.18: three axes, a beam in space, a load beside it."""
    nominal = arm()
    reached = response(nominal)
    others = {f"variant {name}": response(arm(terms=terms)) for name, terms in VARIANTS.items()}
    others["rigid"] = response(arm(is_rigid=True))
    off = {name: 1e3 * np.linalg.norm(one.load - reached.load, axis=1) for name, one in others.items()}
    largest = {name: float(each.max()) for name, each in off.items()}
    clamped = {
        name: {
            "force_n": float(np.linalg.norm(one.force - reached.force, axis=1).max()),
            "moment_n_m": float(np.linalg.norm(one.moment - reached.moment, axis=1).max()),
        }
        for name, one in others.items()
    }
    zeros, hertz = zeros_of(nominal), frequencies(nominal)
    simplified = zeros_of(arm(terms=VARIANTS["1"]))
    by_modes = {f"{n}": frequencies(arm((n, n, n)))[:3].tolist() for n in (1, 2, 3, 4)}
    lowest = ", ".join(f"{each:.1f}" for each in hertz[:3])
    verdict = (
        f"A beam in space behind three axes, at {lowest} Hz with its load: {_of_zeros(zeros)}; with C_t and "
        f"C_r left out (variant 1) {_of_zeros(simplified)}. While the axes swing the load is then off by "
        f"{largest['variant 1']:.2f} mm, by {largest['variant 5']:.3f} mm if only C_r of first order is left "
        f"out, by {largest['rigid']:.1f} mm if the beam is rigid."
    )
    numbers = {
        **one_json(zeros),
        "frequencies_hz": hertz.tolist(),
        "frequencies_by_modes_hz": by_modes,
        "simplified": one_json(simplified),
        "load_off_mm": largest,
        "clamp_off": clamped,
    }
    return Example(numbers, verdict, _sections(reached, others, off, clamped, (zeros, simplified), by_modes))


def _of_zeros(zeros: Zeros) -> str:
    if zeros.slowest_rhp is None:
        return "no zero in the right half-plane"
    return f"a zero in the right half-plane at {zeros.slowest_rhp:.0f} 1/s"


def _sections(
    reached: Response,
    others: Mapping[str, Response],
    off: Mapping[str, np.ndarray],
    clamped: Mapping[str, Mapping[str, float]],
    zeros: tuple[Zeros, Zeros],
    by_modes: Mapping[str, list[float]],
) -> list[Section]:
    times = TIMES[::_EVERY]
    heights = {"whole model": reached.load[:, 2]}
    moments = {"whole model": reached.moment[:, 1]}
    for name in ("variant 1", "variant 5", "rigid"):
        heights[name], moments[name] = others[name].load[:, 2], others[name].moment[:, 1]
    rows = []
    for name, error in off.items():
        rows.append([name, f"{error.max():.3f}", *(f"{value:.2f}" for value in clamped[name].values())])
    head = ("model", "load off in mm", "force at the clamp off in N", "moment off in N m")
    of_modes = [[name, *(f"{value:.3f}" for value in row)] for name, row in by_modes.items()]
    return [
        Section("Height of the load", "As figure 3.16(d).", time_figure(times, heights, "z in m"), 420),
        Section(
            "Deviation from the whole model",
            "What the load does otherwise when terms are left out; the closer to zero, the less they matter.",
            time_figure(times, off, "deviation in mm"),
            420,
        ),
        Section(
            "Moment at the clamp, about y of the beam",
            "As figure 3.17(e).",
            time_figure(times, moments, "moment in N m"),
            420,
        ),
        Section("By what is left out", "Largest differences from the whole model.", html_table(head, rows)),
        Section("Zeros of the whole model", zeros_note(zeros[0]), plane_figure(zeros[0])),
        Section(
            "Zeros without C_t and C_r",
            "Variant 1, eq. (3.73); as figure 3.18. " + zeros_note(zeros[1]),
            plane_figure(zeros[1]),
        ),
        Section(
            "Lowest frequencies by number of modes",
            "In Hz, so many modes in each plane and of torsion.",
            html_table(("modes", "first", "second", "third"), of_modes),
        ),
    ]
