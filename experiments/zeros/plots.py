"""Pictures of zeros: the slowest unstable one over axes 2 and 3, zeros in the plane, outputs along a beam."""

from collections.abc import Callable, Mapping

import numpy as np
import plotly.graph_objects as go

from experiments.zeros import low_pass
from experiments.zeros.study import ZeroStudy
from robots.dynamics.modal.modal_beam import ModalBeam
from robots.dynamics.transmission_zeros import Zeros

_WIDTH = 3.0  # of the plane that is shown, relative to its height


def workspace_figure(study: ZeroStudy) -> go.Figure:
    """Contours of the slowest zero in the right half-plane by real part; white where there is none."""
    figure = go.Figure(
        go.Heatmap(
            x=np.rad2deg(study.axis_2),
            y=np.rad2deg(study.axis_3),
            z=np.log10(study.slowest_rhp.T),
            colorscale="Viridis",
            colorbar={
                "title": "1/s",
                "tickvals": [0, 1, 2, 3, 4, 5],
                "ticktext": ["1", "10", "100", "1,000", "10,000", "100,000"],
            },
            customdata=study.slowest_rhp.T,
            hovertemplate="axis 2: %{x:.0f}°<br>axis 3: %{y:.0f}°<br>%{customdata:.0f} 1/s<extra></extra>",
        )
    )
    return figure.update_layout(xaxis={"title": "axis 2 in degrees"}, yaxis={"title": "axis 3 in degrees"})


def plane_figure(zeros: Zeros) -> go.Figure:
    """Zeros in the complex plane."""
    figure = go.Figure(
        go.Scatter(
            x=np.real(zeros.values),
            y=np.imag(zeros.values),
            mode="markers",
            marker={"symbol": "circle-open", "size": 10, "line": {"width": 2}},
            hovertemplate="%{x:.4g} %{y:+.4g}i 1/s<extra></extra>",
        )
    )
    figure.add_vline(x=0.0, line={"dash": "dot", "width": 1})
    shown = _largest_shown(zeros)
    xaxis = {"title": "real part in 1/s"} | ({"range": [-shown, shown]} if np.isfinite(shown) else {})
    return figure.update_layout(xaxis=xaxis, yaxis={"title": "imaginary part in 1/s"})


def zeros_note(zeros: Zeros) -> str:
    """What `plane_figure` shows, and the real parts that it has no room for."""
    note = "Poles of the exact inverse; those right of the dotted line make it unstable."
    real = np.sort(np.real(zeros.values))
    outside = real[np.abs(real) > _largest_shown(zeros)]
    if not len(outside):
        return note
    return f"{note} Not shown, so fast are they: {', '.join(f'{value:,.0f}' for value in outside)} 1/s."


def _largest_shown(zeros: Zeros) -> float:
    """Real parts up to a few times what the imaginary ones are: the others would squeeze them into a line."""
    highest = float(np.abs(np.imag(zeros.values)).max(initial=0.0))
    return _WIDTH * highest if highest > 0.0 else np.inf


def beam_figure(num_modes: int, boundary: str = "clamped") -> go.Figure:
    """The largest real part of the zeros over the place of the output; Reiner (2010), figures 3.4, 3.5."""
    beam = ModalBeam(num_modes=num_modes, boundary=boundary)
    xi = np.linspace(0.02, 1.0, 99)
    largest = [float(np.real(zeros.values).max(initial=0.0)) for zeros in map(beam.zeros, xi)]
    figure = go.Figure(go.Scatter(x=xi, y=np.maximum(largest, 0.0), mode="lines"))
    figure.add_vline(x=beam.largest_stable_xi(), line={"dash": "dot", "width": 1})
    return figure.update_layout(
        xaxis={"title": "place of the output / length"},
        yaxis={"title": "largest real part, in sqrt(E I / (m l<sup>3</sup>))"},
    )


def locus_figure(num_modes: int) -> go.Figure:
    """Where the zeros are in the plane as the output moves along the beam; Reiner (2010), figs. 3.4, 3.5."""
    beam = ModalBeam(num_modes=num_modes)
    return _locus(beam.zeros, np.linspace(0.02, 1.0, 99), "place", "sqrt(E I / (m l<sup>3</sup>))", 200.0)


def arm_locus_figure(zeros_at: Callable[[float], Zeros]) -> go.Figure:
    """The same of the two-joint arm over x_l from 0 to 0.5 m; Reiner (2010), figure 3.9."""
    return _locus(zeros_at, np.linspace(0.0, 0.5, 101), "x_l in m", "1/s", 1000.0)


def _locus(
    zeros_at: Callable[[float], Zeros], places: np.ndarray, label: str, unit: str, limit: float
) -> go.Figure:
    points = [(value, place) for place in places for value in zeros_at(place).values]
    values, at = (np.array(column) for column in zip(*points, strict=True))
    bar = {"title": {"text": label, "side": "right"}}
    marker = {"size": 5, "color": np.real(at), "colorscale": "Viridis", "colorbar": bar}
    shown = [-1.04 * limit, 1.04 * limit]
    figure = go.Figure(go.Scatter(x=np.real(values), y=np.imag(values), mode="markers", marker=marker))
    return figure.update_layout(
        xaxis={"title": f"real part in {unit}", "range": shown},
        yaxis={"title": f"imaginary part in {unit}", "range": shown},
    )


def time_figure(times: np.ndarray, curves: Mapping[str, np.ndarray], title: str) -> go.Figure:
    """Curves over the time in s."""
    every = slice(None, None, 5)
    figure = go.Figure(
        [go.Scatter(x=times[every], y=curve[every], name=name) for name, curve in curves.items()]
    )
    return figure.update_layout(xaxis={"title": "time in s"}, yaxis={"title": title})


def gain_figure() -> go.Figure:
    """What low-pass filters leave of an amplitude, over the frequency; Reiner (2010), figure 3.2(b)."""
    hertz = low_pass.FREQUENCIES
    curves = {name: 20.0 * np.log10(low_pass.gain(name, hertz)) for name in low_pass.NAMES}
    figure = go.Figure([go.Scatter(x=hertz, y=curve, name=name) for name, curve in curves.items()])
    figure.add_vline(x=low_pass.HERTZ, line={"dash": "dot", "width": 1})
    xaxis = {"title": "frequency in Hz", "type": "log", "tickvals": [1, 10, 20, 100]}
    return figure.update_layout(xaxis=xaxis, yaxis={"title": "gain in dB", "range": [-80.0, 3.0]})
