"""The report of a comparison: one HTML file that opens offline and explains itself."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from diagrams.scenario.differences import scenario_differences
from experiments.metrics.run_metrics import Comparison, best_law, judged_by
from experiments.report.data import norm, plot_data
from experiments.report.error_panels import error_panels
from experiments.report.error_rows import AXES, KINDS, error_row, format_cell, is_best, smallest_of_columns
from experiments.report.joint_panels import joint_panels
from experiments.report.page import write_page
from experiments.report.style import law_colors, law_title
from experiments.report.worst_instant import worst_instants
from robots.description.model import RobotModel

MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100, 200, 500)
MAGNIFIED_SHARE = 0.25  # of the path's extent that the largest deviation may fill when the page opens
LAP_COLUMNS = {"max_norm_mm": "mm", "max_angle_deg": "°", "rms_mm": "rms mm", "duration_s": "s"}
LISTED_EVENTS = 100  # per law
SOURCES = {
    "true": "True: what a perfect instrument would see",
    "measured": "Measured: what the camera says",
}
ISO_COLUMNS = {"AP_mm": "AP mm", "RP_mm": "RP mm", "AT_mm": "AT mm", "RT_mm": "RT mm", "AP_deg": "AP °"}

Rows = list[tuple[str, list[str]]]  # of a table: a law and its cells


def write_report(
    path: str | Path,
    scenario_text: str,
    summary: Mapping[str, Any],
    timing: Mapping[str, Any],
    logs: Comparison,
    robot: RobotModel | None = None,
) -> None:
    """Writes the report as one self-contained HTML file, atomically.

    Args:
        path: where to.
        scenario_text: the scenario as YAML, shown as it is.
        summary: `metrics.summary` of the logs, and what is ``assumed`` of the robot if anything is.
        timing: `metrics.timing` of the logs.
        logs: law -> one log per cycle; the first cycle is drawn.
        robot: with the geometry that it truly has, for its picture and the limits of its joints; None where
            nobody knows it.

    Raises:
        OSError: if the folder is missing or cannot be written.
        ValueError: if a number of the plots is NaN or infinite.
    """
    data, colors, runs = plot_data(summary, logs), law_colors(logs), summary["runs"]
    panels = [*error_panels(logs), *joint_panels(logs, robot)]
    worst = worst_instants(logs, robot) if robot is not None else None
    source = judged_by(summary)
    write_page(
        path,
        "report.html",
        title=f"{summary['scenario']}: visual servoing compared",
        scenario=summary["scenario"],
        scenario_text=scenario_text,
        verdict=verdict(summary),
        assumed=summary.get("assumed", ""),
        laws={law: {"title": law_title(law), "color": colors[law]} for law in logs},
        facts=[_fact(law, run[source]) for law, run in runs.items()],
        axes=list(AXES),
        judged_by=source,
        is_true=source == "true",
        sources=[
            {"title": title, "errors": _errors(summary, name), "iso": _iso(summary, name)}
            for name, title in SOURCES.items()
            if source == "true" or name == "measured"
        ],
        magnifications=MAGNIFICATIONS,
        magnification=_magnification(data),
        guard=_guard(summary, logs),
        transient=_transient(summary),
        laps=_laps(summary),
        iso={"head": list(ISO_COLUMNS.values()), "note": _iso_note(summary)},
        timing=_timing(timing),
        data=data | {"panels": [panel.data() for panel in panels], "worst": worst},
        worst=worst is not None,
        panels=[
            {"id": p.id, "title": p.title, "note": p.note, "height": 760 if len(p.axes) > 3 else 440}
            for p in panels
        ],
        differences=_differences(scenario_text, logs),
    )


_TIPS = {"true": "the true tip", "measured": "the tip, as the camera sees it,"}


def verdict(summary: Mapping[str, Any]) -> str:
    """The result in one or two sentences of plain text; before them who did not come to the end of a path."""
    runs = summary["runs"]
    stops = [
        f"{law_title(law)} did not come to the end of its path: {run['unfinished']}{_full_stop(run)} "
        for law, run in runs.items()
        if "unfinished" in run
    ]
    return "".join(stops) + _verdict_of_best(summary)


def _is_whole(run: Mapping[str, Any], source: str) -> bool:
    return "unfinished" not in run and run[source]["max_norm_mm"] is not None


def _full_stop(run: Mapping[str, Any]) -> str:
    return "" if run["unfinished"].endswith("?") else "."


def _verdict_of_best(summary: Mapping[str, Any]) -> str:
    best, runs = best_law(summary), summary["runs"]
    source = judged_by(summary)
    numbers, tip = runs[best][source], _TIPS[source]
    if numbers["max_norm_mm"] is None:
        return f"{law_title(best)}: no pose of the tip was seen on the path, so its error is not known."
    if "unfinished" in runs[best]:
        return (
            f"{law_title(best)} let {tip} be up to {_text(numbers['max_norm_mm'])} mm and "
            f"{_text(numbers['max_angle_deg'])}° from the wanted path."
        )
    if numbers["settling_s"] is None:
        course = (
            f"keeps {tip} within {_text(numbers['max_norm_mm'])} mm and "
            f"{_text(numbers['max_angle_deg'])}° of the wanted path"
        )
    else:
        course = (
            f"keeps {tip} within {_text(numbers['max_norm_mm'])} mm of the wanted path, within 5 % of the "
            f"distance at the start after {_text(numbers['settling_s'])} s,"
        )
    off, turned = norm(numbers["static_mm"]), norm(numbers["static_deg"])
    rest = f"comes to rest {_text(off)} mm and {_text(turned)}° from it"
    if off is None:  # the run was ended, or the camera was blind then
        rest = "was not seen at rest"
    text = f"{law_title(best)} {course} and {rest}."
    baseline = runs.get("open_loop", {}).get(source)
    if baseline and best != "open_loop" and _is_whole(runs["open_loop"], source):
        text += (
            f" Without the camera the tip is off by up to {_text(baseline['max_norm_mm'])} mm and "
            f"{_text(baseline['max_angle_deg'])}°, and by {_text(norm(baseline['static_mm']))} mm at rest."
        )
    return text


def _fact(law: str, numbers: Mapping[str, Any]) -> dict[str, str]:
    return {
        "law": law,
        "largest_mm": _text(numbers["max_norm_mm"]),
        "static_mm": _text(norm(numbers["static_mm"])),
        "largest_deg": _text(numbers["max_angle_deg"]),
    }


def _errors(summary: Mapping[str, Any], source: str) -> list[tuple[str, list[tuple[str, list]]]]:
    """For each kind of error a row for each law, of cells with whether they are the smallest."""
    groups = []
    for kind, title in KINDS.items():
        rows = {law: error_row(run[source], kind) for law, run in summary["runs"].items()}
        smallest = smallest_of_columns(list(rows.values()))
        marked = [
            (law, [(format_cell(v), is_best(v, best)) for v, best in zip(row, smallest, strict=True)])
            for law, row in rows.items()
        ]
        groups.append((title, marked))
    return groups


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


def _guard(summary: Mapping[str, Any], logs: Comparison) -> dict[str, Any]:
    """How often the guard intervened, by kind, and its first events."""
    runs = summary["runs"]
    kinds = sorted({kind for run in runs.values() for kind, count in run["guard"].items() if count})
    return {
        "kinds": [_words(kind) for kind in kinds],
        "counts": [(law, [str(run["guard"].get(kind, 0)) for kind in kinds]) for law, run in runs.items()],
        "events": [
            {
                "law": law,
                "time": f"{event.time:.3f}",
                "kind": _words(event.kind),
                "detail": event.detail,
            }
            for law, cycles in logs.items()
            for event in cycles[0].guard_events[:LISTED_EVENTS]
        ],
    }


def _transient(summary: Mapping[str, Any]) -> Rows:
    rows = []
    for law, run in summary["runs"].items():
        numbers = run[judged_by(summary)]
        if numbers["settling_s"] is not None:
            values = [numbers["settling_s"], *numbers["overshoot_mm"], *numbers["overshoot_deg"]]
            rows.append((law, _cells(values)))
    return rows


def _laps(summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """Head and rows of the table of laps; None where paths are run once."""
    laps = {law: run.get("laps", []) for law, run in summary["runs"].items()}
    count = max(map(len, laps.values()))
    if not count:
        return None
    return {
        "head": [f"lap {number}, {what}" for number in range(1, count + 1) for what in LAP_COLUMNS.values()],
        "rows": [
            (law, _cells([lap[name] for lap in each for name in LAP_COLUMNS])) for law, each in laps.items()
        ],
    }


def _iso(summary: Mapping[str, Any], source: str) -> Rows:
    return [
        (law, _cells([run[source]["iso_9283"][key] for key in ISO_COLUMNS]))
        for law, run in summary["runs"].items()
    ]


def _iso_note(summary: Mapping[str, Any]) -> str:
    cycles = max(run[judged_by(summary)]["iso_9283"]["cycles"] for run in summary["runs"].values())
    return (
        "Accuracy and repeatability of the end pose (AP, RP) and of the path (AT, RT). Paths are compared as "
        f"curves, so that lag along the path does not count. {cycles} "
        + ("cycle per law" if cycles == 1 else "cycles per law")
        + ("; repeatability needs at least two." if cycles == 1 else ".")
    )


def _differences(text: str, logs: Comparison) -> list[tuple[str, str, str]]:
    """What the scenario changes, without the gains of laws that did not run."""
    idle = "servo.laws."
    return [
        row
        for row in scenario_differences(text)
        if row[0] != "description"
        and (not row[0].startswith(idle) or any(row[0].startswith(f"{idle}{law}.") for law in logs))
    ]


def _timing(timing: Mapping[str, Any]) -> Rows:
    keys = ("wall_s", "simulated_s", "real_time_factor")
    return [(law, [_text(run[key]) for key in keys]) for law, run in timing["runs"].items()]


def _cells(values: Sequence[float | None]) -> list[str]:
    return [format_cell(value) for value in values]


def _words(kind: str) -> str:
    return kind.replace("_", " ")


def _text(value: float | None) -> str:
    """Two digits after the point, two significant ones below 0.01, a dash for nothing."""
    if value is None:
        return "–"
    if 0.0 < value < 1e-4:
        return "<0.0001"
    digits = 2 if value >= 0.01 or value == 0.0 else 3 if value >= 1e-3 else 4
    return f"{value:.{digits}f}"
