"""Pictures of a study: how its results are spread, what each factor does, whose doing the variance is."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from diagrams.scenario.scenario import load_scenario
from experiments.metrics.single_figures import FIGURES
from experiments.report.style import law_colors, law_title
from experiments.study.analysis import Rows, main_effects, of_law, sobol_indices
from experiments.study.study_file import Study
from robots.configuration.quantity import unit_at

_LARGEST_RATIO = 50.0  # of two results: above, the axis is logarithmic
_MAX_POINTS = 2_000  # of a curve; more cannot be seen


def spread_figure(study: Study, rows: Rows, metric: str) -> go.Figure:
    """The share of runs that are at most so far off, a curve for each law."""
    figure, colors = go.Figure(), law_colors(study.laws)
    for law in study.laws:
        values = np.sort(_known(of_law(rows, law)[metric]))
        share = 100.0 * np.arange(1, len(values) + 1) / max(1, len(values))
        shown = np.unique(np.linspace(0, len(values) - 1, min(len(values), _MAX_POINTS)).astype(int))
        figure.add_scatter(
            x=values[shown],
            y=share[shown],
            mode="lines+markers" if len(values) < 30 else "lines",
            line={"shape": "hv", "color": colors[law]},
            name=law_title(law),
        )
    figure.update_yaxes(title="runs below, in %", range=[0.0, 102.0])
    return figure.update_xaxes(title=f"at most, {metric_unit(metric)}", type=_axis_type(rows[metric]))


def effects_figure(study: Study, rows: Rows, metric: str) -> go.Figure:
    """The mean over the values of each factor with its 95 % interval, side by side on one scale."""
    figure = make_subplots(1, len(study.factors), shared_yaxes=True, horizontal_spacing=0.03)
    colors, titles = law_colors(study.laws), _factor_titles(study)
    for law in study.laws:
        for column, effect in enumerate(main_effects(study, of_law(rows, law), metric), 1):
            figure.add_scatter(
                x=effect.values,
                y=effect.mean,
                error_y={"array": effect.half_width, "thickness": 1},
                line={"color": colors[law]},
                name=law_title(law),
                legendgroup=law,
                showlegend=column == 1,
                row=1,
                col=column,
            )
            figure.update_xaxes(title=titles[effect.factor], row=1, col=column)
    figure.update_yaxes(title=f"mean, {metric_unit(metric)}", row=1, col=1)
    return figure.update_yaxes(type=_axis_type(rows[metric]))


def indices_figure(study: Study, rows: Rows, metric: str) -> go.Figure | None:
    """Shares of the variance by factor and law; None if the study was not designed for them."""
    figure, colors = go.Figure(), law_colors(study.laws)
    for law in study.laws:
        found = sobol_indices(study, of_law(rows, law), metric)
        if found is None:
            continue
        for name, share, interval, pattern in (
            ("alone", found.first, found.first_interval, ""),
            ("with others", found.total, found.total_interval, "/"),
        ):
            figure.add_bar(
                x=found.factors,
                y=share,
                error_y={
                    "array": np.maximum(0.0, interval[:, 1] - share),
                    "arrayminus": np.maximum(0.0, share - interval[:, 0]),
                    "symmetric": False,
                    "thickness": 1,
                },
                marker={"color": colors[law], "pattern": {"shape": pattern, "fillmode": "replace"}},
                name=f"{law_title(law)}, {name}",
            )
    if not figure.data:
        return None
    # Few samples give intervals far beyond what a share can be.
    yaxis = {"title": "share of the variance", "range": [-0.25, 1.5]}
    return figure.update_layout(yaxis=yaxis, barmode="group")


def metric_unit(metric: str) -> str:
    """What an axis says where the heading names the metric: ``in mm``."""
    return "in " + FIGURES[metric].rpartition(" in ")[2] if metric != "guard_ticks" else "in ticks"


def metric_name(metric: str) -> str:
    """The metric in words, without its unit."""
    return FIGURES[metric].removesuffix(f" {metric_unit(metric)}")


def _factor_titles(study: Study) -> dict[str, str]:
    """The factors with their units, where the scenario declares one; in two lines, to stand side by side."""
    scenario = load_scenario(study.scenario, study.settings)
    units = {factor: unit_at(scenario, factor) for factor in study.factors}
    titles = {factor: f"{factor} in {unit}" if unit else factor for factor, unit in units.items()}
    return {factor: ".<br>".join(title.rsplit(".", 1)) for factor, title in titles.items()}


def _known(values: np.ndarray) -> np.ndarray:
    return values[np.isfinite(values)]


def _axis_type(values: np.ndarray) -> str:
    known = _known(values)
    if not len(known) or known.min() <= 0.0:
        return "linear"
    return "log" if known.max() / known.min() > _LARGEST_RATIO else "linear"
