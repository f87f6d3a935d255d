"""The report, the replay and the table of a comparison, as a reader meets them."""

import base64
import dataclasses
import re
from io import StringIO
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation

from experiments.cli.tables import print_summary
from experiments.metrics.run_metrics import summary, timing
from experiments.replay.replay import write_replay
from experiments.report.data import plot_data
from experiments.report.report import verdict, write_report
from experiments.report.style import law_colors, law_title
from robots.description.model import load_robot
from systems.servo import LAWS
from tests.experiments.browser import open_page, screenshot
from tests.experiments.synthetic import comparison, displaced, make_log, rectangle

HOSTILE = "name: misaligned\nnote: '</script><script>document.title = \"broken\"</script> & <b>'\n"
PLOTS = ("path", "distance", "position", "orientation", "bars-mm", "bars-deg", "events")
# Those of commands and torques are not there: the runs have none. Nobody has measured their ticks.
FOLDED = {
    "worst", "contour-and-lag", "over-length", "histogram", "spectrum", "measured-against-true",
    "gear-deflection",
}  # fmt: skip
SERIOUS = re.compile("Uncaught|Error|Failed|Refused|not allowed|Not allowed")


@pytest.fixture(scope="module")
def logs():
    return comparison(cycles=2, with_joints=True)


@pytest.fixture(scope="module")
def report(logs, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    robot = load_robot("irb1200")
    write_report(path, HOSTILE, summary("misaligned", logs), timing(logs), logs, robot)
    return path


@pytest.fixture(scope="module")
def opened(report):
    """The report in a browser, until its pictures for printing are drawn too."""
    return open_page(report, milliseconds=20000)


@pytest.fixture(scope="module")
def replay(logs, tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    write_replay(path, load_robot("irb1200"), {law: cycles[0] for law, cycles in logs.items()})
    return path


@pytest.mark.slow  # drawing all figures twice, for screen and paper
def test_the_report_draws_every_plot_without_an_error(opened, logs):
    assert not [line for line in opened.console if SERIOUS.search(line)]
    for plot in PLOTS:
        # plotly gives an element this class once it has drawn into it.
        assert re.search(
            rf'class="[^"]*js-plotly-plot[^"]*"[^>]*id="{plot}"|id="{plot}"[^>]*js-plotly-plot', opened.dom
        )
    assert 'data-drawn="yes"' in opened.dom
    for title in map(law_title, logs):
        assert title in opened.dom
    assert (
        "<title>misaligned: visual servoing compared</title>" in opened.dom
    )  # the scenario's script did not run


def test_a_page_is_small_enough_to_be_mailed(report):
    """With the library and the numbers of all plots, which weigh 1.5 MB and 0.3 MB compressed."""
    assert report.stat().st_size < 2.5e6


@pytest.mark.slow
def test_no_figure_can_be_uploaded(opened):
    """The library's own button would send what the robot did to its maker."""
    assert 'data-title="Download plot' in opened.dom  # there are buttons
    assert 'data-title="Share' not in opened.dom


@pytest.mark.slow
def test_every_plot_has_a_picture_for_printing_with_its_whole_width_and_a_legend(opened, logs):
    """A browser prints neither what WebGL has drawn nor a plot that is wider than the paper."""
    found = re.findall(r'<img class="paper-only" id="([\w-]+)-on-paper"[^>]* src="([^"]*)"', opened.dom)
    pictures = dict(found)
    assert set(pictures) == {*PLOTS, *FOLDED}
    for name in ("distance", "position", "orientation"):
        svg = unquote(pictures[name])
        assert 'width="760"' in svg
        assert "path starts" in svg
        assert "dwell" in svg
        assert all(law_title(law) in svg for law in logs)
    encoded = np.frombuffer(base64.b64decode(pictures["path"].partition(",")[2]), dtype=np.uint8)
    image = cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert len(np.unique(image.reshape(-1, image.shape[-1]), axis=0)) > 100  # lines of many shades, not blank


def test_the_report_is_small_and_asks_the_network_for_nothing(report):
    html = report.read_text()
    assert len(html) < 10e6
    assert not re.search(r'<(script|img|iframe)[^>]* src=|<link[^>]* href="http', html)
    assert "</script><script>document.title" not in html


NUMBERS = {
    "max_norm_mm": 2.0,
    "rms_norm_mm": 1.0,
    "max_angle_deg": 0.5,
    "settling_s": None,
    "static_mm": [0.003, 0.004, 0.0],
    "static_deg": [0.0, 0.0, 0.03],
}


def test_the_verdict_names_the_best_law_and_the_baseline():
    worse = dict(NUMBERS, max_norm_mm=25.0, static_mm=[0.0, 3.0, 4.0])
    text = verdict(
        {"runs": {"open_loop": {"true": worse}, "pbvs": {"true": NUMBERS}, "numerical_ik": {"true": worse}}}
    )
    assert text.startswith("PBVS keeps the true tip within 2.00 mm and 0.50° of the wanted path")
    assert "comes to rest 0.005 mm and 0.03° from it" in text
    assert "off by up to 25.00 mm and 0.50°, and by 5.00 mm at rest" in text


def test_the_verdict_says_what_was_not_seen():
    """A run on a station that ended early, and one without a camera, had dashes in place of numbers."""
    unseen = dict.fromkeys(NUMBERS) | {"static_mm": [None] * 3, "static_deg": [None] * 3}
    early = NUMBERS | {"max_norm_mm": 0.1, "static_mm": [None] * 3, "static_deg": [None] * 3}

    def said(**measured: dict) -> str:
        return verdict({"runs": {law: {"true": unseen, "measured": run} for law, run in measured.items()}})

    assert said(open_loop=unseen) == (
        "Open loop: no pose of the tip was seen on the path, so its error is not known."
    )
    assert said(pbvs=early) == (
        "PBVS keeps the tip, as the camera sees it, within 0.10 mm and 0.50° of the wanted path and was not "
        "seen at rest."
    )
    # Who has not run its path to the end has not kept nearest to it.
    text = said(open_loop=unseen, pbvs=early, numerical_ik=NUMBERS)
    assert text.startswith("Numerical IK keeps the tip, as the camera sees it, within 2.00 mm")
    assert "–" not in text


def test_the_verdict_begins_with_the_laws_that_did_not_come_to_their_end():
    """One that commanded degrees was said to keep the tip within 733 mm."""
    stopped = {"true": NUMBERS | {"max_norm_mm": 0.1}, "unfinished": "the guard stopped it: in rad?"}
    text = verdict({"runs": {"pbvs": stopped, "numerical_ik": {"true": NUMBERS}}})
    assert text.startswith(
        "PBVS did not come to the end of its path: the guard stopped it: in rad? Numerical IK keeps the true "
        "tip within 2.00 mm"
    )
    assert verdict({"runs": {"pbvs": stopped}}).endswith(
        "in rad? PBVS let the true tip be up to 0.10 mm and 0.50° from the wanted path."
    )
    assert "Without the camera" not in verdict({"runs": {"open_loop": stopped, "pbvs": {"true": NUMBERS}}})
    # Of a law that was stopped and an open loop only one has run the path.
    text = verdict({"runs": {"open_loop": {"true": NUMBERS}, "pbvs": stopped}})
    assert "in rad? Open loop keeps the true tip within 2.00 mm" in text


def test_from_the_same_initial_error_the_law_that_settles_well_wins():
    start = {
        "max_norm_mm": 17.3,
        "max_angle_deg": 0.1,
        "static_mm": [0.003, 0.004, 0.0],
        "static_deg": [0.0] * 3,
    }
    slow, fast = (
        start | {"rms_norm_mm": 2.1, "settling_s": 1.3},
        start | {"rms_norm_mm": 0.9, "settling_s": 0.14},
    )
    text = verdict({"runs": {"numerical_ik": {"true": slow}, "pbvs": {"true": fast}}})
    # The largest distance may come later than the start.
    assert text.startswith(
        "PBVS keeps the true tip within 17.30 mm of the wanted path, within 5 % of the distance at the start "
        "after 0.14 s, and comes to rest"
    )


def test_one_law_alone_makes_a_report(logs, tmp_path):
    alone = {"my_law": [dataclasses.replace(logs["pbvs"][0], law="my_law", guard_events=[], guard_counts={})]}
    write_report(tmp_path / "report.html", "", summary("s", alone), timing(alone), alone)
    html = (tmp_path / "report.html").read_text()
    assert "my law keeps the true tip" in html
    assert "No intervention" in html


@pytest.mark.slow
def test_an_error_that_stays_within_a_decade_has_numbers_at_its_axis(logs, tmp_path):
    """From 5 to 8 degrees, where no power of ten lies between."""
    log = logs["pbvs"][0]
    angle = np.deg2rad(6.5 + 1.5 * np.sin(log.time))
    X_WE = log.X_WE_desired.copy()
    turned = Rotation.from_rotvec(angle[:, None] * np.array([0.0, 0.0, 1.0])).as_matrix()
    X_WE[:, :3, :3] = turned @ X_WE[:, :3, :3]
    alone = {"pbvs": [dataclasses.replace(log, X_WE_true=X_WE)]}
    write_report(tmp_path / "report.html", "", summary("s", alone), timing(alone), alone)
    dom = open_page(tmp_path / "report.html").dom
    labels = re.findall(r'class="y2tick"><text[^>]*>(?:<[^>]*>)*([^<]*)<', dom)
    assert {"6", "7"} <= set(labels), labels


@pytest.mark.slow
def test_a_path_of_one_point_shows_the_point_and_where_the_tip_rests(logs, tmp_path):
    """A line that stays on the spot has no pixel."""
    log = logs["open_loop"][0]
    X_WD = np.tile(log.X_WE_desired[0], (len(log.time), 1, 1))
    off = displaced(X_WD, np.array([0.0, 0.0, 0.0, 0.02, 0.0, 0.0]))
    swinging = displaced(X_WD, np.outer(np.sin(log.time), [0.0, 0.0, 0.0, 0.01, 0.0, 0.0]))
    runs = {
        law: [dataclasses.replace(log, law=law, X_WE_desired=X_WD, X_WE_true=X_WE)]
        for law, X_WE in (("open_loop", off), ("pbvs", swinging))
    }
    page = tmp_path / "report.html"
    write_report(page, "", summary("s", runs), timing(runs), runs)
    spans = "Math.max(...trace.x.map(Number)) - Math.min(...trace.x.filter(Number))"
    drawn = f"document.title = document.getElementById('path').data.map(trace => ({spans}).toFixed(1))"
    page.write_text(page.read_text() + f"<script>setTimeout(() => {drawn}, 2000)</script>")
    assert "<title>2.4,1.2,20.0</title>" in open_page(page).dom


def test_a_report_that_cannot_be_written_leaves_nothing(logs, tmp_path):
    with pytest.raises(FileNotFoundError):
        write_report(tmp_path / "missing" / "report.html", "", summary("s", logs), timing(logs), logs)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_replay_opens_in_a_browser_and_names_the_laws(replay, logs):
    opened = open_page(replay)
    assert not [line for line in opened.console if SERIOUS.search(line)]
    assert "<canvas" in opened.dom
    for title in map(law_title, logs):
        assert title in opened.dom
    assert replay.stat().st_size < 5e6


@pytest.mark.slow
def test_the_replay_moves_by_itself(replay, tmp_path):
    for seconds in (2, 9):
        screenshot(replay, tmp_path / f"{seconds}.png", 320, 240, milliseconds=1000 * seconds)
    assert (tmp_path / "2.png").read_bytes() != (tmp_path / "9.png").read_bytes()


def test_an_initial_error_that_settles_has_a_section(tmp_path):
    time = np.arange(0.0, 6.0, 0.01)
    X = rectangle(time)
    e = np.exp(-10.0 * time)[:, None] * np.array([0.0, 0.0, 0.0, 0.01, 0.01, 0.01])
    logs = {"pbvs": [make_log(time, X, displaced(X, e))]}
    write_report(tmp_path / "report.html", "", summary("nominal", logs), timing(logs), logs)
    html = (tmp_path / "report.html").read_text()
    # log(20) / 10 = 0.2996 s, found at the next sample of 10 ms.
    assert re.search(r"Initial error.*?PBVS</td><td>0\.300</td><td>0\.000</td>", html, re.DOTALL)


def test_where_nobody_knows_the_truth_the_lines_are_what_the_camera_says(logs):
    seen = {
        law: [
            dataclasses.replace(
                cycle, X_WE_true=np.full_like(cycle.X_WE_true, np.nan), X_WE_measured=cycle.X_WE_true
            )
            for cycle in cycles
        ]
        for law, cycles in logs.items()
    }
    known, unknown = (plot_data(summary("misaligned", each), each) for each in (logs, seen))
    assert unknown["axis_range"] == known["axis_range"]
    for law, other in zip(unknown["laws"], known["laws"], strict=True):
        assert len(law["line"]["t"]["d"]) > 100
        assert law["line"] == other["line"]


def test_a_replay_of_a_law_that_did_not_run_is_refused(logs, tmp_path):
    with pytest.raises(ValueError, match="no log of law 'mpc', there are pbvs"):
        write_replay(tmp_path / "r.html", load_robot("irb1200"), {"pbvs": logs["pbvs"][0]}, shown_law="mpc")


def test_the_table_fits_a_terminal_of_100_columns(logs):
    console = Console(width=100, record=True, file=StringIO())
    print_summary(console, summary("misaligned", logs))
    lines = console.export_text().splitlines()
    assert max(map(len, lines)) <= 100
    assert not any("…" in line for line in lines)
    # Twice largest and static errors of each law, and a row of guard counts.
    for title in map(law_title, logs):
        assert sum(title in line for line in lines) == 5


def test_every_law_has_its_own_colour():
    colors = law_colors([*LAWS, "mine", "yours"])
    assert len(set(colors.values())) == len(LAWS) + 2
