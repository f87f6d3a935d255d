"""Pages of `truetip watch`: timeline, plan of the cell with zones, pictures with hull and boxes, errors."""

from base64 import b64encode
from pathlib import Path

import cv2
import numpy as np
import plotly.graph_objects as go

from experiments.cli.console import count
from experiments.report.plot_page import Section, html_table, write_plot_page
from experiments.watch.run import WatchRun, parts
from experiments.watch.study import WatchStudy
from systems.vision.camera_model import Cameras
from systems.vision.people.surroundings import Surroundings
from systems.vision.people.visual_hull import Body

AID = "An aid, not a safety function: it must not replace fences, light curtains or a rated controller."
_SHOWN = 4  # cameras
_MOST_SHOWN = 6000  # times of a timeline: two minutes of a running cell with every decision
_STOP, _SLOW, _THINGS = "#d55e00", "#8a6d00", "#8a95a5"
_AT_THE_ROBOT = 0.01  # m: what is nearer is not told apart
_HULL, _BOX, _NETWORK = (60, 60, 230), (0, 200, 255), (80, 220, 80)  # blue, green, red


def write_run_page(
    path: str | Path,
    title: str,
    run: WatchRun,
    cameras: Cameras,
    ground: Surroundings,
    rates: dict[str, float],
) -> None:
    """Writes the page of a run.

    Args:
        path: where to.
        title: of the page.
        run: what happened.
        cameras: of the pictures.
        ground: what stands in the cell.
        rates: of data in Gbit/s, of `data_rates`.
    """
    sections = [
        Section(
            "Distance and speed",
            "Distances are held from image to image; the speed is that of the path, or in a running cell the "
            "one allowed. The robot slows down where the measured distance is below the protective one.",
            _timeline(run),
            520,
        ),
        Section(
            "Plan of the cell",
            "The way of the nearest person, and how far about the base the robot slows down and stops.",
            _plan(run, ground),
            620,
        ),
        Section("Protective distance", "Terms of ISO/TS 15066 at full speed.", _terms(run)),
        Section(
            "Data rates",
            "Of all cameras together without compression, and what a fibre link carries (Probst 2024, 8.1).",
            html_table(
                ("images", "rate"),
                [[name.replace("_", " "), f"{value:g} Gbit/s"] for name, value in rates.items()],
            ),
        ),
    ]
    if run.snapshot is not None:
        note = f"At {run.snapshot.time:.2f} s: dots are the middles of the cubes of the hull."
        if run.boxes is not None:
            seen = f"{run.confirmed} of {len(run.boxes)} images"
            note += f" Green boxes are people to the network, which sees this one in {seen}."
        sections.insert(
            2,
            Section(
                "Where somebody was nearest",
                note,
                _pictures(run.snapshot.images, run.snapshot.bodies, cameras, run.boxes),
            ),
        )
    if run.changes:
        note = "Somebody who stands still looks the same, so that the robot keeps its distance all the same."
        sections.insert(1, Section("Changes of the cell that stay", note, _changes(run, cameras)))
    write_plot_page(path, title, f"{run_verdict(run)} {AID}", sections)


def write_study_page(path: str | Path, title: str, study: WatchStudy) -> None:
    """Writes the page of a study."""
    places = [each for each in study.places if np.isfinite(each.measured)]
    errors = go.Figure(
        go.Scatter(
            x=[each.true for each in places],
            y=[each.measured - each.true for each in places],
            mode="markers",
            hovertemplate="%{x:.2f} m: %{y:+.3f} m<extra></extra>",
        )
    )
    errors.add_hline(y=0.1, line={"dash": "dot", "width": 1})
    errors.update_layout(xaxis={"title": "true distance in m"}, yaxis={"title": "measured less true in m"})
    plan = _ground(study.surroundings)
    plan.add_trace(
        go.Scatter(
            x=[each.place[0] for each in study.places],
            y=[each.place[1] for each in study.places],
            mode="markers",
            showlegend=False,
            marker={
                "color": [
                    each.measured - each.true if np.isfinite(each.measured) else 1.0 for each in study.places
                ],
                "colorscale": "RdBu_r",
                "cmid": 0.0,
                "colorbar": {"title": "error in m"},
                "size": 12,
            },
        )
    )
    sections = [
        Section("Error of the distance", "Above the line it would be more than 0.1 m too far.", errors),
        Section(
            "Places", "Where people stood, coloured by the error; grey is what stands in the cell.", plan, 620
        ),
    ]
    write_plot_page(path, title, f"{study_verdict(study)} {AID}", sections)


def run_verdict(run: WatchRun) -> str:
    """A run in a sentence or two."""
    numbers = run.as_dict()
    nearest = numbers["smallest_distance_m"]
    if nearest is None:
        seen = "nobody was seen"
    elif nearest < _AT_THE_ROBOT:
        seen = "somebody was seen so near that no distance to the robot was left"
    else:
        seen = f"the nearest was seen {nearest:.2f} m from the robot"
    return (
        f"In {numbers['duration_s']:.1f} s {seen}; {count(numbers['stops'], 'stop')}, "
        f"slowed for {numbers['slowed_s']:.1f} s, "
        f"stopped for {numbers['stopped_s']:.1f} s{_stays(len(run.changes))}."
    )


def _stays(changes: int) -> str:
    if not changes:
        return ""
    return f"; {count(changes, 'change')} of the cell that {'stays' if changes == 1 else 'stay'}"


def study_verdict(study: WatchStudy) -> str:
    """A study in a sentence or two."""
    numbers = study.as_dict()
    found = f"{numbers['found']} of {numbers['places']} people found"
    if numbers["found"]:
        found += (
            f", distances at most {numbers['largest_overestimate_m']:+.3f} m too far, "
            f"{numbers['median_abs_error_m']:.3f} m off in the median"
        )
    empty = (
        f" {numbers['empty_minutes']:g} minutes of the empty cell with the robot in motion and 5 % more and "
        f"less light, {count(numbers['empty_sets'], 'set')} of images: "
        f"{count(numbers['false_stops'], 'stop')}."
        if numbers["empty_sets"]
        else ""
    )
    return f"{found}; {numbers['ms_per_set']:.0f} ms for a set of images.{empty}"


def _timeline(run: WatchRun) -> go.Figure:
    line = run.timeline.thinned(_MOST_SHOWN)
    figure = go.Figure()
    for name, values in (
        ("distance, measured", line.distance),
        ("distance, true", line.true),
        ("protective distance", line.protective),
    ):
        if np.isfinite(values).any():
            figure.add_trace(go.Scatter(x=line.time, y=values, name=name, mode="lines"))
    figure.add_trace(
        go.Scatter(x=line.time, y=line.rate, name="speed", yaxis="y2", mode="lines", line={"dash": "dot"})
    )
    figure.add_trace(
        go.Scatter(x=line.time, y=line.stopped.astype(int), name="stop", yaxis="y2", mode="lines",
                   fill="tozeroy", fillcolor="rgba(213,94,0,0.15)", line={"width": 0, "color": _STOP})
    )  # fmt: skip
    return figure.update_layout(
        xaxis={"title": "time in s"},
        yaxis={"title": "distance in m", "rangemode": "tozero"},
        yaxis2={
            "title": "share of the speed",
            "overlaying": "y",
            "side": "right",
            "range": [0, 1.05],
            "tickmode": "linear",
            "dtick": 0.2,
        },
    )


def _ground(ground: Surroundings) -> go.Figure:
    """Furniture from above."""
    figure = go.Figure()
    for each in ground.furniture:
        corners = each.corners[[0, 2, 6, 4, 0]]
        figure.add_trace(
            go.Scatter(
                x=corners[:, 0],
                y=corners[:, 1],
                fill="toself",
                mode="lines",
                name=each.name,
                line={"width": 1, "color": _THINGS},
                showlegend=False,
            )
        )
    figure.update_layout(xaxis={"title": "x in m"}, yaxis={"title": "y in m", "scaleanchor": "x"})
    return figure


def _plan(run: WatchRun, ground: Surroundings) -> go.Figure:
    figure, angle = _ground(ground), np.linspace(0.0, 2.0 * np.pi, 90)
    at_rest = run.terms["total"] - run.terms["reaction"] - run.terms["stopping"]
    for name, radius, colour in (("stop", at_rest, _STOP), ("slow", run.terms["total"], _SLOW)):
        figure.add_trace(
            go.Scatter(x=radius * np.cos(angle), y=radius * np.sin(angle), mode="lines", name=name,
                       line={"dash": "dash", "color": colour})
        )  # fmt: skip
    line = run.timeline.thinned(_MOST_SHOWN)
    figure.add_trace(
        go.Scatter(x=line.place[:, 0], y=line.place[:, 1], mode="markers", name="person",
                   marker={"color": line.rate, "colorscale": "RdYlGn", "cmin": 0, "cmax": 1, "size": 6,
                           "colorbar": {"title": {"text": "share of the speed", "side": "right"}}})
    )  # fmt: skip
    return figure


def _terms(run: WatchRun) -> str:
    rows = [[name.replace("_", " "), f"{value:.3f} m"] for name, value in run.terms.items()]
    rows += [[f"reaction time: {name}", f"{value:.3f} s"] for name, value in parts(run.cell.reaction).items()]
    rows += [["note", note] for note in run.notes]
    return html_table(("term", "value"), rows)


def _changes(run: WatchRun, cameras: Cameras) -> str:
    """A table of what is new and stays, each with pictures, as HTML."""
    rows, pictures = [], []
    for number, each in enumerate(run.changes, 1):
        said = run.described(each)
        place, size = (", ".join(f"{v:.2f}" for v in said[name]) for name in ("place_m", "size_m"))
        since = f"{said['since_s']:.1f} s"
        rows.append([str(number), since, f"{place} m", f"{size} m", f"{1e3 * said['volume_m3']:.0f} l"])
        pictures.append(_pictures(each.images, [each.standing.body], cameras, None, 2))
    head = ("number", "since", "place x, y, z", "size along x, y, z", "volume")
    return html_table(head, rows) + "".join(pictures)


def _pictures(
    images: np.ndarray,
    bodies: list[Body],
    cameras: Cameras,
    boxes: list[np.ndarray] | None,
    shown: int = _SHOWN,
) -> str:
    """Pictures of the cameras that see most of a hull, as HTML."""
    height, width = images.shape[1:3]
    drawn = []
    for i, image in enumerate(images):
        picture, inside = image.copy(), 0
        for body in bodies:
            pixels = cameras.subset([i]).project(body.points)[0]
            seen = (
                np.isfinite(pixels).all(axis=1)
                & (pixels >= 0).all(axis=1)
                & (pixels < (width, height)).all(axis=1)
            )
            if not seen.any():
                continue
            inside += int(seen.sum())
            low, high = (
                np.rint(pixels[seen].min(axis=0)).astype(int),
                np.rint(pixels[seen].max(axis=0)).astype(int),
            )
            for u, v in np.rint(pixels[seen]).astype(int):
                cv2.circle(picture, (int(u), int(v)), 1, _HULL, -1)
            cv2.rectangle(picture, (int(low[0]), int(low[1])), (int(high[0]), int(high[1])), _BOX, 2)
        for box in boxes[i] if boxes else ():
            left, upper, right, lower = np.rint(box).astype(int).tolist()
            cv2.rectangle(picture, (left, upper), (right, lower), _NETWORK, 2)
        drawn.append((inside, picture))
    drawn.sort(key=lambda each: -each[0])
    found = []
    for _, picture in drawn[:shown]:
        code = b64encode(cv2.imencode(".jpg", picture)[1].tobytes()).decode()
        found.append(f'<img src="data:image/jpeg;base64,{code}" style="width:48%;margin:0.5%" alt="camera">')
    return "".join(found)
