"""The page of an identification: parameters, and measured against modelled signals of every case."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.cli.console import count
from experiments.identify.advice.report import advice_sections, advised
from experiments.identify.fine_tuning.report import fine_tuning_sections, outcome
from experiments.identify.judge.report import judge_section, judged
from experiments.identify.search import SEARCH_HEAD, SearchComparison, search_rows
from experiments.identify.study import IdentifyStudy
from experiments.report.plot_page import Section, html_table, sortable_table, write_plot_page
from robots.identification.identified_robot import STIFFNESS_KNOWN

_MEASURED, _BEFORE, _AFTER = "#7a8696", "#e0a43a", "#2f7fd0"
_UNITS = {"gyro": "rad/s", "accelerometer": "m/s<sup>2</sup>"}
_SHOWN_CASES = 4
_ROW = 120  # px, of a sensor
_FEW = 4  # motions, or less: they say too little of what is wrong with each of them
_NAMED = 6  # springs and dampers in the first lines of the page; more are in its table


def table_head(study: IdentifyStudy) -> list[str]:
    """Of the table of parameters."""
    return ["parameter", "value", "sigma", "unit", "known"] + (
        ["true", "error"] if study.plant is not None else []
    )


def table_rows(study: IdentifyStudy) -> list[list[str]]:
    """Parameters with their uncertainty, and the truth of a simulated robot.

    A share of a value that may as well be zero, such as the play of a gear without any, says nothing: there
    the standard deviation, and the error of what truly is zero, stand in the parameter's unit.
    """
    rows = []
    for each in study.parameters:
        row = [
            each.name,
            f"{each.value:.4g}",
            f"{each.sigma / abs(each.value):.2%}" if each.sigma < abs(each.value) else f"± {each.sigma:.2g}",
            each.unit,
            "yes" if each.identifiable else "no",
        ]
        if study.plant is not None:
            row += ["-", "-"] if each.true is None else [f"{each.true:.4g}", _error(each.value, each.true)]
        rows.append(row)
    return rows


def _error(value: float, true: float) -> str:
    return f"{value / true - 1.0:+.2%}" if true else f"{value:+.2g}"


def verdict(study: IdentifyStudy) -> str:
    """What was found, in a few sentences."""
    springs = [each for each in study.parameters if each.name.startswith("stiffness_")]
    known, motions = sum(each.identifiable for each in springs), len(study.found.cases)
    said = [
        f"{known} of {len(springs)} springs are identifiable from {count(motions, 'motion')}, in "
        f"{study.seconds:.0f} s and {study.found.fit.evaluations} evaluations."
    ]
    if study.plant is not None and known:
        stiffness, damping = (np.abs(study.errors(kind)) for kind in ("stiffness_", "damping_"))
        said.append(
            f"They are within {stiffness.max():.1%} of the truth (median {np.median(stiffness):.1%})"
            + (f", dampers within {damping.max():.0%}." if len(damping) else ".")
        )
    if len(study.weak) > _NAMED:
        said.append(f"{len(study.weak)} springs and dampers are not identifiable; the table marks them.")
    elif study.weak:
        said.append(f"Not identifiable: {', '.join(study.weak)}.")
    if known < len(springs):
        said.append(_reason(study, len(springs) - known))
    if motions <= _FEW:
        said.append(
            f"Sigma counts on motions that disagree with each other; with {motions} it is too small, "
            "above all that of dampers."
        )
    if study.rectangle_ratio is not None:
        said.append(
            f"On a rectangle the inverse model leaves {study.rectangle_ratio['identified']:.2f} of the "
            f"deviation of the rigid one, with the former beliefs {study.rectangle_ratio['nominal']:.2f}."
        )
    if study.fine_tuning is not None:
        said.append(outcome(study.fine_tuning))
    if study.verdict is not None:
        said.append(judged(study.verdict))
    if study.advice is not None:
        said.append(advised(study.advice))
    return " ".join(said)


def _reason(study: IdentifyStudy, weak: int) -> str:
    """Why so many springs are not known: what noise alone makes of them, and what disagrees beside."""
    fit = study.found.fit
    noise = np.sqrt(np.diagonal(fit.noise_covariance))
    names = {
        name for name, sigma in zip(fit.parameters.names, noise, strict=True) if sigma >= STIFFNESS_KNOWN
    }
    hidden = len(names.intersection(study.weak))
    return (
        f"Of {count(weak, 'spring')} noise alone hides {hidden}: larger or heavier motions or quieter "
        f"sensors would show more. Of {weak - hidden} motions and sensors disagree by more than 3 %; sigma "
        "has it."
    )


def signals_figure(study: IdentifyStudy, case: int) -> go.Figure:
    """Measured and modelled readings of a case, a row a sensor: its axis that moves most."""
    found = study.found
    axes = [
        "xyz"[int(np.argmax(np.nanstd(found.measured[:, case, 3 * k : 3 * k + 3], axis=0)))]
        for k in range(len(found.sensors))
    ]
    # Above each row: there is no room for them beside it.
    titles = [f"{sensor.name}, {axis}" for sensor, axis in zip(found.sensors, axes, strict=True)]
    figure = make_subplots(
        len(found.sensors), 1, shared_xaxes=True, vertical_spacing=0.025, subplot_titles=titles
    )
    figure.update_annotations(font_size=12, x=0.0, xanchor="left")
    for row, sensor in enumerate(found.sensors, 1):
        channels = slice(3 * row - 3, 3 * row)
        measured = found.measured[:, case, channels]
        axis = "xyz".index(axes[row - 1])
        curves = (
            ("measured", measured[:, axis], _MEASURED),
            ("before", found.before[:, case, channels][:, axis], _BEFORE),
            ("after", found.after[:, case, channels][:, axis], _AFTER),
        )
        known = np.isfinite(measured[:, axis])
        for name, curve, colour in curves:
            trace = go.Scatter(
                x=found.times[known], y=curve[known], name=name, line={"color": colour, "width": 1.4}
            )
            figure.add_trace(trace.update(legendgroup=name, showlegend=row == 1), row, 1)
        figure.update_yaxes(title={"text": _UNITS[sensor.kind], "font": {"size": 12}}, row=row, col=1)
    return figure.update_xaxes(title="time in s", row=len(found.sensors))


def spectra_figure(study: IdentifyStudy) -> go.Figure:
    """Amplitude of all sensors' readings over frequency, root mean square over cases and channels."""
    found = study.found
    figure = go.Figure()
    known = np.isfinite(found.measured).all(axis=(1, 2))
    step = float(found.times[1] - found.times[0])
    spread = found.fit.spread
    frequency = np.fft.rfftfreq(int(known.sum()), step)
    for name, curve, colour in (
        ("measured", found.measured, _MEASURED),
        ("left before", found.measured - found.before, _BEFORE),
        ("left after", found.measured - found.after, _AFTER),
    ):
        scaled = curve[known] / spread
        amplitude = np.abs(np.fft.rfft(scaled - scaled.mean(0), axis=0))
        shown = np.sqrt(np.mean(np.square(amplitude), axis=(1, 2)))
        figure.add_trace(go.Scatter(x=frequency[1:], y=shown[1:], name=name, line={"color": colour}))
    figure.update_xaxes(title="frequency in Hz", range=[0.0, 100.0])
    return figure.update_yaxes(title="amplitude over spread", type="log")


def correlation_figure(study: IdentifyStudy) -> go.Figure:
    """Correlations of the unknowns."""
    fit = study.found.fit
    shown = fit.covariance / np.outer(fit.sigma, fit.sigma)
    names = fit.parameters.names
    heat = go.Heatmap(z=shown, x=names, y=names, zmin=-1.0, zmax=1.0, colorscale="RdBu")
    return go.Figure(heat).update_yaxes(autorange="reversed")


def sensitivity_rows(study: IdentifyStudy) -> list[list[str]]:
    """Unknowns, the best known first: standard deviation by noise, and with what the model lacks."""
    fit = study.found.fit
    noise = np.sqrt(np.diagonal(fit.noise_covariance))
    order = np.argsort(fit.sigma)
    return [[fit.parameters.names[i], f"{noise[i]:.2g}", f"{fit.sigma[i]:.2g}"] for i in order]


def cost_figure(searches: SearchComparison) -> go.Figure:
    """Where all searches ended: cost over time of the processor, a point a start."""
    figure = go.Figure()
    for method in dict.fromkeys(run.method for run in searches.runs):
        runs = [run for run in searches.runs if run.method == method]
        x, y = [run.seconds for run in runs], [float(run.cost) for run in runs]
        figure.add_trace(go.Scatter(x=x, y=y, mode="markers", name=method, marker={"size": 9}))
    figure.update_xaxes(title="time of the processor in s", rangemode="tozero")
    return figure.update_yaxes(title="cost at the end", type="log")


def front_figure(searches: SearchComparison) -> go.Figure:
    """Costs of slower and faster motions that cannot both be less."""
    slow, fast = searches.front.cost.T
    front = go.Scatter(x=slow, y=fast, mode="markers+lines", line={"color": _AFTER})
    figure = go.Figure(front)
    figure.update_xaxes(title="cost of the slower motions")
    return figure.update_yaxes(title="cost of the faster motions")


def _search_sections(searches: SearchComparison) -> list[Section]:
    return [
        Section(
            "Searches",
            "Springs and dampers with linear gears from few motions, the same problem for all; every spring "
            "is by a factor of two too stiff or too soft at the start. The furthest spring is told against "
            "the search with the least cost; a start fails that ends 5 % above it.",
            html_table(SEARCH_HEAD, search_rows(searches)),
        ),
        Section("Where searches ended", "A point for each start.", cost_figure(searches), 420),
        Section(
            "Slower against faster motions",
            "NSGA-II from around the best: what a model with linear gears can say better of the slower "
            "motions only at the cost of the faster ones. Were all as in the model, it would be a point.",
            front_figure(searches),
            420,
        ),
    ]


def write_identify_page(path: Path, study: IdentifyStudy, searches: SearchComparison | None = None) -> None:
    """All of it as a page that opens offline."""
    parameters = Section(
        "Parameters",
        "Dampers as retardation times, damper over spring. Sigma contains what cases and sensors disagree "
        "about, as a share of the value or, where it is larger than that, in its unit; known is what is sure "
        "to 3 % (springs), 25 % (dampers), 5 % (gains of drives), 10 % (friction) or 0.2 ms (delays).",
        html_table(table_head(study), table_rows(study)),
    )
    spectra = Section(
        "Spectra",
        "All sensors and cases, each reading over the spread of what the model leaves of it: at the natural "
        "frequencies the identified model should leave less than the one before.",
        spectra_figure(study),
        420,
    )
    sections = [spectra, parameters]
    if study.verdict is not None:
        sections.append(judge_section(study.verdict))
    if study.advice is not None:
        sections += advice_sections(study.advice)
    if study.fine_tuning is not None:
        sections += fine_tuning_sections(study.fine_tuning)
    height, cases = _ROW * len(study.found.sensors), study.found.cases
    for case in np.unique(np.linspace(0, len(cases) - 1, _SHOWN_CASES).astype(int)):
        title = f"Case {cases[case].name}: measured, and modelled before and after"
        note = (
            f"{min(_SHOWN_CASES, len(cases))} of {count(len(cases), 'case')} shown, of each sensor the axis "
            f"that moves most. The stamps of the sensors were ahead by {1e3 * study.found.lags[case]:.2f} ms."
        )
        sections.append(Section(title, note, signals_figure(study, case), height))
    sections += [
        Section(
            "Sensitivity",
            "Standard deviations of all unknowns (springs, times and widths relative): by noise, and in all.",
            sortable_table("sensitivity", ["unknown", "by noise", "in all"], sensitivity_rows(study)),
        ),
        Section("Correlations", "Of the unknowns.", correlation_figure(study), 800),
    ]
    if searches is not None:
        sections += _search_sections(searches)
    write_plot_page(
        path, f"Identification of {study.robot.name}, {study.payload:g} kg", verdict(study), sections
    )
