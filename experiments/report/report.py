"""The report of a comparison: one HTML file that opens offline and explains itself."""

import json
from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import Any

from plotly.offline import get_plotlyjs

from experiments.metrics.run_metrics import Comparison, best_law, judged_by
from experiments.report.data import norm, plot_data
from experiments.report.error_rows import AXES, KINDS, error_row, format_cell, is_best, smallest_of_columns
from experiments.report.files import write_text
from experiments.report.page import page
from experiments.report.script import SCRIPT
from experiments.report.style import law_colors, law_title

MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100, 200, 500)
MAGNIFIED_SHARE = 0.25  # of the path's extent that the largest deviation may fill when the page opens
LISTED_EVENTS = 100  # per law


def write_report(
    path: str | Path,
    scenario_text: str,
    summary: Mapping[str, Any],
    timing: Mapping[str, Any],
    logs: Comparison,
) -> None:
    """Writes the report as one self-contained HTML file, atomically.

    Args:
        scenario_text: the scenario as YAML, shown as it is.
        summary: `metrics.summary` of the logs.
        timing: `metrics.timing` of the logs.
        logs: law -> one log per cycle; the first cycle is drawn.

    Raises:
        OSError: if the folder is missing or cannot be written.
    """
    data = plot_data(summary, logs)
    title = f"{summary['scenario']}: visual servoing compared"
    sections = [
        _header(summary, logs),
        _errors(summary),
        _plots(summary, data),
        _guard(summary, logs),
        _transient(summary),
        _iso(summary),
        _timing(timing),
        _scenario(scenario_text),
        "<footer>Made by truetip. Errors are e = wanted − attained in the world frame, the rotation as axis "
        "times angle: Probst (2024), eqs. (2.36) and (2.37).</footer>",
    ]
    # "</script>" or "<!--" inside the data would end or swallow the script element that carries it.
    safe = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    write_text(path, page(escape(title), "\n".join(filter(None, sections)), get_plotlyjs(), safe, SCRIPT))


_TIPS = {"true": "the true tip", "measured": "the tip, as the camera sees it,"}


def verdict(summary: Mapping[str, Any]) -> str:
    """The result in one or two sentences of plain text."""
    best, runs = best_law(summary), summary["runs"]
    source = judged_by(summary)
    numbers, tip = runs[best][source], _TIPS[source]
    if numbers["settling_s"] is None:
        course = (
            f"keeps {tip} within {_text(numbers['max_norm_mm'])} mm and "
            f"{_text(numbers['max_angle_deg'])}° of the wanted path"
        )
    else:
        course = (
            f"brings {tip}, up to {_text(numbers['max_norm_mm'])} mm off at the start, "
            f"within 5 % of that in {_text(numbers['settling_s'])} s"
        )
    text = (
        f"{law_title(best)} {course} and comes to rest "
        f"{_text(norm(numbers['static_mm']))} mm and {_text(norm(numbers['static_deg']))}° from it."
    )
    if "open_loop" in runs and best != "open_loop":
        baseline = runs["open_loop"][source]
        text += (
            f" Without the camera the tip is off by up to {_text(baseline['max_norm_mm'])} mm and "
            f"{_text(baseline['max_angle_deg'])}°, and by {_text(norm(baseline['static_mm']))} mm at rest."
        )
    return text


def _header(summary: Mapping[str, Any], logs: Comparison) -> str:
    colors, source = law_colors(logs), judged_by(summary)
    facts = "".join(
        f'<div class="fact" style="--law:{colors[law]}"><span class="name">{escape(law_title(law))}</span>'
        f"<b>{_text(run[source]['max_norm_mm'])} <small>mm largest</small></b>"
        f"<span>{_text(norm(run[source]['static_mm']))} mm at rest · "
        f"{_text(run[source]['max_angle_deg'])}° largest</span></div>"
        for law, run in summary["runs"].items()
    )
    return (
        '<header><p class="eyebrow">truetip · visual servoing compared</p>'
        f"<h1>Scenario {escape(summary['scenario'])}</h1>"
        f'<p class="verdict">{escape(verdict(summary))}</p></header>'
        f'<div class="facts">{facts}</div>'
    )


def _errors(summary: Mapping[str, Any]) -> str:
    return _card(
        "Largest and static error per axis",
        "From the start of the path to its end, in world axes. Static is the mean over the last half second "
        "of the dwell. The smallest number of each column is marked.",
        _side_by_side(summary, lambda source: _error_table(summary, source)),
    )


def _side_by_side(summary: Mapping[str, Any], table: Callable[[str], str]) -> str:
    """A table of the truth, where it is known, beside one of what was measured."""
    titles = {
        "true": "True: what a perfect instrument would see",
        "measured": "Measured: what the camera says",
    }
    if judged_by(summary) == "measured":
        del titles["true"]
    tables = (f"<div><h3>{title}</h3>{table(source)}</div>" for source, title in titles.items())
    return f'<div class="pair">{"".join(tables)}</div>'


def _error_table(summary: Mapping[str, Any], source: str) -> str:
    colors, body = law_colors(summary["runs"]), ""
    for kind, kind_title in KINDS.items():
        rows = {law: error_row(run[source], kind) for law, run in summary["runs"].items()}
        smallest = smallest_of_columns(list(rows.values()))
        body += f'<tr class="kind"><td colspan="7">{kind_title}</td></tr>'
        for law, row in rows.items():
            cells = "".join(
                f'<td class="best">{format_cell(value)}</td>'
                if is_best(value, best)
                else f"<td>{format_cell(value)}</td>"
                for value, best in zip(row, smallest, strict=True)
            )
            body += f"<tr>{_law_cell(law, colors)}{cells}</tr>"
    return _table(["", *AXES], body)


def _plots(summary: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    chips = "".join(
        f'<button type="button" aria-pressed="true" data-law="{escape(law["id"])}"><i class="dot" '
        f'style="--law:{law["color"]}"></i>{escape(law["title"])}</button>'
        for law in data["laws"]
    )
    is_true = judged_by(summary) == "true"
    if is_true:
        chips += '<button type="button" aria-pressed="true" data-measured="yes">Measured samples</button>'
    chosen = _magnification(data)
    options = "".join(
        f'<option value="{factor}"{" selected" if factor == chosen else ""}>×{factor}</option>'
        for factor in MAGNIFICATIONS
    )
    path_plot = (
        f'<p class="inline"><label>Deviations magnified <select id="magnification">{options}</select>'
        "</label></p>"
        '<div class="plot" id="path"></div>'
    )
    bars = "".join(f'<div class="plot bar" id="bars-{unit}"></div>' for unit in ("mm", "deg"))
    bars = f'<div class="pair">{bars}</div>'
    axes_note = (
        "Lines are true, faint dots are camera samples (thinned out)."
        if is_true
        else "What the camera says; nobody knows the truth on a real station."
    )
    axes_note += " The range fits the laws; double-click for the full range."
    return "\n".join(
        [
            f'<div class="chips">{chips}</div>',
            _card(
                "Error at a glance",
                f"Largest on the path and static, {judged_by(summary)} distance and angle, on a logarithmic "
                "scale.",
                bars,
            ),
            _card(
                "Path",
                f"Wanted path (thin) and {judged_by(summary)} paths with equal axes. The deviation at each "
                "instant is drawn magnified.",
                path_plot,
            ),
            _card(
                "Distance and angle from the wanted pose",
                f"{judged_by(summary).capitalize()} errors on a logarithmic scale, so that tens of "
                "millimetres and a few micrometres share a picture.",
                '<div class="plot" id="distance"></div>',
            ),
            _card("Position error per axis", axes_note, '<div class="plot" id="position"></div>'),
            _card("Orientation error per axis", axes_note, '<div class="plot" id="orientation"></div>'),
        ]
    )


def _magnification(data: Mapping[str, Any]) -> int:
    """The largest factor at which every deviation stays a modest share of the path's extent."""
    wanted = data["laws"][0]["path"]["wanted"]
    extent = max((max(axis) - min(axis) for axis in wanted if axis), default=0.0)
    deviation = max(
        (abs(value) for law in data["laws"] for axis in law["path"]["deviation"] for value in axis),
        default=0.0,
    )
    fitting = [factor for factor in MAGNIFICATIONS if factor * deviation <= MAGNIFIED_SHARE * extent]
    return fitting[-1] if fitting else 1


def _guard(summary: Mapping[str, Any], logs: Comparison) -> str:
    runs, colors = summary["runs"], law_colors(logs)
    kinds = sorted({kind for run in runs.values() for kind, count in run["guard"].items() if count})
    if not kinds:
        return _card("Guard", "No intervention: every command passed as the law wanted it.", "")
    counts = ""
    for law, run in runs.items():
        cells = "".join(f"<td>{run['guard'].get(kind, 0)}</td>" for kind in kinds)
        counts += f"<tr>{_law_cell(law, colors)}{cells}</tr>"
    rows = "".join(
        f"<tr>{_law_cell(law, colors)}<td>{event.time:.3f}</td>"
        f'<td class="text">{escape(event.kind.replace("_", " "))}</td>'
        f'<td class="text">{escape(event.detail)}</td></tr>'
        for law, cycles in logs.items()
        for event in cycles[0].guard_events[:LISTED_EVENTS]
    )
    listed = _table(["law", "time in s", "kind", "what"], rows)
    return _card(
        "Guard",
        "How often the guard changed a command, and when. Only the first events of a run are kept in full.",
        _table(["", *(escape(kind.replace("_", " ")) for kind in kinds)], counts)
        + '<div class="plot" id="events"></div>'
        f"<details><summary>First events in words</summary>{listed}</details>",
    )


def _transient(summary: Mapping[str, Any]) -> str:
    runs, colors = summary["runs"], law_colors(summary["runs"])
    rows = ""
    for law, run in runs.items():
        numbers = run[judged_by(summary)]
        if numbers["settling_s"] is not None:
            overshoot = [*numbers["overshoot_mm"], *numbers["overshoot_deg"]]
            cells = "".join(f"<td>{format_cell(value)}</td>" for value in overshoot)
            rows += f"<tr>{_law_cell(law, colors)}<td>{format_cell(numbers['settling_s'])}</td>{cells}</tr>"
    if not rows:
        return ""
    return _card(
        "Initial error",
        "Settling time to 5 % of the initial distance, and how far each axis went past zero. Runs that never "
        f"settle are left out. {judged_by(summary).capitalize()} errors.",
        _table(["", "settling s", *AXES], rows),
    )


def _iso(summary: Mapping[str, Any]) -> str:
    runs, colors = summary["runs"], law_colors(summary["runs"])
    keys = {"AP_mm": "AP mm", "RP_mm": "RP mm", "AT_mm": "AT mm", "RT_mm": "RT mm", "AP_deg": "AP °"}

    def table(source: str) -> str:
        body = "".join(
            f"<tr>{_law_cell(law, colors)}"
            + "".join(f"<td>{format_cell(run[source]['iso_9283'][key])}</td>" for key in keys)
            + "</tr>"
            for law, run in runs.items()
        )
        return _table(["", *keys.values()], body)

    cycles = max(run[judged_by(summary)]["iso_9283"]["cycles"] for run in runs.values())
    note = (
        "Accuracy and repeatability of the end pose (AP, RP) and of the path (AT, RT). Paths are compared as "
        f"curves, so that lag along the path does not count. {cycles} "
        + ("cycle per law" if cycles == 1 else "cycles per law")
        + ("; repeatability needs at least two." if cycles == 1 else ".")
    )
    return _card("ISO 9283", note, _side_by_side(summary, table))


def _timing(timing: Mapping[str, Any]) -> str:
    colors = law_colors(timing["runs"])
    body = "".join(
        f"<tr>{_law_cell(law, colors)}<td>{_text(run['wall_s'])}</td><td>{_text(run['simulated_s'])}</td>"
        f"<td>{_text(run['real_time_factor'])}</td></tr>"
        for law, run in timing["runs"].items()
    )
    head = ["", "wall s", "simulated s", "real-time factor"]
    return _card("Time", "Of the runs alone, without building and writing.", _table(head, body))


def _scenario(text: str) -> str:
    fold = f"<details><summary>Scenario file</summary><pre>{escape(text)}</pre></details>"
    return f'<section class="card">{fold}</section>'


def _card(title: str, note: str, content: str) -> str:
    return f'<section class="card"><h2>{title}</h2><p class="note">{note}</p>{content}</section>'


def _table(head: list[str], body: str) -> str:
    cells = "".join(f"<th>{name}</th>" for name in head)
    return f'<div class="scroll"><table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table></div>'


def _law_cell(law: str, colors: Mapping[str, str]) -> str:
    return f'<td><i class="dot" style="--law:{colors[law]}"></i>{escape(law_title(law))}</td>'


def _text(value: float | None) -> str:
    """Two digits after the point, two significant ones below 0.01, a dash for nothing."""
    if value is None:
        return "–"
    if 0.0 < value < 1e-4:
        return "<0.0001"
    digits = 2 if value >= 0.01 or value == 0.0 else 3 if value >= 1e-3 else 4
    return f"{value:.{digits}f}"
