"""Two comparisons side by side: their errors over each other, and what differs between them."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from diagrams.scenario.differences import scenario_differences
from experiments.cli.versions import versions_in
from experiments.comparison.errors_table import ERRORS, Course, read_errors
from experiments.comparison.results import SCENARIO
from experiments.metrics.run_metrics import judged_by
from experiments.report.data import norm
from experiments.report.plot_page import Section, html_table, sortable_table
from experiments.report.style import law_colors, law_title

FIGURES = {
    "max_norm_mm": "largest mm",
    "rms_norm_mm": "rms mm",
    "static_mm": "at rest mm",
    "max_angle_deg": "largest °",
}
_DASHES = ("solid", "dash")


@dataclass(frozen=True)
class KeptComparison:
    """What compare and run left in a folder."""

    folder: Path
    summary: dict[str, Any]
    errors: dict[str, Course]
    scenario: str

    def figures(self, law: str) -> dict[str, float | None]:
        """Key figures of a law; None for what is not known."""
        if law not in self.summary["runs"]:
            return dict.fromkeys(FIGURES)
        numbers = self.summary["runs"][law][judged_by(self.summary)]
        return {key: norm(numbers[key]) if key == "static_mm" else numbers[key] for key in FIGURES}


def kept_comparison(folder: Path) -> KeptComparison:
    """Reads a folder.

    Raises:
        OSError: if a file cannot be read.
        ValueError: if it is not what compare and run write.
    """
    missing = [name for name in ("summary.json", ERRORS, SCENARIO) if not (folder / name).is_file()]
    if missing:
        raise ValueError(f"{folder}: there is no {missing[0]}, which compare and run write")
    try:
        result = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        judged_by(result)
    except (KeyError, TypeError, AttributeError, json.JSONDecodeError) as error:
        raise ValueError(f"{folder / 'summary.json'}: no summary of a comparison") from error
    text = (folder / SCENARIO).read_text(encoding="utf-8")
    return KeptComparison(folder, result, read_errors(folder / ERRORS), text)


def beside_sections(one: KeptComparison, other: KeptComparison) -> tuple[str, list[Section]]:
    """The result in a sentence, and the parts of the page."""
    laws = list(dict.fromkeys([*one.summary["runs"], *other.summary["runs"]]))
    changes = scenario_differences(other.scenario, one.scenario)
    versions = [versions_in(each.scenario) for each in (one, other)]
    newer = [
        [name, versions[0].get(name, "–"), versions[1].get(name, "–")]
        for name in dict.fromkeys([*versions[0], *versions[1]])
    ]
    same_versions = all(first == second for _, first, second in newer)
    names = folder_names(one.folder, other.folder)
    differing = [list(row) for row in ((place, before, after) for place, after, before in changes)]
    sections = [
        Section(
            "Errors over each other",
            "Distance and angle of the tip from the wanted pose: lines are "
            f"{names[0]} ({one.folder}), dashes {names[1]} ({other.folder}).",
            _figure([one, other], names),
            620,
        ),
        Section(
            "Key figures",
            "A change below 0 is better in the second.",
            sortable_table("figures", ["law", "figure", *names, "change %"], _rows(laws, one, other)),
        ),
        Section(
            "What differs between the scenarios",
            "" if differing else "Nothing: all fields are the same.",
            html_table(["field", *names], differing) if differing else "",
        ),
        Section(
            "Versions",
            "The same." if same_versions else "",
            html_table(["package", *names], newer) if newer else "",
        ),
    ]
    return _verdict(laws, one, other, len(differing), same_versions), sections


def _verdict(
    laws: list[str], one: KeptComparison, other: KeptComparison, changes: int, same_versions: bool
) -> str:
    both = [law for law in laws if law in one.summary["runs"] and law in other.summary["runs"]]
    said = []
    for law in both:
        before, after = one.figures(law)["max_norm_mm"], other.figures(law)["max_norm_mm"]
        if before is not None and after is not None:
            said.append(f"{law_title(law)} {before:.3g} → {after:.3g} mm")
    fields = {0: "no field", 1: "one field"}.get(changes, f"{changes} fields")
    versions = "the same versions" if same_versions else "other versions"
    early = [
        f" {law_title(law)} did not come to the end of its path in {each.folder}."
        for each in (one, other)
        for law in laws
        if "unfinished" in each.summary["runs"].get(law, {})
    ]
    return (
        f"Largest error: {', '.join(said) or 'no law in both'}; {fields} of the scenario changed, {versions}."
        + "".join(early)
    )


def folder_names(one: Path, other: Path) -> list[str]:
    """What tells two folders apart: their ways from the folder that holds both."""
    places = [os.path.abspath(each) for each in (one, other)]
    short = [os.path.relpath(each, os.path.commonpath(places)) for each in places]
    return [str(one), str(other)] if os.curdir in short else short


def _figure(kept: list[KeptComparison], names: list[str]) -> go.Figure:
    figure = make_subplots(2, 1, shared_xaxes=True, vertical_spacing=0.08)
    colors = law_colors(dict.fromkeys(law for each in kept for law in each.errors))
    for each, folder, dash in zip(kept, names, _DASHES, strict=True):
        for law, (time, distance, angle) in each.errors.items():
            name = f"{law_title(law)}, {folder}"
            for row, values in ((1, distance), (2, angle)):
                line = {"color": colors[law], "dash": dash, "width": 1.5}
                figure.add_trace(
                    go.Scatter(x=time, y=values, name=name, legendgroup=name, line=line, showlegend=row == 1),
                    row,
                    1,
                )
    figure.update_yaxes(title="distance in mm", type="log", row=1)
    figure.update_yaxes(title="angle in °", type="log", row=2)
    return figure.update_xaxes(title="time in s", row=2)


def _rows(laws: list[str], one: KeptComparison, other: KeptComparison) -> list[list[str]]:
    rows = []
    for law in laws:
        before, after = one.figures(law), other.figures(law)
        for key, name in FIGURES.items():
            a, b = before[key], after[key]
            change = f"{100.0 * (b / a - 1.0):+.1f}" if a and b is not None else "–"
            rows.append([law_title(law), name, *("–" if x is None else f"{x:.4g}" for x in (a, b)), change])
    return rows
