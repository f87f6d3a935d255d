"""A law of one's own: the tutorial as printed, any system with the ports, and what is refused."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, LeafSystem

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import ScenarioError, load_scenario, scenario_text
from experiments.library import simulate
from experiments.metrics.run_metrics import error_metrics
from robots.dynamics.newton_inverse import inverse_kinematics
from robots.kinematics.forward import Kinematics
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.named_classes import OwnClassError
from systems.reference.reference import PathAhead
from systems.samples import JointSample, PoseSample
from systems.servo import LAWS, LawConfig
from tests.experiments.commands import SHORT, files, refusal, truetip

TUTORIAL = Path(__file__).resolve().parents[2] / "docs" / "own_law.md"
LONG_ENOUGH = ["reference.path=circle", "reference.acceleration=8", "reference.settle=1", "reference.dwell=1"]


def printed() -> str:
    (code,) = re.findall(r"```python\n(.*?)```", TUTORIAL.read_text(), re.S)
    return code


@pytest.fixture
def my_law(tmp_path: Path) -> str:
    (tmp_path / "my_law.py").write_text(printed())
    return f"{tmp_path / 'my_law.py'}:MyLaw"


def refused(tmp_path: Path, text: str, name: str = "Mine") -> str:
    """The line that refuses a law in a file with this text."""
    (tmp_path / "mine.py").write_text(text)
    out = tmp_path / "out"
    line = refusal(truetip("run", f"--law={tmp_path / 'mine.py'}:{name}", *SHORT, f"--out={out}"))
    assert not out.exists()
    return line


@pytest.mark.slow
def test_the_printed_law_is_short_and_brings_the_tip_where_the_open_loop_does_not(my_law: str):
    assert len(printed().splitlines()) <= 40
    scenario = load_scenario("misaligned", LONG_ENOUGH)
    static = {}
    for law in ("open_loop", my_law):
        experiment = Experiment(scenario, law)
        experiment.advance()
        static[law] = np.linalg.norm(error_metrics(experiment.log(), "true")["static_mm"])
    assert static["open_loop"] > 10.0
    assert static[my_law] < 0.5  # five time constants of its gain of 4 /s, 50 um of noise


@pytest.mark.slow
def test_run_and_compare_take_it_beside_the_shipped_ones(my_law: str, tmp_path: Path):
    arguments = [f"--laws=open_loop,{my_law}", "--quick", *SHORT, f"--out={tmp_path / 'out'}"]
    result = truetip("compare", *arguments, "--json=-", "--jobs=1")
    assert result.exit_code == 0, result.output
    runs = json.loads(result.stdout)["runs"]
    assert list(runs) == ["open_loop", my_law]
    assert len(runs[my_law]["true"]["static_deg"]) == 3
    report = (tmp_path / "out" / "report.html").read_text()
    assert "My law" in report
    assert "#7a5195" in report
    alone = truetip("run", f"--law={my_law}", *SHORT, f"--out={tmp_path / 'alone'}")
    assert alone.exit_code == 0, alone.output
    assert "summary.json" in files(tmp_path / "alone")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("traits", "said"),
    [
        ("", "the guard stopped the robot at 0.5 s and it did not go on"),
        ("uses_camera = False", "the guard held a joint at the end of its range from 0.0 to"),
    ],
)
def test_a_law_that_commands_degrees_is_told_that_the_guard_did_not_follow_it(
    traits: str, said: str, tmp_path: Path
):
    text = printed().replace("joints[:6], joints[6:12]", "np.rad2deg(joints[:6]), np.rad2deg(joints[6:12])")
    law = tmp_path / "degrees.py"
    law.write_text(text.replace("    memory_size", f"    {traits}\n    memory_size"))
    result = truetip("run", f"--law={law}:MyLaw", *SHORT, f"--out={tmp_path / 'out'}")
    assert result.exit_code == 1, result.output
    assert f"truetip: law {law}:MyLaw: {said}" in result.stderr
    assert result.stderr.endswith(
        "; joints were commanded beyond their range at once: are commands in rad and rad/s?\n"
    )
    assert "report.html" in files(tmp_path / "out")  # which shows what happened


@pytest.mark.slow
def test_a_file_that_is_edited_between_two_runs_of_a_session_is_read_again(my_law: str):
    scenario = load_scenario("misaligned", LONG_ENOUGH)
    before = simulate(scenario, my_law)
    file = Path(my_law.rpartition(":")[0])
    file.write_text(printed().replace("translation: float = 4.0", "translation: float = 1.0"))  # as long
    after = simulate(scenario, my_law)
    assert not np.array_equal(before.X_WE_true, after.X_WE_true)


class Bare(LeafSystem):
    """Nothing but the six ports: joints for the wanted pose of the path ahead, by analytic inverse."""

    uses_camera = False

    def __init__(self, model: ControllerModel, config: LawConfig, guard: GuardConfig) -> None:
        super().__init__()
        self._model, self._inverse = model, inverse_kinematics(model.robot, model.payload)
        self._kinematics = Kinematics(model.robot)
        self._ahead = self.DeclareAbstractInputPort("reference", Value[object]())
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        for name in ("position_command", "velocity_command"):
            self.DeclareStateOutputPort(name, self.DeclareDiscreteState(np.full(6, np.nan)))
        self.DeclarePeriodicDiscreteUpdateEvent(model.period, 0.0, self._tick)

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        path: PathAhead = self._ahead.Eval(context)
        X, V, _ = path.sample(np.array([context.get_time() + self._model.preview]))
        last = discrete_state.get_vector(0).value()
        q = self._inverse.nearest(X[0], self._joints.Eval(context).position if np.isnan(last[0]) else last)
        discrete_state.set_value(0, q)
        discrete_state.set_value(1, np.linalg.solve(self._kinematics.jacobian(q), V[0]))


@pytest.mark.slow
def test_any_system_with_the_ports_is_a_law_made_already_or_as_a_class_or_in_a_diagram():
    scenario = load_scenario("misaligned", [s.removeprefix("--set=") for s in SHORT])
    shipped = Experiment(scenario, "open_loop")
    shipped.advance(until=1.0)
    model = shipped.servo.model
    builder = DiagramBuilder()
    inside = builder.AddSystem(Bare(model, LawConfig(), GuardConfig()))
    for index in range(inside.num_input_ports()):
        port = inside.get_input_port(index)
        builder.ExportInput(port, port.get_name())
    for index in range(inside.num_output_ports()):
        port = inside.get_output_port(index)
        builder.ExportOutput(port, port.get_name())
    builder.ExportInput(builder.AddSystem(BlindEye()).get_input_port(), "pose_sample")
    for law in (Bare, Bare(model, LawConfig(), GuardConfig()), builder.Build()):
        experiment = Experiment(scenario, law)
        experiment.advance(until=1.0)
        commands = experiment.log().position_command[1:]
        assert commands == pytest.approx(shipped.log().position_command[1:], abs=1e-8)


class BlindEye(LeafSystem):
    """A diagram has no traits of its own, so it uses the camera: this one looks at it, and no more."""

    def __init__(self) -> None:
        super().__init__()
        self.DeclareAbstractInputPort("pose_sample", Value(PoseSample()))


def test_its_gains_are_those_that_the_scenario_says(my_law: str, tmp_path: Path):
    settings = [f"servo.laws.{my_law}.translation=7", f"servo.laws.{my_law}.drive=velocity"]
    scenario = load_scenario("misaligned", settings)
    (tmp_path / "again.yaml").write_text(scenario_text(scenario))
    for each in (scenario, load_scenario(str(tmp_path / "again.yaml"))):
        config = Experiment(each, my_law).servo.law.config
        assert (config.translation, config.drive) == (7.0, "velocity")
        assert config.rotation == LawConfig().rotation
    assert Experiment(load_scenario("misaligned"), my_law).servo.law.config.translation == 4.0


def test_its_gains_count_for_its_class_too_however_it_was_imported(my_law: str, monkeypatch):
    monkeypatch.syspath_prepend(str(Path(my_law).parent))
    law = importlib.import_module("my_law").MyLaw
    scenario = load_scenario("misaligned", [f"servo.laws.{my_law}.translation=7"])
    assert Experiment(scenario, law).servo.law.config.translation == 7.0


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("{law}.trnslation=7", "did you mean translation?"),
        ("{law}.translation=-7", "MyLaw.translation must be"),
        ("{law}x.translation=7", "has no class 'MyLawx'; did you mean MyLaw?"),
        ("MyLaw.translation=7", "or FILE.py:CLASS of a law of one's own"),
    ],
)
def test_gains_that_it_has_not_are_refused_where_they_are_said(my_law: str, change: str, why: str):
    (path := Path(my_law.rpartition(":")[0])).write_text(
        path.read_text().replace("translation: float = 4.0", "translation: float = positive(4.0)")
        .replace("import numpy", "from robots.configuration.quantity import positive\nimport numpy")
    )  # fmt: skip
    setting = f"servo.laws.{change.format(law=my_law)}"
    with pytest.raises(ScenarioError, match=re.escape(f"--set {setting}: ")) as refused:
        load_scenario("misaligned", [setting])
    assert why in str(refused.value)


@pytest.mark.parametrize(
    ("right", "wrong", "why"),
    [
        ("LawOutput(joints[:6]", "LawOutput(joints[:5]", "step must give 6 numbers as position, got 5"),
        ("memory_size = 21", "memory_size = 20", "initial_state must give 20 numbers, got 21"),
        ("0, *shift])\n", "0])\n", "step must give 6 numbers as correction, got 3"),
        ("return LawOutput(", "LawOutput(", "step must return a LawOutput, got None"),
    ],
)
def test_a_result_of_the_wrong_size_is_named(my_law: str, right: str, wrong: str, why: str):
    assert right in printed()
    Path(my_law.rpartition(":")[0]).write_text(printed().replace(right, wrong))
    with pytest.raises(OwnClassError, match=f"class MyLaw: {why}"):
        Experiment(load_scenario("misaligned"), my_law).advance(until=0.1)


@pytest.mark.parametrize(
    ("method", "given"), [("step", "takes 2 positional arguments but 3"), ("initial_state", "takes 1")]
)
def test_a_method_that_does_not_take_what_it_is_given_is_named_with_its_line(
    my_law: str, method: str, given: str
):
    wrong = {"step": "moment: LawInput", "initial_state": ""}[method]
    text = re.sub(rf"def {method}\(self.*?\)", f"def {method}(self, {wrong})", printed())
    Path(my_law.rpartition(":")[0]).write_text(text)
    line = next(n for n, line in enumerate(text.splitlines(), 1) if f"def {method}" in line)
    told = truetip("run", f"--law={my_law}", *SHORT)
    assert told.exit_code == 1
    assert f"my_law.py, line {line}, in {method}: TypeError: MyLaw.{method}() {given}" in told.stderr


@pytest.mark.parametrize("command", ["run", "compare"])
@pytest.mark.parametrize(
    ("at", "method", "raises", "what"),
    [
        ("shift, rate", "step", "{}['gain']", "KeyError: 'gain'"),
        ("here, _", "initial_state", "{}['gain']", "KeyError: 'gain'"),
        ("shift, rate", "step", "raise SystemExit(0)", "SystemExit: 0"),
    ],
)
def test_an_exception_of_it_is_one_line_with_its_place(
    my_law: str, at: str, method: str, raises: str, what: str, command: str
):
    """Its author looks for the line of his own file, not for ours."""
    path = Path(my_law.rpartition(":")[0])
    lines = printed().splitlines()
    number = next(n for n, line in enumerate(lines) if line.strip().startswith(at))
    lines[number] = f"        {raises}"
    path.write_text("\n".join(lines))
    told = truetip(command, f"--law{'s' if command == 'compare' else ''}={my_law}", *SHORT)
    assert told.exit_code == 1
    assert f"{path.name}, line {number + 1}, in {method}: {what}" in told.stderr
    assert "Traceback" not in told.stderr


@pytest.mark.real_time
@pytest.mark.slow
def test_a_wrong_result_is_refused_before_a_station_is_asked_for(my_law: str, tmp_path: Path):
    path = Path(my_law.rpartition(":")[0])
    path.write_text(printed().replace("return LawOutput(", "LawOutput("))
    out = tmp_path / "out"
    told = truetip("run", f"--law={my_law}", "--with-cell", f"--out={out}")
    assert told.exit_code == 2, told.output
    assert "class MyLaw: step must return a LawOutput, got None" in told.stderr
    assert not out.exists()


def test_what_is_no_law_is_refused_in_one_line(tmp_path: Path):
    assert "there is no file nowhere.py" in refusal(truetip("run", "--law=nowhere.py:Mine", *SHORT))
    assert "FILE.py:CLASS, got 'mpc'" in refusal(truetip("compare", "--laws=open_loop,mpc", *SHORT))
    assert "'pbvs' is there twice" in refusal(truetip("compare", "--laws=pbvs,pbvs", *SHORT))
    assert "has no class 'Mine'" in refused(tmp_path, "x = 1\n")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("\ndef broken(:\n", "mine.py, line 2: SyntaxError: invalid syntax\n"),
        (
            "import nothing_of_that_name\n",
            "mine.py, line 1: ModuleNotFoundError: No module named 'nothing_of_that_name'",
        ),
        ("def gain():\n    return {}['gain']\ngain()\n", "mine.py, line 2, in gain: KeyError: 'gain'"),
        (
            "class Mine:\n    def __init__(self, *_):\n        raise SystemExit('no licence')\n",
            "mine.py, line 3, in __init__: SystemExit: no licence",
        ),
        (
            "class Mine:\n    def __init__(self, *_):\n        raise RuntimeError('no licence')\n",
            "truetip: mine.py, line 3, in __init__: RuntimeError: no licence",
        ),
        (
            "from pydrake.systems.primitives import Adder\n"
            "class Mine(Adder):\n    def __init__(self, *_): super().__init__(2, 6)\n",
            "law Mine: input port 'joint_sample' is missing",
        ),
        (
            "from systems.servo.open_loop import OpenLoop\n"
            "class Mine(OpenLoop):\n"
            "    def __init__(self, *a):\n        super().__init__(*a)\n"
            "        self.DeclareVectorInputPort('crystal_ball', 1)\n",
            "nothing for input port 'crystal_ball'",
        ),
        (
            "from systems.servo.open_loop import OpenLoop\nclass Mine(OpenLoop):\n    Config = dict\n",
            "Config must be a dataclass that extends LawConfig",
        ),
        (
            "from systems.servo.law_config import LawConfig\nfrom systems.servo.open_loop import OpenLoop\n"
            "class Gains(LawConfig):\n    translation: float = 4.0\n"
            "class Mine(OpenLoop):\n    Config = Gains\n",
            "with a @dataclass of its own",
        ),
        (
            "from systems.servo.open_loop import OpenLoop\nclass Mine(OpenLoop):\n    title = 42\n",
            "title must be a text, got 42",
        ),
        (
            "from systems.servo.open_loop import OpenLoop\nclass Mine(OpenLoop):\n    colour = 'mauvish'\n",
            "colour must look like #7a5195",
        ),
        ("import sys\nsys.exit(3)\n", "mine.py, line 2: SystemExit: 3"),
        ("class Mine:\n    pass\n", "Mine"),
        (
            "from systems.servo.law import ServoLaw\nclass Mine(ServoLaw):\n    pass\n",
            "class Mine needs a method 'step'",
        ),
    ],
    ids=[
        *(
            "syntax",
            "import",
            "raises",
            "exit of the class",
            "error of the class",
            "missing port",
            "unknown port",
            "config",
            "no dataclass",
            "title",
            "colour",
        ),
        *("exit", "no system", "no step"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(tmp_path: Path, text: str, why: str):
    assert why in refused(tmp_path, text)


def test_every_shipped_law_says_what_it_is():
    for name, law in LAWS.items():
        assert LAWS.name_of(law) == name
        assert law.title != "Law"
        assert re.fullmatch("#[0-9a-f]{6}", law.colour)
