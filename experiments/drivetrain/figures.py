"""Figures 2.3 to 2.6 of Reiner (2010): friction, efficiency, play and hysteresis of drive trains."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from robots.drivetrain.backlash import Backlash, ViscoElasticGear
from robots.drivetrain.efficiency import DirectionalEfficiency, SmoothEfficiency
from robots.drivetrain.friction import PolynomialFriction, SigmoidFriction
from robots.drivetrain.hysteresis import PrandtlIshlinskii, SmoothPrandtlIshlinskii
from robots.drivetrain.stiffness import CubicSpring

# Figure 2.3 is normed to the torque at 1 rad/s; the source draws it without numbers, these are assumed.
FRICTION = PolynomialFriction(coulomb=0.55, steepness=120.0, step=0.05, torque_at_one=1.0, slope_at_one=0.2)
# Figure 2.4: two inertias in kg m^2 on the two sides of a gear with the ratio one.
INERTIA_A, INERTIA_B = 1.0, 5.0
EFFICIENCY = SmoothEfficiency(
    DirectionalEfficiency(0.9, 0.8, 0.1, 0.1), 1.0, SigmoidFriction(5.0, 5.0, 200.0), 50.0
)
# Table 2.1. The thresholds begin with zero and psi is meant where the table says s (errata).
WEIGHTS = (0.2, 0.2, 0.2, 0.2, 0.2)
THRESHOLDS = (0.0, 0.2, 0.3, 0.4, 0.5)
# Of the smooth inverse: T in s, psi, n. The first is that of table 2.1, the second is sharper and faster.
SMOOTH_INVERSES = {"table 2.1": (0.01, 25.0, 3), "sharper": (0.005, 100.0, 3)}
PLAY_APPROXIMATIONS = {"P1": (0.01, 50.0, 6), "P2": (0.01, 25.0, 3), "P3": (0.1, 25.0, 3)}  # T, psi, n


def friction_figure() -> go.Figure:
    """Figure 2.3: the whole curve and its passage through zero."""
    figure = make_subplots(1, 2, subplot_titles=["friction", "passage through zero"])
    for column, largest in ((1, 2.0), (2, 0.1)):
        v = np.linspace(-largest, largest, 801)
        figure.add_trace(go.Scatter(x=v, y=FRICTION.torque(v), line={"color": "#0f7cc0"}), 1, column)
    figure.update_xaxes(title="velocity in rad/s")
    figure.update_yaxes(title="torque, normed", col=1)
    return figure.update_layout(showlegend=False)


def efficiency_run() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Figure 2.4: times in s, speed in rad/s, and the torque in N m that drives the first inertia, a ramp."""

    def torque(time: float | np.ndarray) -> np.ndarray:
        return np.asarray(np.interp(time, [0.0, 1.0, 3.0, 4.0], [0.0, 40.0, -40.0, 0.0]))

    def acceleration(time: float, speed: np.ndarray) -> np.ndarray:
        # What the first inertia leaves of the torque goes through the gear and moves the second one.
        def excess(rate: float) -> float:
            gear = np.array(float(torque(time)) - INERTIA_A * rate)
            return float(EFFICIENCY.output_torque(gear, speed[0])) - INERTIA_B * rate

        return np.array([brentq(excess, -200.0, 200.0)])

    times = np.linspace(0.0, 5.0, 501)
    solution = solve_ivp(acceleration, (0.0, 5.0), [0.0], "LSODA", times, max_step=0.02)
    return times, solution.y[0], torque(times)


def efficiency_figure() -> go.Figure:
    """Figure 2.4: torque, speed and what the gear loses."""
    times, speed, torque = efficiency_run()
    acceleration = np.gradient(speed, times)
    loss = EFFICIENCY.loss(torque - INERTIA_A * acceleration, speed)
    figure = make_subplots(2, 1, shared_xaxes=True, vertical_spacing=0.08)
    figure.add_trace(go.Scatter(x=times, y=torque, name="torque that drives"), 1, 1)
    figure.add_trace(go.Scatter(x=times, y=loss, name="loss in the gear"), 1, 1)
    figure.add_trace(go.Scatter(x=times, y=speed, name="speed", showlegend=False), 2, 1)
    figure.update_yaxes(title="torque in N m", row=1).update_yaxes(title="speed in rad/s", row=2)
    return figure.update_xaxes(title="time in s", row=2)


def backlash_figure() -> go.Figure:
    """Figure 2.5: a gap, and the visco-elastic substitute, under a slow and a fast deflection."""
    gap = Backlash(CubicSpring(2e4, 2e4), 0.0, 0.004)
    smooth = ViscoElasticGear(CubicSpring(500.0, 7e5), 4e3, 500.0, 60.0)
    phi = 0.01 * np.sin(np.linspace(0.0, 4.0 * np.pi, 8001))
    curves = {"gap of 4 mrad": gap.torque(phi, np.zeros_like(phi))}
    for frequency in (0.5, 10.0):
        dt, x, torques = 2.0 / frequency / 8000, np.array(0.0), []
        for angle in phi:
            torques.append(float(smooth.torque(np.array(angle), x)))
            x = x + dt * smooth.rate(np.array(angle), x)
        curves[f"visco-elastic, {frequency:g} Hz"] = np.array(torques)
    figure, cycle = make_subplots(1, 2, subplot_titles=["play", "near zero"]), slice(4000, None)
    for (name, torque), color in zip(curves.items(), ("#5b6675", "#0f7cc0", "#d55e00"), strict=True):
        for column in (1, 2):
            line, group = {"color": color}, {"legendgroup": name, "showlegend": column == 1}
            trace = go.Scatter(x=1e3 * phi[cycle], y=torque[cycle], name=name, line=line, **group)
            figure.add_trace(trace, 1, column)
    figure.update_xaxes(title="deflection in mrad").update_xaxes(range=[-3.5, 3.5], col=2)
    return figure.update_yaxes(title="torque in N m", col=1).update_yaxes(range=[-45, 45], col=2)


def hysteresis_signal() -> tuple[np.ndarray, float]:
    """A filtered signal with loops of several sizes, and the time between its samples in s."""
    step = 1e-3
    times = np.arange(0.0, 6.0, step)
    return np.sin(2.0 * np.pi * 0.5 * times) * (1.0 - np.exp(-times)) * np.cos(0.5 * times), step


def smoothly_compensated(x: np.ndarray, step: float) -> dict[str, np.ndarray]:
    """The output of the hysteresis behind the inverse of its smooth form, for each of `SMOOTH_INVERSES`."""
    operator = PrandtlIshlinskii(WEIGHTS, THRESHOLDS)
    return {
        name: operator.response(
            SmoothPrandtlIshlinskii(operator, sharpness, delay, order).inverse_response(x, step)
        )
        for name, (delay, sharpness, order) in SMOOTH_INVERSES.items()
    }


def hysteresis_figure() -> go.Figure:
    """Figure 2.6: the play operator and its smooth forms; a hysteresis compensated by its inverse."""
    x, step = hysteresis_signal()
    figure = make_subplots(1, 2, subplot_titles=["play operator, r = 0.2", "with the inverse before it"])
    single = PrandtlIshlinskii((1e-9, 1.0), (0.0, 0.2))
    figure.add_trace(go.Scatter(x=x, y=single.response(x), name="exact"), 1, 1)
    for name, (delay, sharpness, order) in PLAY_APPROXIMATIONS.items():
        smooth = SmoothPrandtlIshlinskii(single, sharpness, delay, order)
        figure.add_trace(go.Scatter(x=x, y=smooth.response(x, step), name=name), 1, 1)
    operator = PrandtlIshlinskii(WEIGHTS, THRESHOLDS)
    inverse, starts = operator.inverse()
    figure.add_trace(go.Scatter(x=x, y=operator.response(x), name="hysteresis"), 1, 2)
    compensated = operator.response(inverse.response(x, starts))
    figure.add_trace(go.Scatter(x=x, y=compensated, name="compensated, exactly"), 1, 2)
    for name, compensated in smoothly_compensated(x, step).items():
        figure.add_trace(go.Scatter(x=x, y=compensated, name=f"compensated, smoothly, {name}"), 1, 2)
    return figure.update_xaxes(title="input").update_yaxes(title="output", col=1)
