"""truetip identify: springs of a robot that moved are found, wrong input is one line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import Result

from experiments.identify.recording_file import read_recording, write_recording
from experiments.identify.recording_map import Recording
from experiments.identify.slow import identify_slow_recording, slow_json, with_slow_motion
from robots.description.model import load_robot
from robots.identification.identified_robot import STIFFNESS_KNOWN
from robots.identification.motion import SensorPlace
from robots.identification.recording import RecordedCase, RecordingError
from robots.threads import allowed
from tests.experiments.browser import open_page
from tests.experiments.commands import files, refusal, truetip
from tests.robots.identification.test_slow_motion import (
    BELIEVED_LOAD,
    PRELOAD,
    TRUE_LOAD,
    slow_motion,
)

GYRO = SensorPlace("hand", "gyro", "link_5", np.array([0.1, 0.0, 0.0]), np.eye(3), 200.0, 2e-3)
ROWS = 80

CASES = """\
angles_deg: [6]
ringing: 0.4
positions_deg:
- [0, -90, 90, 0, 0, 0]
- [0, -30, 30, 0, 60, 0]
- [0, -60, 0, 45, -60, 0]
- [0, -110, 40, 0, 90, 90]
"""


def run(folder: Path, *arguments: str) -> Result:
    return truetip("identify", f"--report={folder / 'identify.html'}", *arguments)


def resting(folder: Path) -> Path:
    """A recording of a robot that stands still."""
    time = 1e-3 * np.arange(ROWS)
    theta = np.tile(np.deg2rad([0.0, -60.0, 40.0, 0.0, 30.0, 0.0]), (ROWS, 1))
    shown = GYRO.sigma * np.random.default_rng(2).normal(size=(ROWS, 1, 3))
    told = np.stack([theta, 0.0 * theta, 0.0 * theta], axis=1)
    case = RecordedCase("rest", time, theta, 0.0 * theta, 0.0 * theta, time, shown, told)
    path = folder / "rest.csv"
    write_recording(path, Recording(100.0, [case], [GYRO]))
    return path


@pytest.mark.parametrize("suffix", [".csv", ".mcap"])
def test_motions_keep_payloads_of_their_own(tmp_path: Path, suffix: str):
    recording = read_recording(resting(tmp_path))
    heavy, light = (replace(recording.cases[0], name=name) for name in ("7", "8"))
    path = tmp_path / f"again{suffix}"
    write_recording(path, replace(recording, cases=[heavy, replace(light, payload=30.0)]))
    assert [case.payload for case in read_recording(path).cases] == [None, 30.0]


def test_payloads_of_motions_that_are_not_there_or_below_zero_are_refused(tmp_path: Path):
    path = resting(tmp_path)
    with path.with_suffix(".yaml").open("a") as file:
        file.write("payloads: {west: 20}\n")
    changed(path.with_suffix(".yaml"), "payloads: {}\n", "")
    assert "payloads: no case 'west', there are rest" in refusal(run(tmp_path, f"--recording={path}"))
    changed(path.with_suffix(".yaml"), "{west: 20}", "{rest: -20}")
    message = refusal(run(tmp_path, f"--recording={path}"))
    assert "payloads.rest must not be negative, got -20 kg" in message


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mcap"])
def test_a_recording_is_read_as_it_was_written(tmp_path: Path, suffix: str):
    path = tmp_path / f"again{suffix}"
    write_recording(path, read_recording(resting(tmp_path)))
    found = read_recording(path)
    assert (found.payload, [case.name for case in found.cases]) == (100.0, ["rest"])
    assert found.cases[0].readings.shape == (ROWS, 1, 3)
    commands = found.cases[0].commands
    assert commands is not None
    np.testing.assert_allclose(commands[:, 0], found.cases[0].theta, atol=1e-9)
    assert commands.shape == (ROWS, 3, 6)
    assert found.cases[0].period == pytest.approx(1e-3)
    np.testing.assert_allclose(found.sensors[0].position, GYRO.position)
    assert (found.sensors[0].kind, found.sensors[0].sigma) == ("gyro", 2e-3)


@pytest.mark.parametrize("jobs", [1, 3])
def test_the_identification_takes_as_many_threads_as_jobs_are_allowed(tmp_path: Path, monkeypatch, jobs: int):
    def tell(*_: object) -> None:
        raise ValueError(f"{allowed()} threads")

    monkeypatch.setattr("experiments.identify.command.study_recording", tell)
    message = refusal(run(tmp_path, f"--recording={resting(tmp_path)}", f"--jobs={jobs}"))
    assert f"{jobs} threads" in message


def test_drives_without_commands_are_refused_before_anything_is_identified(tmp_path: Path):
    recording = read_recording(resting(tmp_path))
    silent = [replace(case, commands=None) for case in recording.cases]
    write_recording(tmp_path / "silent.csv", replace(recording, cases=silent))
    message = refusal(run(tmp_path, f"--recording={tmp_path / 'silent.csv'}", "--drives"))
    assert "case rest has no commands" in message


def test_a_recording_without_motion_says_what_it_cannot_show(tmp_path: Path):
    result = run(tmp_path, f"--recording={resting(tmp_path)}")
    assert "no excitation" in refusal(result)
    assert "gears, bearings and beams cannot be seen" in refusal(result)
    assert files(tmp_path) == {"rest.csv", "rest.yaml"}


def changed(path: Path, old: str, new: str) -> Path:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


def test_wrong_tables_are_refused_with_file_and_line(tmp_path: Path):
    path = resting(tmp_path)
    lines = path.read_text().splitlines()
    fields = lines[7].split(",")
    fields[3] = "nan"
    path.write_text("\n".join([*lines[:7], ",".join(fields), *lines[8:]]))
    message = refusal(run(tmp_path, f"--recording={path}"))
    assert f"{path}, line 8: 'nan' in column 'position_1' is no number" in message
    path.write_text("\n".join([*lines[:7], *lines[8:]]))
    assert "line 8: samples of the robot must be evenly spaced" in refusal(
        run(tmp_path, f"--recording={path}")
    )


def test_wrong_column_maps_are_refused(tmp_path: Path):
    path = resting(tmp_path)
    changed(path.with_suffix(".yaml"), "hand_x", "hand_u")
    assert "no column 'hand_u', there are case, time" in refusal(run(tmp_path, f"--recording={path}"))
    changed(path.with_suffix(".yaml"), "link_5", "link_9")
    changed(path.with_suffix(".yaml"), "hand_u", "hand_x")
    assert "has no body 'link_9'" in refusal(run(tmp_path, f"--recording={path}"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("factor: 1.0\nposition", "factor: 0\nposition", "line 6: angle_factor must not be 0"),
        ("  factor: 1.0", "  factor: 0", "sensor 'hand': factor must not be 0"),
        ("hand_y", "hand_x", "sensor 'hand': column 'hand_x' is that of sensor 'hand' already"),
        ("hand_y", "speed_2", "sensor 'hand': column 'speed_2' is that of speed already"),
        ("[position_1, position_2", "[position_1, position_1", "position: column 'position_1' is that of"),
        ("position: [0.1,", "position: [100,", "position[0] must be between -10 and 10 m, got 100"),
    ],
)
def test_maps_that_make_nothing_of_a_column_or_two_things_are_refused(
    tmp_path: Path, old: str, new: str, said: str
):
    path = resting(tmp_path)
    changed(path.with_suffix(".yaml"), old, new)
    assert said in refusal(run(tmp_path, f"--recording={path}"))


def test_times_in_milliseconds_are_refused(tmp_path: Path):
    path = resting(tmp_path)
    head, *rows = [line.split(",") for line in path.read_text().splitlines()]
    late = [",".join([case, f"{1e3 * float(time):g}", *more]) for case, time, *more in rows]
    path.write_text("\n".join([",".join(head), *late]))
    assert "line 3: samples of the robot are 1 s apart; the time must be in s" in refusal(
        run(tmp_path, f"--recording={path}")
    )


@pytest.mark.parametrize(
    ("motions", "said"),
    [
        ("angles_deg: []", "line 1: there is no motion: angles_deg, or further, must have one"),
        ("angles_deg: [5, 0]", "line 1: cases: an angle of 0 degrees is no motion"),
        ("further: [{angle_deg: 0}]", "line 1: further[0]: an angle of 0 degrees is no motion"),
        ("positions_deg: [[0, -90]]", "line 1: cases: a position needs 6 angles, got [0.0, -90.0]"),
    ],
)
def test_files_of_motions_without_any_are_refused(tmp_path: Path, motions: str, said: str):
    path = tmp_path / "motions.yaml"
    path.write_text(motions)
    assert f"--motions {path}, {said}" in refusal(run(tmp_path, f"--motions={path}"))


@pytest.mark.slow
def test_slow_motions_of_a_recording_give_load_spring_and_friction(tmp_path: Path):
    robot = load_robot("kr210")
    motion = slow_motion(robot)
    time = motion.period * np.arange(len(motion.theta))
    cases = [
        RecordedCase(
            name,
            time[rows],
            motion.theta[rows],
            motion.rate[rows],
            motion.torque[rows],
            time[rows],
            np.zeros((len(time[rows]), 0, 3)),
        )
        for name, rows in (("before the rest", slice(0, 700)), ("behind it", slice(760, None)))
    ]
    path = tmp_path / "slow.csv"
    write_recording(path, Recording(BELIEVED_LOAD, cases, []))
    found = identify_slow_recording(path, robot)
    assert found.payload == pytest.approx(TRUE_LOAD, rel=0.01)
    better = with_slow_motion(robot, found)
    assert better.counterbalance is not None
    assert better.counterbalance.preload == pytest.approx(PRELOAD, rel=0.02)
    assert better.joints[0].drive_train.friction is not None
    assert slow_json(found)["friction"][0][0]["kind"] == "Stribeck"


@pytest.mark.parametrize(
    ("of_recording", "of_slow", "of_case", "message"),
    [
        (30.0, 100.0, None, "slow motions have 100 kg at the flange and the others 30 kg"),
        (None, 100.0, 50.0, "slow motions must have one payload, got 50 kg in b"),
    ],
)
def test_slow_motions_with_several_payloads_are_refused(
    tmp_path: Path, of_recording: float | None, of_slow: float, of_case: float | None, message: str
):
    time = 0.01 * np.arange(60)
    still, path = np.zeros((60, 6)), tmp_path / "slow.csv"
    cases = [
        RecordedCase(name, time, still, still, still, time, np.zeros((60, 0, 3)), payload=load)
        for name, load in (("a", None), ("b", of_case))
    ]
    write_recording(path, Recording(of_slow, cases, []))
    with pytest.raises(RecordingError, match=message):
        identify_slow_recording(path, load_robot("kr210"), of_recording)


def test_slow_motions_without_torques_are_refused(tmp_path: Path):
    path = resting(tmp_path)
    text = path.with_suffix(".yaml").read_text().splitlines()
    kept = [line for line in text if not line.startswith("torque")]
    path.with_suffix(".yaml").write_text("\n".join(kept))
    result = run(tmp_path, f"--recording={path}", f"--slow={path}")
    assert "slow motions need the torques of the motors" in refusal(result)


@pytest.mark.slow
def test_a_slow_motion_is_designed_and_nothing_else(tmp_path: Path):
    path = tmp_path / "slow.csv"
    result = run(tmp_path, f"--excite={path}", "--robot=irb1200", "--json=-")
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    assert numbers["condition"] < numbers["drawn_condition"]
    assert files(tmp_path) == {"slow.csv"}
    table = np.genfromtxt(path, delimiter=",", names=True)
    q, v = table["position_2"], table["speed_2"]
    np.testing.assert_allclose(np.gradient(q, table["time"])[2:-2], v[2:-2], atol=2e-3)
    assert v[0] == v[-1] == 0.0


REFUSED = {
    "excite": (["--excite=slow.csv", "--write=robot.yaml"], "--excite only designs a motion"),
    "judge": (["--excite=slow.csv", "--judge"], "there is nothing to --judge or to --advise"),
    "advise": (["--excite=slow.csv", "--advise"], "there is nothing to --judge or to --advise"),
    "drives": (["--excite=slow.csv", "--drives"], "--drives has no effect with --excite"),
    "alone": (["--search-evaluations=100"], "--search-evaluations has no effect without --search"),
    "untuned": (["--tuning-share=0.5"], "--tuning-share has no effect without --fine-tune"),
    "robot": (["--robot=kr211"], "robot 'kr211': no file"),
    "plant": (["--robot=irb140"], "has no variant named irb140-realistic: say what moves by --plant"),
    "recording": (["--recording=none.csv"], "--recording none.csv: no such file"),
    "both": (["--recording=none.csv", "--motions=mine.yaml"], "no --motions"),
    "columns": (["--columns=mine.yaml"], "--columns says what a --recording has"),
    "slow": (["--slow=slow.csv"], "--slow adds slow motions to those of a --recording, and there is none"),
    "cases": (["--motions=mine.yaml"], "--motions mine.yaml"),
    "report": (["--report=identify.txt"], "its name must end in .html"),
    "search": (["--search=0"], "--search must be at least 1, got 0"),
    "evaluations": (["--search=1", "--search-evaluations=9"], "--search-evaluations must be at least 60"),
    "share": (["--fine-tune", "--tuning-share=1.2"], "--tuning-share must be between 0 and 1, got 1.2"),
    "no robot": (["--recording=none.csv", "--fine-tune"], "--fine-tune needs a robot to drive"),
    "scheduler": (["--scheduler=tcp://127.0.0.1:1"], "no Dask scheduler at tcp://127.0.0.1:1"),
    "jobs": (["--jobs=0"], "--jobs must be at least 1, got 0"),
}  # fmt: skip


@pytest.mark.parametrize(("options", "message"), REFUSED.values(), ids=REFUSED)
def test_wrong_input_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path, options, message: str):
    assert message in refusal(run(tmp_path, *options))
    assert files(tmp_path) == set()


def test_a_realistic_variant_that_is_no_robot_is_named(tmp_path: Path):
    (tmp_path / "mine.yaml").write_text("extends: kr210\n")
    (tmp_path / "mine-realistic.yaml").write_text("extends: kr210\njoint: []\n")
    result = run(tmp_path, f"--robot={tmp_path / 'mine.yaml'}")
    assert "mine-realistic.yaml, line 2: unknown key 'joint'" in result.stderr


@pytest.mark.slow
def test_springs_that_are_a_fifth_softer_than_believed_are_found(tmp_path: Path):
    """Four motions of the nonlinear plant with linear gears: the main gears and the beam within 3 %."""
    (tmp_path / "cases.yaml").write_text(CASES)
    softer = tmp_path / "softer.yaml"
    base = load_robot("kr210")
    softer.write_text(
        "extends: kr210\njoints:\n"
        + "".join(
            f"- {{drive_train: {{stiffness: {0.8 * joint.drive_train.stiffness}, source: assumed}}}}\n"
            for joint in base.joints
        )
    )
    robot = tmp_path / "identified.yaml"
    result = run(
        tmp_path,
        f"--plant={softer}",
        f"--motions={tmp_path / 'cases.yaml'}",
        "--no-gear-parts",
        "--no-rectangle",
        "--jobs=2",
        "--judge",
        "--advise",
        "--search=1",
        "--search-evaluations=60",
        f"--write={robot}",
        "--json=-",
    )
    assert result.exit_code == 0, result.output
    numbers = json.loads(result.stdout)
    for name in ("stiffness_gear_1", "stiffness_gear_2", "stiffness_gear_3", "stiffness_beam_2_y"):
        found = numbers["parameters"][name]
        assert abs(found["value"] / found["true"] - 1.0) < 0.03, name
    # Three standard deviations of what is called known.
    assert numbers["worst_stiffness_error"] < 3.0 * STIFFNESS_KNOWN
    assert load_robot(str(robot)).joints[1].drive_train.stiffness == pytest.approx(
        0.8 * base.joints[1].drive_train.stiffness, rel=0.03
    )
    # What the full simulation says of it: gyros are off by noise and little else, and the former beliefs by
    # ten times as much.
    left = numbers["judge"]["left"]["gyro"]
    assert left["full"]["found"] < 0.1 * left["full"]["before"]
    assert left["full"]["found"] < 1.5 * left["linear"]["found"]
    assert set(numbers["advice"]["parameters"]) == set(numbers["weak"])
    # So few evaluations bring a search without a gradient nowhere near.
    runs = {each["method"]: each for each in numbers["searches"]["runs"]}
    assert set(runs) == {"gradient", "CMA-ES", "genetic, then pattern"}
    assert not runs["gradient"]["failed"]
    assert runs["gradient"]["cost"] == min(each["cost"] for each in runs.values())
    opened = open_page(tmp_path / "identify.html")
    assert "starts that fail" in opened.dom
    assert "Full simulation as the judge" in opened.dom
    assert "Further motions and sensors" in opened.dom
    assert not [line for line in opened.console if "rror" in line]
