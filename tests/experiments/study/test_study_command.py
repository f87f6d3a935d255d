"""``truetip study``: a row of each law at each point, resumed, refused, and the same on a cluster."""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from diagrams.record.log import GuardEvent
from experiments.cli.cluster import DaskCluster, executor
from experiments.cli.console import fail
from experiments.cli.workers import in_order
from experiments.study import command as study_command
from experiments.study import rows
from experiments.study.command import study_verdict
from experiments.study.rows import StudyRow, first_run, prepared_of, run_row, study_rows
from experiments.study.store import TABLE, StudyStore, alone_in
from experiments.study.study_file import Factor, Levels, Names, Study, load_study
from robots.description.model import load_robot
from tests.experiments.commands import refusal, truetip
from tests.experiments.synthetic import comparison

pytestmark = pytest.mark.real_time

# 1.8 s of a rigid robot; the second payload is more than the scenario allows.
STUDY = """
laws: [open_loop]
settings: [reference.path=circle, reference.acceleration=8, reference.settle=0, reference.dwell=0.6,
           station.elasticity=rigid]
factors:
  station.payload: {values: [0, 2000]}
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> tuple[Path, Path]:
    """A study of two runs, one of which is refused: its file and its folder."""
    file = tmp_path_factory.mktemp("study") / "payload.yaml"
    file.write_text(STUDY)
    out = file.parent / "out"
    result = truetip("study", file, "--out", out, "--jobs", 1, "--json", file.parent / "numbers.json")
    assert result.exit_code == 0, result.output
    return file, out


def test_every_point_has_its_row_and_a_failure_its_reason(study):
    _, out = study
    rows = pq.read_table(out / TABLE).to_pylist()
    assert [row["station.payload"] for row in rows] == [0.0, 2000.0]
    assert rows[0]["max_norm_mm"] > 1.0
    assert "station.payload must be between 0 and 1000 kg" in rows[1]["failure"]


@pytest.mark.slow
def test_the_robots_of_a_study_are_known_before_it_runs_each_once():
    levels: dict[str, Factor] = {
        "robot": Names(["kr16", "crx10ial"]),
        "station.payload": Levels([0, 1]),
    }
    found = prepared_of(study_rows(Study(laws=["open_loop", "pbvs"], factors=levels)))
    names = [load_robot(name).name for name in ("kr16", "crx10ial")]
    assert [each.robot.name for each in found] == names
    for each, name in zip(found, names, strict=True):
        assert f"carried over from ABB IRB 1200-7/0.7 to {name}: " in each.note


def test_a_study_says_what_is_carried_over_to_another_robot(tmp_path, monkeypatch):
    """As run and compare do: a payload of 16 kg in place of 7 is no small matter."""
    monkeypatch.setattr(study_command, "_run", lambda *_: fail("ended here", 3))
    file = tmp_path / "study.yaml"
    file.write_text("laws: [open_loop]\nfactors:\n  robot: !Names {values: [irb1200, kr16]}\n")
    result = truetip("study", file, "--out", tmp_path / "out")
    assert result.exit_code == 3
    said = " ".join(result.stdout.split())
    assert said.startswith("Note: carried over from ABB IRB 1200-7/0.7 to KUKA KR 16-2: payload 16 kg")


@pytest.mark.slow
def test_the_command_of_a_row_repeats_it(study):
    _, out = study
    rows = pq.read_table(out / TABLE).to_pylist()
    command = rows[0]["command"].split()
    assert command[:2] == ["truetip", "compare"]
    repeated = truetip(*command[1:], "--out", out / "again", "--json", out / "again.json")
    assert repeated.exit_code == 0
    error = json.loads((out / "again.json").read_text())["runs"]["open_loop"]["true"]
    assert error["max_norm_mm"] == pytest.approx(rows[0]["max_norm_mm"], rel=1e-8)  # nine digits in JSON


def test_started_again_it_runs_nothing_and_leaves_the_table_as_it_is(study):
    file, out = study
    before = (out / TABLE).read_bytes()
    result = truetip("study", file, "--out", out)
    assert result.exit_code == 0
    assert "run 1, Open loop: --set station.payload=2000.0" in " ".join(result.stdout.split())
    assert (out / TABLE).read_bytes() == before


def test_the_numbers_name_the_worst_row_of_each_law(study):
    file, _ = study
    found = json.loads((file.parent / "numbers.json").read_text())
    assert (found["rows"], found["failures"]) == (2, 1)
    assert found["laws"]["open_loop"]["max_norm_mm"]["worst_row"] == 0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("factors: {station.payload: {values: []}}", "values: at least one is needed"),
        ("factors: {law: !Names {values: [pbvs]}}", "factors.law: it would not change what runs"),
        ("factors: {station.payload: !Distribution {name: norm}}", "needs a design that samples"),
        (
            "{factors: {seed: !Distribution {name: normal}}, design: !Sobol {}}",
            "scipy.stats has no distribution 'normal'",
        ),
        (
            "{factors: {seed: !Distribution {name: norm, parameters: {sigma: 1}}}, design: !Sobol {}}",
            "takes loc, scale; got sigma",
        ),
        ("{factors: {seed: {values: [1]}}, metrics: [speed]}", "metrics: must be of max_norm_mm"),
        ("{factors: {seed: {values: [1]}}, laws: [magic]}", "magic"),
        ("{factors: {station.paylaod: {values: [1]}}}", "the first run of the study is refused: .*paylaod"),
        (
            "{factors: {seed: {values: [1]}}, repetitions: 2}",
            "line 1: factors.seed: repetitions would all have",
        ),
        (
            "{factors: {station.payload: {values: [1]}}, settings: [station.payload=3]}",
            "line 1: factors.station.payload: settings say it, too",
        ),
        ("laws: [open_loop]", "at least one key of a scenario that is varied"),
    ],
)
def test_a_wrong_study_is_refused_in_one_line(tmp_path, text, reason):
    file = tmp_path / "wrong.yaml"
    file.write_text(text)
    assert re.search(reason, refusal(truetip("study", file, "--out", tmp_path / "out")))


def test_a_scheduler_that_is_not_there_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.cli.cluster._PATIENCE", 0.5)
    file = tmp_path / "study.yaml"
    file.write_text(STUDY)
    result = truetip("study", file, "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9")
    assert "no Dask scheduler at tcp://127.0.0.1:9" in refusal(result)


@pytest.mark.parametrize(
    ("address", "reason"), [("nonsense", "missing port number"), ("http://127.0.0.1:8787", "unknown address")]
)
def test_an_address_that_no_scheduler_has_is_refused_before_a_client_is_made(monkeypatch, address, reason):
    """A client of it would wait twenty seconds for its own end, and show a traceback."""
    monkeypatch.setattr("distributed.Client", None)
    with pytest.raises(ValueError, match=f"no Dask scheduler at {address}: {reason}"):
        executor(address)


@contextlib.contextmanager
def dask_process(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]])
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def wait_until_it_listens(port: int) -> None:
    """A scheduler begins within a second, on a busy machine within twenty."""
    for _ in range(600):
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1.0):
            return
        time.sleep(0.1)
    raise AssertionError(f"no process listens on port {port}")


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing(tmp_path):
    """On a scheduler and two workers in processes of their own the rows are those of this process."""
    settings = ["reference.path=circle", "reference.acceleration=8", "reference.settle=0"]
    study = Study(
        laws=["open_loop"],
        settings=[*settings, "station.elasticity=rigid"],
        factors={"station.payload": Levels([float(mass) for mass in range(4)])},
    )
    rows = study_rows(study)
    address = "tcp://127.0.0.1:18786"
    worker = ("dask_worker", address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path))
    with (
        dask_process("dask_scheduler", "--host", "127.0.0.1", "--port", "18786", "--no-dashboard"),
        dask_process(*worker, "--no-nanny") as first,
        dask_process(*worker, "--no-nanny"),
    ):
        wait_until_it_listens(18786)
        cluster = DaskCluster(address)
        cluster.check()
        killed = []

        def kill_first(share: float) -> None:
            if share > 0.0 and not killed:
                os.kill(first.pid, signal.SIGKILL)
                killed.append(time.monotonic())

        found = in_order(cluster, run_row, rows, kill_first)
    assert killed
    for row, of_cluster in zip(rows, found, strict=True):
        alone = run_row(row, lambda share: None)
        assert alone["failure"] == ""
        # As text: a metric that a run does not have is NaN.
        assert str({**of_cluster, "wall_s": 0.0}) == str({**alone, "wall_s": 0.0})


def test_the_file_that_comes_with_the_documentation_is_a_study():
    assert len(study_rows(load_study("docs/studies/payload_and_dead_time.yaml"))) > 10


@pytest.mark.slow
def test_a_file_that_has_changed_since_makes_another_study(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """The names are the same: rows of two robots would stand in one table."""
    monkeypatch.chdir(tmp_path)
    Path("arm.yaml").write_text("extends: irb1200\n")
    Path("study.yaml").write_text(STUDY.replace("2000]}", "1]}\n  robot: !Names {values: [arm.yaml]}"))
    rows = study_rows(load_study("study.yaml"))
    before = first_run(rows)
    assert list(before["files"]) == ["arm.yaml"]
    assert first_run(rows) == before
    Path("arm.yaml").write_text("extends: irb1200\nname: another\n")
    found = first_run(rows)
    assert {key for key in found if found[key] != before[key]} == {"files"}


def test_a_file_that_is_named_by_a_file_of_a_study_identifies_it_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """An arm extends another one beside it, which has a picture: what is not beside the study counts, too."""
    monkeypatch.chdir(tmp_path)
    Path("arms").mkdir()
    Path("arms/arm.yaml").write_text("extends: base.yaml\n")
    Path("arms/base.yaml").write_text(
        "extends: irb1200\nbase_link: {pictures: [{shape: mesh, file: foot.obj}]}\n"
    )
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    Path("arms/foot.obj").write_text(triangle)
    Path("study.yaml").write_text(STUDY.replace("2000]}", "1]}\n  robot: !Names {values: [arms/arm.yaml]}"))
    rows = study_rows(load_study("study.yaml"))
    before = first_run(rows)["files"]
    assert [Path(file).name for file in before] == ["arm.yaml", "base.yaml", "foot.obj"]
    Path("arms/foot.obj").write_text(triangle.replace("0 0 0", "0 0 1"))
    found = first_run(rows)["files"]
    assert {Path(file).name for file in found if found[file] != before[file]} == {"foot.obj"}


def test_two_processes_do_not_work_on_one_study(study):
    file, out = study
    with alone_in(out):
        assert "another process works on the study in" in refusal(truetip("study", file, "--out", out))


def test_a_law_that_has_failed_is_not_the_best_for_what_it_leaves_out():
    table = {
        "row": np.arange(4),
        "law": np.array(["open_loop", "open_loop", "pbvs", "pbvs"], dtype=object),
        "failure": np.array(["", "", "", "out of reach"], dtype=object),
        "station.payload": np.array([0.0, 1.0, 0.0, 1.0]),
        "max_norm_mm": np.array([3.0, 4.0, 1.0, np.nan]),
    }
    laws = Study(laws=["open_loop", "pbvs"], factors={"station.payload": Levels([0.0, 1.0])})
    assert study_verdict(laws, table).startswith("Over 4 runs Open loop has the best worst run")


@pytest.mark.parametrize(("failing", "says"), [(["pbvs"], " of pbvs"), (["open_loop", "pbvs"], "")])
def test_a_study_of_which_no_run_of_a_law_came_to_its_end_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: list[str], says: str
):
    def run(store: StudyStore, where: object, todo: list[StudyRow], total: int) -> None:
        monkeypatch.setattr(rows, "run", lambda *_, **__: comparison(period=0.1)["pbvs"][0])
        for each in todo:
            line = run_row(each, lambda share: None)
            store.add(line | ({"failure": "ran away"} if each.law in failing else {}))
        store.flush()

    monkeypatch.setattr(study_command, "_run", run)
    file = tmp_path / "study.yaml"
    file.write_text("laws: [open_loop, pbvs]\nfactors: {station.payload: {values: [0, 1]}}\n")
    result = truetip("study", file, "--out", tmp_path / "out")
    assert (result.exit_code, result.stderr) == (1, f"truetip: no run{says} came to its end\n")
    assert (tmp_path / "out" / TABLE).exists()


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (ZeroDivisionError("by zero"), "ZeroDivisionError: by zero"),
        (SystemExit("'AllFinite(q)' failed."), "law open_loop, seed 0: SystemExit: 'AllFinite(q)' failed."),
    ],
)
def test_a_class_of_ones_own_that_raises_fails_its_row_and_no_other(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, reason: str
):
    """Drake's own checks raise SystemExit."""

    def raising(*_, **__):
        raise error

    monkeypatch.setattr(rows, "run", raising)
    study = Study(laws=["open_loop"], factors={"station.payload": Levels([1.0])})
    assert run_row(study_rows(study)[0], lambda share: None)["failure"] == reason


def test_a_run_that_the_guard_stopped_has_failed_and_has_no_figures(monkeypatch: pytest.MonkeyPatch):
    """The error of a robot that stands still may be smaller than that of one that runs its path."""
    (log,) = comparison(period=0.1)["pbvs"]
    stopped = replace(log, guard_events=[GuardEvent(3.0, "stopped", "", lasted=log.time[-1])])
    monkeypatch.setattr(rows, "run", lambda *_, **__: stopped)
    study = Study(laws=["open_loop"], factors={"station.payload": Levels([1.0])})
    line = run_row(study_rows(study)[0], lambda share: None)
    assert line["failure"] == "the guard stopped the robot at 3.0 s and it did not go on"
    assert np.isnan(line["max_norm_mm"])
