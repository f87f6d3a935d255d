"""``truetip runs``: an index of the runs in a folder, with their key figures."""

import json
import os
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer
from markupsafe import Markup, escape

from experiments.cli.console import count, print_files, progress_bar, refusing
from experiments.cli.json_output import human_console, json_output
from experiments.cli.options import JsonOption, PictureOption
from experiments.cli.staging import PAGE, staged_file
from experiments.metrics.run_metrics import judged_by
from experiments.record.runs_beside import beside_sections, kept_comparison
from experiments.report.data import norm
from experiments.report.plot_page import Section, sortable_table, write_plot_page
from experiments.report.style import law_title

_FIGURES = ("largest mm", "rms mm", "at rest mm", "largest °")
_HEAD = ("folder", "scenario", "law", "judged by", *_FIGURES, "guard", "made")
_NAMED = 3  # files that are left out, by name
_PAGES = ("report.html", "replay.html")
_NOTE = (
    "A line for each law of each comparison below the folder. Click on a head to sort; words in the field "
    "hide what does not have them. Guard: ticks with an intervention."
)


def runs_command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with results of compare and run.")],
    beside: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Another one: the page shows both side by side and what differs."),
    ] = None,
    report: PictureOption = Path("out/runs.html"),
    json_file: JsonOption = None,
) -> None:
    """List the runs below a folder on a page, or show two of them side by side."""
    human = human_console(json_file)
    with json_output(json_file) as output, refusing(ValueError, OSError), ExitStack() as stack:
        if not folder.is_dir():
            raise ValueError(f"{folder}: is no folder")
        page = stack.enter_context(staged_file(report, *PAGE))
        stack.enter_context(output.staged())
        if beside is not None:
            kept = [kept_comparison(each) for each in (folder, beside)]
            verdict, sections = beside_sections(*kept)
            write_plot_page(page, "Two runs side by side", verdict, sections)
            output.write({str(each.folder): each.summary for each in kept})
        else:
            verdict = _index(folder, report, page, output)
    human.print(verdict, markup=False, soft_wrap=True)
    print_files(human, report)


def _index(folder: Path, report: Path, page: Path, output: Any) -> str:
    """Writes the page of all runs below a folder; returns its sentence."""
    others: list[Path] = []
    with progress_bar("reading") as progress:
        found = list(runs_below(folder, others, progress))
    if not found:
        foreign = f", {others[0]} is none of theirs" if others else ""
        raise ValueError(f"{folder}: there is no summary.json below it, which compare and run write{foreign}")
    rows = [_row(run, folder, report.parent) for run in found]
    comparisons = count(len({run["folder"] for run in found}), "comparison")
    verdict = f"{count(len(found), 'law')} in {comparisons} below {folder.resolve()}."
    if others:
        verdict += f" Left out, as no comparison wrote it: {', '.join(map(str, others[:_NAMED]))}"
        verdict += f" and {len(others) - _NAMED} more." if len(others) > _NAMED else "."
    table = sortable_table("runs", _HEAD, rows, has_filter=True)
    write_plot_page(page, "Runs", verdict, [Section("Runs", _NOTE, table)])
    output.write(found)
    return verdict


def runs_below(folder: Path, others: list[Path], progress: Any = None) -> Iterator[dict[str, Any]]:
    """Key figures of every law of every ``summary.json`` below a folder, the newest first.

    Args:
        folder: to look in.
        others: takes the files of this name that are not what compare and run write.
        progress: is called with the share that is done, 0 to 1.

    Raises:
        OSError: if a file cannot be read.
    """
    files = sorted(folder.rglob("summary.json"), key=lambda file: (-file.stat().st_mtime, str(file)))
    for number, file in enumerate(files):
        try:
            result = json.loads(file.read_text(encoding="utf-8"))
            source = judged_by(result)
            rows = [
                {
                    "folder": str(file.parent),
                    "scenario": result["scenario"],
                    "law": law,
                    "judged_by": source,
                    "max_norm_mm": run[source]["max_norm_mm"],
                    "rms_norm_mm": run[source]["rms_norm_mm"],
                    "static_mm": norm(run[source]["static_mm"]),
                    "max_angle_deg": run[source]["max_angle_deg"],
                    "guard": sum(run["guard"].values()),
                    "unfinished": run.get("unfinished", ""),
                    "made": time.strftime("%Y-%m-%d %H:%M", time.localtime(file.stat().st_mtime)),
                }
                for law, run in result["runs"].items()
            ]
        except (KeyError, TypeError, AttributeError, ValueError):
            others.append(file)
        else:
            yield from rows
        if progress:
            progress((number + 1) / len(files))


def _row(run: dict[str, Any], folder: Path, beside: Path) -> list[str]:
    place = Path(run["folder"])
    name = escape(os.path.relpath(place, folder))
    links = [
        Markup(' <a href="{}">{}</a>').format(_address(place / page, beside), page.removesuffix(".html"))
        for page in _PAGES
        if (place / page).exists()
    ]
    numbers = [run[key] for key in ("max_norm_mm", "rms_norm_mm", "static_mm", "max_angle_deg")]
    return [
        name + Markup("").join(links),
        run["scenario"],
        law_title(run["law"]),
        run["judged_by"],
        *("–" if value is None else f"{value:.3f}" for value in numbers),
        f"{run['guard']}{', did not finish' if run['unfinished'] else ''}",
        run["made"],
    ]


def _address(page: Path, beside: Path) -> str:
    return Path(os.path.relpath(page, beside)).as_posix()
