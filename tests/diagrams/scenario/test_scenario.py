"""Scenario files: the shipped ones, inheritance, settings, and one line for every mistake."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import ScenarioError, load_scenario, scenario_text, shipped_scenarios
from systems.cell.events.station_events import PayloadChange, ToolShift
from systems.cell.pose_camera import PoseCameraConfig
from systems.link.makers import AbbEgm
from systems.reference.shapes import Circle, FigureEight, Points, Shape


def refusal(name: str, *settings: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(name, list(settings))
    text = str(caught.value)
    assert "\n" not in text
    return text


def written(folder: Path, text: str, name: str = "mine.yaml") -> str:
    (folder / name).write_text(text)
    return str(folder / name)


def test_the_shipped_scenarios_load_by_name_and_say_what_they_are():
    assert shipped_scenarios() == [
        "cell",
        "cell-kuka",
        "cell-kuka-watched",
        "cell-watched",
        "dead-time",
        "everything",
        "everything-realistic",
        "misaligned",
        "nominal",
        "probst-6-7",
        "watched",
    ]
    for name in shipped_scenarios():
        assert len(load_scenario(name).description) > 40


def test_misaligned_is_the_robot_of_table_6_1():
    scenario = load_scenario("misaligned")
    np.testing.assert_array_equal(scenario.station.errors.joint_offset_deg, [1.0, 1.5, 2.0, 2.5, 3.0, 3.5])
    np.testing.assert_array_equal(scenario.station.errors.tool_translation_mm, [10.0, 10.0, 10.0])
    np.testing.assert_array_equal(scenario.station.errors.tool_zyx_deg, [0.0, 0.0, 0.1])
    assert scenario.station.payload == 7.0
    assert [scenario.servo.laws[law].translation for law in ("numerical_ik", "pbvs", "position_level")] == [
        7,
        5,
        4,
    ]
    assert scenario.reference.settle == 4.0


def test_dead_time_is_misaligned_with_140_ms_from_command_to_motion():
    late, base = load_scenario("dead-time"), load_scenario("misaligned")
    assert late.station.drive.command_delay + late.station.drive.dead_time == pytest.approx(0.14)
    late.station.drive, late.description = base.station.drive, base.description
    assert scenario_text(late) == scenario_text(base)


@pytest.mark.parametrize("name", ["cell", "dead-time", "everything", "misaligned", "nominal"])
def test_the_text_of_a_scenario_reads_back_as_the_same_scenario(tmp_path: Path, name: str):
    text = scenario_text(load_scenario(name))
    assert scenario_text(load_scenario(written(tmp_path, text))) == text


def test_a_file_extends_a_shipped_scenario_or_one_beside_it(tmp_path: Path):
    written(tmp_path, "extends: misaligned\nstation: {payload: 3}\n", "base.yaml")
    name = written(tmp_path, "extends: base.yaml\nstation: {camera: {delay: 0.02}}\n")
    scenario = load_scenario(name)
    assert scenario.station.payload == 3.0
    assert scenario.station.camera.delay == 0.02
    assert isinstance(scenario.station.camera, PoseCameraConfig)
    assert scenario.station.camera.position_sigma == 50e-6  # of the one at the bottom
    assert scenario.servo.laws["pbvs"].translation == 5.0


def test_settings_come_last_and_are_read_as_yaml():
    settings = ["station.camera.delay=0.008", "initial_error_mm=[1, 2, 3]", "law=pbvs", "station.payload=0.5"]
    scenario = load_scenario("nominal", settings)
    assert scenario.station.camera.delay == 0.008
    np.testing.assert_array_equal(scenario.initial_error_mm, [1.0, 2.0, 3.0])
    assert scenario.law == "pbvs"
    assert scenario.station.payload == 0.5
    law = load_scenario("nominal", ["servo.laws.pbvs.translation=3"]).servo.laws["pbvs"]
    assert (law.translation, law.drive) == (3.0, "velocity")  # the rest of the law stays


def test_a_tag_may_say_whose_gains_and_whose_link_they_are(tmp_path: Path):
    """As Drake tags the members of a union; one that is not what belongs there is refused."""
    name = written(
        tmp_path,
        "extends: misaligned\nservo: {laws: {numerical_ik: !NumericalIk {translation: 3}}}\n"
        "station: {link: !AbbEgm {run: {timeout: 5}}}\n",
    )
    scenario = load_scenario(name, ["servo.laws.numerical_ik.rotation=2"])
    gains = scenario.servo.laws["numerical_ik"]
    assert (gains.translation, gains.rotation, gains.drive) == (3.0, 2.0, "cascade")
    link = scenario.station.link
    assert isinstance(link, AbbEgm)
    assert link.run.timeout == 5.0
    wrong = written(tmp_path, "servo: {laws: {numerical_ik: !Pbvs {translation: 3}}}\n", "wrong.yaml")
    with pytest.raises(
        ScenarioError, match=r"line 1: servo\.laws\.numerical_ik takes .* !NumericalIk, got !Pbvs"
    ):
        load_scenario(wrong)


def test_a_law_takes_its_own_gains_alone():
    assert load_scenario("nominal", ["servo.laws.position_level.angles=euler"])
    with pytest.raises(
        ScenarioError, match=r"unknown key 'servo\.laws\.pbvs\.angles'; known here: .*speed_limit"
    ):
        load_scenario("nominal", ["servo.laws.pbvs.angles=euler"])


def test_a_small_number_may_be_written_with_an_exponent_and_no_point():
    """YAML 1.1 takes 50e-6 for a text; whoever sets a spread does not."""
    scenario = load_scenario("nominal", ["station.camera.position_sigma=50e-6"])
    assert isinstance(scenario.station.camera, PoseCameraConfig)
    assert scenario.station.camera.position_sigma == 50e-6


def test_a_scenario_of_nothing_is_the_default(tmp_path: Path):
    scenario = load_scenario(written(tmp_path, "description: empty\n"))
    assert (scenario.robot, scenario.station.period, scenario.station.payload) == ("irb1200", 4e-3, 0.0)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        (
            "station.camera.delayy=0.1",
            ["unknown key 'station.camera.delayy'", "known here", "position_sigma"],
        ),
        ("speed=1", ["unknown key 'speed'", "station", "servo"]),
        ("servo.laws.pbvs.gain=1", ["unknown key 'servo.laws.pbvs.gain'", "translation"]),
        ("servo.laws.magic.translation=1", ["unknown key 'servo.laws.magic'", "position_level"]),
        ("law=magic", ["law must be one of", "numerical_ik", "'magic'"]),
        ("servo.laws.pbvs.drive=torque", ["servo.laws.pbvs.drive must be one of", "cascade", "'torque'"]),
        ("station.kind=real", ["station.kind must be one of simulated", "'real'"]),
        ("station.elasticity=soft", ["station.elasticity must be one of rigid, joints", "'soft'"]),
        ("station.camera.delay=4", ["station.camera.delay must be between 0 and 1 s", "got 4"]),
        ("station.drive.command_delay=4", ["station.drive.command_delay must be between", "1 s, got 4"]),
        ("station.drive.dead_time=140", ["station.drive.dead_time must be between", "1 s, got 140"]),
        ("station.camera.position_sigma=50", ["station.camera.position_sigma must be between", "m, got 50"]),
        ("station.camera.delay=.nan", ["station.camera.delay", "nan"]),
        ("station.period=0", ["station.period must be between", "s, got 0"]),
        ("servo.laws.pbvs.translation=-1", ["servo.laws.pbvs.translation must be between", "got -1"]),
        ("station.camera.delay=fast", ["station.camera.delay must be a number", "'fast'"]),
        ("station.camera.delay=true", ["station.camera.delay must be a number, got true"]),
        ("station.camera=4", ["station.camera must be a group of", "got 4"]),
        ("servo.laws=4", ["servo.laws must be a group", "got 4"]),
        ("seed=1.5", ["seed must be a whole number", "got 1.5"]),
        ("initial_error_mm=[1, 2]", ["initial_error_mm must be 3 numbers", "[1, 2]"]),
        ("station.errors.tool_translation_mm=[1000,0,0]", ["[0] must be between -200 and 200 mm, got 1000"]),
        ("station.errors.frame_translation_mm.pl_12=[0,0,500]", ["pl_12[2]", "-200 and 200 mm, got 500"]),
        ("station.errors.joint_offset_deg=[0,0,90,0,0,0]", ["joint_offset_deg[2]", "45 deg, got 90"]),
        ("station.errors.joint_offset_deg=[1,2,3,4,5,x]", ["joint_offset_deg must be 6 numbers", "'x'"]),
        ("home_deg=0", ["home_deg must be 6 numbers", "got 0"]),
        ("station.camera.delay", ["--set station.camera.delay", "must look like"]),
        ("=3", ["--set =3", "must look like"]),
        (
            "station.payload.mass=3",
            ["--set station.payload.mass=3: station.payload must be a number", "'mass': 3"],
        ),
        ("station.camera.delay=[", ["--set station.camera.delay=["]),
        # What the parts of the diagram would refuse later.
        ("station.camera.dropout_probability=1.5", ["dropout_probability", "1.5"]),
        ("station.camera.dropouts=[[0.2, 0.1]]", ["dropouts: a drop-out must be [start, end]", "[0.2, 0.1]"]),
        ("servo.guard.speed_share=2", ["speed_share", "2"]),
        ("station.payload=50", ["payload", "50"]),
        ("integrator.scheme=magic", ["integrator.scheme", "magic"]),
        ("servo.laws.numerical_ik.translation=0", ["translation", "got 0"]),
        ("station.drive.command_delay=0.001", ["command", "0.001"]),
        ("servo.guard.hold_after=0.9", ["hold_after", "0.9"]),
        (
            "station.camera.period=0.1",
            ["station.camera.period=0.1 s", "servo.guard.hold_after=0.05 s"],
        ),
        (
            "reference.path=square",
            ["reference.path must be one of rectangle, circle, figure_eight, points"],
        ),
        (
            "reference.waypoints=[{translation_mm: [1, 2]}, {}]",
            ["reference.path.waypoints[0].translation_mm", "3 numbers", "[1"],
        ),
        ("description=5", ["description", "5"]),
        ("seed=true", ["seed must be a whole number, got true"]),
        ("seed=-1", ["seed must be between 0 and 4294967295, got -1"]),
        ("servo.guard.resume=1", ["servo.guard.resume must be true or false, got 1"]),
        ("station.drive.cascade.velocity=-5", ["station.drive.cascade.velocity must be positive, in 1/s"]),
        ("servo.feedforward.prefilter.order=50", ["prefilter.order must be between 1 and 10, got 50"]),
        ("integrator.scheme=rk9", ["integrator.scheme must be one of auto,", "radau3", "got 'rk9'"]),
        ("station.payload={mass: 1, mass: 2}", ["key 'mass' is given twice"]),
    ],
)
def test_refuses_a_mistake_in_one_line_that_says_what_and_where(setting: str, words: list[str]):
    """When the scenario is read, or at the latest when the diagram is built; always a ValueError."""
    with pytest.raises(ValueError) as caught:  # noqa: PT011 the words below say which
        Experiment(load_scenario("misaligned", [setting]), "numerical_ik")
    text = str(caught.value)
    assert "\n" not in text
    for word in words:
        assert word in text


def test_a_refusal_names_the_scenario(tmp_path: Path):
    name = written(tmp_path, "station: {payload: heavy}\n")
    assert refusal(name).startswith(f"scenario {name}, line 1: station.payload must be a number")


def test_a_refusal_names_the_line_also_in_a_file_that_is_extended(tmp_path: Path):
    base = written(tmp_path, "extends: nominal\nstation:\n  camera:\n    delay: 9\n", "base.yaml")
    name = written(tmp_path, "extends: base.yaml\nseed: 1\n")
    assert refusal(name) == f"scenario {base}, line 4: station.camera.delay must be between 0 and 1 s, got 9"


def test_a_key_that_is_given_twice_is_refused_with_its_line(tmp_path: Path):
    name = written(tmp_path, "seed: 1\nstation: {payload: 1}\nseed: 2\n")
    assert refusal(name) == f"scenario {name}, line 3: key 'seed' is given twice"


def test_numbers_that_contradict_each_other_are_both_named(tmp_path: Path):
    name = written(tmp_path, "servo:\n  guard:\n    hold_after: 0.6\n")
    message = "servo.guard.hold_after=0.6 s must be below servo.guard.stop_after=0.5 s"
    assert refusal(name) == f"scenario {name}, line 3: {message}"


def test_people_are_not_looked_for_where_no_images_come_from():
    message = "station.overview.enabled with station.kind=egm needs station.overview.source"
    with pytest.raises(ScenarioError, match=message):
        load_scenario("watched", ["station.kind=egm", "station.overview.source=''"])


def test_events_are_written_as_they_are_read(tmp_path: Path):
    text = "[!PayloadChange {at: 8, payload: 7}, !ToolShift {at: 9, shift_mm: [0.5, 0, 0]}]"
    scenario = load_scenario("misaligned", [f"station.events={text}"])
    payload, tool = scenario.station.events
    assert payload == PayloadChange(at=8.0, payload=7.0)
    assert isinstance(tool, ToolShift)
    np.testing.assert_array_equal(tool.shift_mm, [0.5, 0.0, 0.0])
    file = tmp_path / "again.yaml"
    file.write_text(scenario_text(scenario))
    assert str(load_scenario(str(file)).station.events) == str(scenario.station.events)


def path_of(*settings: str) -> Shape:
    return load_scenario("nominal", list(settings)).reference.path


def test_a_member_of_a_union_is_chosen_by_its_tag_or_its_short_name(tmp_path: Path):
    tagged = written(tmp_path, "extends: nominal\nreference:\n  path: !Circle {radius_mm: 60}\n")
    assert isinstance(path_of("reference.path=points"), Points)
    assert isinstance(path_of("reference.path=!FigureEight {turns: 2}"), FigureEight)
    circle = load_scenario(tagged).reference.path
    assert isinstance(circle, Circle)
    assert (circle.radius_mm, circle.turns) == (60.0, 1)
    changed = load_scenario(tagged, ["reference.path.turns=3"]).reference.path
    assert isinstance(changed, Circle)
    assert (changed.radius_mm, changed.turns) == (60.0, 3)


def test_another_member_keeps_what_both_have(tmp_path: Path):
    tagged = written(tmp_path, "reference: {path: !Circle {radius_mm: 60, turns: 2}}\n")
    eight = load_scenario(tagged, ["reference.path=figure_eight"]).reference.path
    assert isinstance(eight, FigureEight)
    assert eight.turns == 2


@pytest.mark.parametrize(
    "settings",
    [
        ["reference.path=circle", "reference.circle.radius_mm=60"],
        ["reference.circle.radius_mm=60", "reference.path=circle"],
        ["reference={path: circle, circle: {radius_mm: 60}, figure_eight: {turns: 2}}"],
    ],
)
def test_names_of_older_files_mean_what_they_meant(settings: list[str]):
    circle = path_of(*settings)
    assert isinstance(circle, Circle)
    assert (circle.radius_mm, circle.turns) == (60.0, 1)


def test_a_field_of_another_member_is_refused_with_those_there_are():
    message = "unknown key 'reference.path.radius_mm'; known here: waypoints"
    assert (
        refusal("nominal", "reference.path.radius_mm=60") == f"--set reference.path.radius_mm=60: {message}"
    )


@pytest.mark.parametrize("name", ["nothing", "folder/nothing.yaml"])
def test_a_missing_scenario_is_named_beside_those_that_exist(name: str):
    text = refusal(name)
    assert f"scenario '{name}': no file" in text
    assert "everything, everything-realistic, misaligned, nominal" in text


def test_a_file_that_extends_itself_is_refused(tmp_path: Path):
    written(tmp_path, "extends: b.yaml\n", "a.yaml")
    assert "'extends' runs in a circle" in refusal(written(tmp_path, "extends: a.yaml\n", "b.yaml"))


@pytest.mark.parametrize("text", ["[1, 2]", "station: [", "", "just words"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path, text: str):
    name = written(tmp_path, text)
    assert refusal(name).startswith((f"scenario {name}: ", f"scenario {name}, line 1: no valid YAML"))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["initial_error_mm=[3000, 0, 0]"], ["cannot follow the path 'rectangle'", "out of reach"]),
        (["reference.path=circle", "reference.circle.radius_mm=900"], ["cannot follow the path 'circle'"]),
    ],
)
def test_a_path_out_of_reach_is_refused_before_anything_moves(settings: list[str], words: list[str]):
    with pytest.raises(ScenarioError) as caught:
        Experiment(load_scenario("nominal", settings), "pbvs")
    for word in words:
        assert word in str(caught.value)


def test_a_scenario_travels_to_another_process():
    scenario = load_scenario("misaligned")
    assert scenario_text(pickle.loads(pickle.dumps(scenario))) == scenario_text(scenario)


PLACES = {
    "two below": (
        "extends: [misaligned, cell]",
        "1: extends must be the name of one file, got ['misaligned', ",
    ),
    "none below": ("seed: 1\nextends: nosuch", "2: extends: scenario 'nosuch': no file of that name comes"),
    "load": (
        "station:\n  events:\n  - !PayloadChange {at: 8, payload: -3}",
        "3: station.events[0].payload must be between 0 and 1000 kg, got -3",
    ),
    "time": (
        "station:\n  events:\n  - !CameraLoss {duration: 3}",
        "3: station.events[0].at must be positive",
    ),
    "size": (
        "station:\n  events:\n  - !ToolShift {at: 1, shift_mm: [1, .inf, 0]}",
        "3: station.events[0].shift_mm[1] must be finite, in mm, got inf",
    ),
    "losses": (
        "station:\n  camera:\n    dropouts: [[1, 2],\n      [2, 1]]",
        "4: station.camera.dropouts: a drop-out must be [start, end]",
    ),
    "share": (
        "station:\n  camera:\n    dropout_probability: 1",
        "3: station.camera.dropout_probability must be between 0 and 0.999, got 1",
    ),
}


@pytest.mark.parametrize(("text", "message"), PLACES.values(), ids=PLACES)
def test_a_refusal_names_file_and_line(tmp_path: Path, text: str, message: str):
    path = written(tmp_path, text + "\n")
    assert f"scenario {path}, line {message}" in refusal(path)


def test_a_refused_setting_is_named():
    message = "--set station.camera.dropouts=[3]: station.camera.dropouts: a drop-out must be [start, end]"
    assert message in refusal("misaligned", "station.camera.dropouts=[3]")
