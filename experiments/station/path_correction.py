"""What ``truetip run --mode path_correction`` does: a controller's own path, corrected by the camera."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import typer
from rich.console import Console
from rich.markup import escape

from diagrams.hardware_link import EndedOnRequest
from diagrams.record.recorded_link import RecordedStation
from diagrams.runs.path_correction import CorrectedPass, PathCorrectionRun
from diagrams.runs.virtual_cell import CellRecord
from experiments.cli.console import BROKEN_OFF, fail, print_files, progress_bar, refusing
from experiments.cli.ending import asking
from experiments.cli.option_limits import one_of
from experiments.cli.prepare import Prepared
from experiments.cli.staging import staged_folder
from experiments.report.files import write_json
from experiments.report.plot_page import Section, html_table, write_plot_page
from experiments.station.clients import station_clients
from experiments.station.kept_record import kept_record
from systems.link.udp_channel import ChannelError

JOINT, PATH_CORRECTION = "joint", "path_correction"
MODES = (JOINT, PATH_CORRECTION)
_CORRECTED, _PLAIN = "corrected", "without correction"
_ACROSS = (
    "Across: at right angles to the edge that the robot is on by its joints. At a corner the tool is beside "
    "the edge before it, too, by what lies along the edge behind it: no path correction takes that away."
)
_PAGE, _NUMBERS, _RECORD = "path_correction.html", "path_correction.json", "path_correction.mcap"


@dataclass(frozen=True)
class _Pass:
    """A pass and, of a virtual cell, the truth about it."""

    found: CorrectedPass
    true_beside: np.ndarray | None = None  # (m, 2) m
    true_across: np.ndarray | None = None  # (m, 2) m, across the edge that the robot is on


def refuse_mode(mode: str, prepared: Prepared, given: dict[str, Any]) -> None:
    """Refuses a mode that there is not, or that makes no sense with the station and the options given.

    Args:
        mode: as typed.
        prepared: what to run.
        given: options that belong to laws, by name; None where they were not given.

    Raises:
        ValueError: one line.
    """
    one_of("--mode", MODES, mode)
    if mode == JOINT:
        return
    station = prepared.scenario.station
    if station.kind == "simulated":
        raise ValueError(
            "--mode path_correction corrects the program of a controller: add --station egm, or --with-cell"
        )
    if station.link.kind != "egm":
        raise ValueError(
            f"--mode path_correction is of ABB's EGM, got a station that speaks {station.link.title}"
        )
    if station.overview.enabled:
        raise ValueError(
            "--mode path_correction does not watch for people: the controller runs its own path and would "
            "not stop for them; add --set station.overview.enabled=false"
        )
    for name, value in given.items():
        if value not in (None, False):
            raise ValueError(
                f"{name} does not go with --mode path_correction: the controller runs its own path, no law"
            )


def correct_path(console: Console, prepared: Prepared, with_cell: bool, out: Path) -> None:
    """Runs it and writes page, numbers and record; with a virtual cell also a pass without correction.

    Raises:
        typer.Exit: if it did not reach the end of the path.
    """
    passes: dict[str, _Pass] = {}
    with refusing(ValueError, OSError, ChannelError), ExitStack() as stack:
        run = PathCorrectionRun(prepared.scenario, prepared.robot)
        stage = stack.enter_context(staged_folder(out))
        names = (_PLAIN, _CORRECTED) if with_cell else (_CORRECTED,)
        end = stack.enter_context(asking())
        progress = stack.enter_context(progress_bar("the controller's path"))
        try:
            for number, name in enumerate(names):
                passes[name] = _run(
                    prepared,
                    run,
                    (with_cell, out / _RECORD if name == _CORRECTED else None),
                    name == _CORRECTED,
                    lambda share, number=number: progress((number + share) / len(names)),
                    end.is_asked,
                )
                if passes[name].found.ended != "path":
                    break
        except EndedOnRequest:
            fail("ended on request before the path began", end.code or BROKEN_OFF)
        numbers = {name: _numbers(each) for name, each in passes.items()}
        write_json(stage / _NUMBERS, numbers)
        said = _verdict(numbers)
        write_plot_page(stage / _PAGE, f"Path correction, {prepared.title}", said, _sections(passes, numbers))
    console.print(escape(said))
    files = [out / name for name in (_PAGE, _NUMBERS, _RECORD) if (out / name).exists()]
    print_files(console, *files)
    ended = [each.found.ended for each in passes.values() if each.found.ended != "path"]
    if ended:
        typer.echo(f"truetip: {ended[0]}", err=True)
        raise typer.Exit(end.code or BROKEN_OFF)


def _run(
    prepared: Prepared,
    run: PathCorrectionRun,
    options: tuple[bool, Path | None],
    corrects: bool,
    progress: Callable[[float], None],
    is_asked_to_end: Callable[[], bool],
) -> _Pass:
    with_cell, record_file = options
    with ExitStack() as stack:
        station = stack.enter_context(station_clients(prepared.scenario, prepared.robot, with_cell, True))
        client: Any = station.client  # EGM's, which takes corrections
        camera = station.camera
        assert camera is not None
        if record_file:
            record = kept_record(stack, record_file, prepared.kept)
            recorded = RecordedStation(client, camera, record)
            client, camera = recorded.client, recorded.camera
        found = run.run(client, camera, corrects, progress, is_asked_to_end=is_asked_to_end)
    truth: CellRecord | None = station.cell.truth if station.cell else None
    if truth is None:
        return _Pass(found)
    X_WE, _ = truth.at(found.stamps)
    known = np.isfinite(X_WE[:, 0, 3])
    tool = X_WE[known, :3, 3]
    return _Pass(found, run.beside(tool), run.across(tool, found.places[known]))


def _numbers(each: _Pass) -> dict[str, Any]:
    found = each.found
    result: dict[str, Any] = {"ended": found.ended, "exposures": len(found.along), "length_m": found.length}
    for name, beside in (
        ("beside_camera", found.beside),
        ("beside_true", each.true_beside),
        ("across_true", each.true_across),
    ):
        if beside is not None and len(beside):
            off = np.linalg.norm(beside, axis=1)
            result[f"median_{name}_m"] = float(np.median(off))
            result[f"rms_{name}_m"] = float(np.sqrt(np.mean(off**2)))
            result[f"largest_{name}_m"] = float(off.max())
    return result


def _verdict(numbers: dict[str, dict[str, Any]]) -> str:
    said = []
    for name, each in numbers.items():
        kind = "true" if "rms_beside_true_m" in each else "camera"
        if f"rms_beside_{kind}_m" not in each:
            said.append(f"{name}: nothing was seen")
            continue
        sizes = [1e3 * each[f"{size}_beside_{kind}_m"] for size in ("median", "rms", "largest")]
        end = "" if each["ended"] == "path" else f" (not the whole path: {each['ended']})"
        beside = "{:.3g} mm beside the path in the median, {:.3g} rms, {:.3g} at most".format(*sizes)
        if "largest_across_true_m" in each:
            beside += f" ({1e3 * each['largest_across_true_m']:.3g} across the edge that the robot is on)"
        said.append(f"{name}: {beside}{end}")
    text = "; ".join(said)
    return f"{text[:1].upper()}{text[1:]}."


def _sections(passes: dict[str, _Pass], numbers: dict[str, dict[str, Any]]) -> list[Section]:
    beside, asked = go.Figure(), go.Figure()
    for name, each in passes.items():
        found = each.found
        off = 1e3 * np.linalg.norm(found.beside, axis=1)
        beside.add_trace(go.Scatter(x=found.along, y=off, mode="lines", name=name))
        for axis, values in zip("yz", found.asked.T, strict=True):
            if name == _CORRECTED:
                asked.add_trace(go.Scatter(x=found.along, y=1e3 * values, mode="lines", name=axis))
    for figure, title in ((beside, "beside the path in mm"), (asked, "correction in mm")):
        figure.update_layout(xaxis={"title": "along the path in m"}, yaxis={"title": title})
    sizes = [key for key in next(iter(numbers.values())) if key.endswith("_m")]
    rows = [
        [
            key.removesuffix("_m").replace("_", " ") + " in mm",
            *(f"{1e3 * each[key]:.3f}" if key in each else "" for each in numbers.values()),
        ]
        for key in sizes
    ]
    return [
        Section(
            "Beside the path",
            "From the tool to the path by the camera, at a right angle. What lies along the path cannot be "
            "corrected: behind a corner it lies across, until the correction has been taken up.",
            beside,
        ),
        Section("Correction", "As sent to the controller, in the frame of its path.", asked, 320),
        Section(
            "Numbers",
            _ACROSS if "largest_across_true_m" in next(iter(numbers.values())) else "",
            html_table(("", *numbers), rows),
        ),
    ]
