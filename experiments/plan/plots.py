"""The page of a plan: time and energy beside the usual timing, and which limit binds where."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from experiments.plan.results import plan_json
from experiments.plan.study import STILL, LegResult, Plan
from experiments.report.plot_page import Section, html_table, write_plot_page
from robots.planning.limit_use import BINDING, Use

TABLE_HEAD = ("leg", "s", "usual", "%", "J", "usual", "%", "C", "usual", "limits")
_PLANNED, _USUAL = "#0f7cc0", "#c0392b"
_SHOWN = 0.5  # use of a limit, below which it is not in the picture
_COLOURS = "Blues"
_MARGINS, _ROW = 140, 18  # pixels: of a picture of limits, and of a row that can be read


def table_rows(plan: Plan, results: list[LegResult]) -> list[list[str]]:
    """A row for each leg; times in s, energies in J, C in m/s."""
    rows = []
    for each in results:
        new, old = each.planned, each.baseline
        work = [kept.run.energy(plan.recuperation) for kept in (new, old)]
        rows.append(
            [
                each.leg.name,
                f"{new.timing.duration:.3f}",
                f"{old.timing.duration:.3f}",
                _change(new.timing.duration, old.timing.duration).removesuffix(" %"),
                f"{work[0]:.0f}",
                f"{work[1]:.0f}",
                _change(*work).removesuffix(" %"),
                f"{new.run.criterion:.3f}",
                f"{old.run.criterion:.3f}",
                "kept" if new.keeps else "exceeded",
            ]
        )
    return rows


def verdict(plan: Plan, results: list[LegResult]) -> str:
    """What planning gains, in a sentence or two."""
    numbers = plan_json(plan, results)
    usual = "the sin² law" if all(each.leg.is_straight for each in results) else "the usual timing"
    kept = "all limits are kept" if numbers["limits_kept"] else "not all limits are kept"
    binding = ", ".join(numbers["binding"]) or "none"
    rings, usually = numbers["criterion"], max(numbers["baseline_criterion"], STILL)
    if not numbers["baseline_limits_kept"]:
        kept += ", but not by the usual timing" if numbers["limits_kept"] else ""
    unlimited = plan.limits.unlimited_torques
    without = f" The robot file has no limits of {', '.join(unlimited)}." if unlimited else ""
    more = f" It rings more than the usual timing: C {rings:.4f} m/s, usually {usually:.4f} m/s."
    return (
        f"{numbers['time_s']:.3f} s and {numbers['energy_j']:.0f} J, with {usual} in the same limits "
        f"{numbers['baseline_s']:.3f} s and {numbers['baseline_energy_j']:.0f} J: "
        f"time {_change(numbers['time_s'], numbers['baseline_s'])}, "
        f"energy {_change(numbers['energy_j'], numbers['baseline_energy_j'])}. In the plant {kept}; "
        f"what binds: {binding}. Planning a leg took {numbers['seconds']:.1f} s and at most "
        f"{numbers['iterations']} iterations.{more if rings > usually else ''}{without}"
    )


def binding_figure(plan: Plan, result: LegResult) -> go.Figure:
    """The use of limits in the plant over the time, a row each."""
    run = result.planned.run
    use: Use = run.use(plan.limits)
    moving = run.times <= result.planned.timing.duration
    rows = _shown(use)
    figure = go.Figure(
        go.Heatmap(
            x=1e3 * run.times[moving],
            y=[use.names[i] for i in rows],
            z=100.0 * use.shares[rows][:, moving],
            zmin=0.0,
            zmax=100.0,
            colorscale=_COLOURS,
            colorbar={"title": "%"},
            hovertemplate="%{y}: %{z:.0f} % at %{x:.0f} ms<extra></extra>",
        )
    )
    for i in rows:
        at = moving & (use.shares[i] >= BINDING)
        marks = go.Scatter(
            x=1e3 * run.times[at], y=[use.names[i]] * int(at.sum()), mode="markers", showlegend=False
        )
        figure.add_trace(marks.update(marker={"color": _USUAL, "size": 5}, hoverinfo="skip"))
    return figure.update_layout(xaxis={"title": "time in ms"}, yaxis={"automargin": True, "dtick": 1})


def _shown(use: Use) -> list[int]:
    """Rows of limits that are used enough to be in the picture, the least used one first."""
    return [int(i) for i in np.argsort(use.shares.max(axis=1)) if use.shares[i].max() > _SHOWN]


def motion_figure(result: LegResult) -> go.Figure:
    """Speed of the tool as planned and torques of gears, planned and usual."""
    figure = make_subplots(4, 1, shared_xaxes=True, vertical_spacing=0.05)
    for name, kept, colour in (
        ("planned", result.planned, _PLANNED),
        ("usual", result.baseline, _USUAL),
    ):
        style = {"color": colour}
        moving = kept.run.times <= kept.timing.duration + 0.05
        of_tool = go.Scatter(x=1e3 * kept.run.times[moving], y=kept.run.demand.tool_speed[moving], line=style)
        figure.add_trace(of_tool.update(name=name, legendgroup=name), row=1, col=1)
        for joint in range(3):
            torque = kept.run.demand.gear_torque[moving, joint]
            trace = go.Scatter(x=1e3 * kept.run.times[moving], y=torque, line=style, legendgroup=name)
            figure.add_trace(trace.update(showlegend=False, name=name), row=joint + 2, col=1)
            figure.update_yaxes(title=f"gear {joint + 1} in N m", row=joint + 2, col=1)
    figure.update_yaxes(title="tool in m/s", row=1, col=1)
    return figure.update_xaxes(title="time in ms", row=4)


def front_figure(results: list[LegResult]) -> go.Figure:
    """Least energy at given durations."""
    figure = go.Figure()
    for each in results:
        times, work = zip(*each.front, strict=True)
        figure.add_trace(go.Scatter(x=times, y=work, name=each.leg.name, mode="lines+markers"))
    return figure.update_layout(xaxis={"title": "duration in s"}, yaxis={"title": "energy in J"})


def write_plan_page(path: Path, plan: Plan, results: list[LegResult]) -> None:
    """All of it as a page that opens offline."""
    text = (
        "Durations in s, energies in J. Usual is, for a straight line, the sin² law with its largest "
        "acceleration; for a motion of joints the quickest jerk-limited profile. Both are made to keep all "
        "limits in the plant. C adds up how much the wrist still accelerates in the 0.9 s after the motion, "
        "Reiner (2010), eq. (6.1), in m/s."
    )
    sections: list[Section] = []
    if plan.objective == "front":
        note = "The least energy that the planner finds for motions of this duration."
        sections.append(Section("Time against energy", note, front_figure(results), 420))
    for each in results:
        note = "Share of each limit that motors and gears of the plant use; red where it binds."
        height = max(460, _MARGINS + _ROW * len(_shown(each.planned.run.use(plan.limits))))
        sections.append(Section(f"Limits, {each.leg.name}", note, binding_figure(plan, each), height))
        note = "Speed of the tool, usual and planned, and torques of the gears as measured in the plant."
        sections.append(Section(f"Motion, {each.leg.name}", note, motion_figure(each), 760))
    sections.insert(1, Section("All legs", text, html_table(TABLE_HEAD, table_rows(plan, results))))
    title = f"Plan, {plan.robot.name}, {plan.payload:g} kg, {plan.path}"
    write_plot_page(path, title, verdict(plan, results), sections)


def _change(new: float, old: float) -> str:
    return f"{100.0 * (new / old - 1.0):+.1f} %"
