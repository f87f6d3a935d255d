"""Several targets, instruments and distances in one adjustment, against a robot of matrix products."""

from dataclasses import replace

import numpy as np
import pytest

from robots.calibration.error_model import ErrorModel
from robots.calibration.identification import IdentificationError
from robots.calibration.instruments.cell_file import read_cell
from robots.calibration.instruments.identify import (
    InstrumentCalibration,
    _start,
    identify_with_instruments,
)
from robots.calibration.instruments.observation_file import read_observations
from robots.calibration.instruments.observations import MeasuringCell, Observations
from robots.calibration.instruments.problem import InstrumentProblem
from robots.calibration.instruments.validation import validate_lines
from robots.calibration.measurement_file import read_measurements
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from robots.metrology.point_registration import register_points
from tests.robots.calibration.matrix_robot import MatrixRobot
from tests.robots.calibration.seen import ANCHOR, FACTORS, PLACES, observed

NOTHING = MeasuringCell({}, {}, {}, {})


def part_of(seen: Observations, lines: np.ndarray) -> Observations:
    """Some lines, with the configurations of all."""
    parts = ("row", "target", "instrument", "position", "distance", "sigma", "lines")
    return replace(seen, **{name: getattr(seen, name)[lines] for name in parts})


def worst_error(found: InstrumentCalibration, true: MatrixRobot) -> float:
    """Of all targets at fresh configurations in m, wherever the world of the robot is."""
    q = true.configurations(100, np.random.default_rng(99))
    X, X_true = Kinematics(found.calibrated_robot("irb1200")).forward(q), true.forward(q)
    p = [X[:, :3, :3] @ place + X[:, :3, 3] for place in found.setting.places]
    p_true = [X_true[:, :3, :3] @ place + X_true[:, :3, 3] for place in PLACES.values()]
    return float(np.abs(register_points(np.vstack(p), np.vstack(p_true)).residual).max())


def test_derivatives_are_those_of_differences():
    _, seen = observed(count=15)
    model = ErrorModel(load_robot("irb1200"))
    problem = InstrumentProblem(model, seen, NOTHING, _start(model, seen, NOTHING))
    u = 0.1 * np.random.default_rng(3).normal(size=len(problem.columns))
    at = problem.linearise(u)
    for k in range(len(u)):
        d = 1e-5 * np.eye(len(u))[k]
        slope = (problem.residuals(u - d) - problem.residuals(u + d)) / 2e-5
        np.testing.assert_allclose(at.A[:, :, k], slope, atol=1e-7, err_msg=problem.names[problem.columns[k]])


@pytest.mark.parametrize("name", ["irb1200", "ur10"])
def test_without_noise_robot_targets_and_anchor_are_found_exactly(name: str):
    """Three unknown targets, missing coordinates, two unknown frames and a ball bar in one go."""
    true, seen = observed(name)
    found = identify_with_instruments(load_robot(name), seen)
    assert worst_error(found, true) < 1e-12  # m
    assert found.rank == 30 + 9 + 2 * 6 + 3 - 6 - 6  # less the frame of the robot's base and that of the tool
    assert np.nanmax(np.abs(found.before)) > 2e-3
    assert np.nanmax(np.abs(found.residuals)) < 1e-12
    gaps = found.setting.places - np.array(list(PLACES.values()))
    apart = found.setting.places[1] - found.setting.places[0]
    assert np.linalg.norm(apart) == pytest.approx(np.linalg.norm(PLACES["b"] - PLACES["a"]), abs=1e-12)
    assert np.abs(gaps).max() < 0.05  # as far as the tool itself may be displaced


@pytest.mark.parametrize("name", ["irb1200", "ur10"])
def test_fresh_lines_are_predicted_exactly_and_those_with_gross_errors_named(name: str):
    """Frames, targets and the anchor are those of the calibration, not fitted to the fresh lines again."""
    _, seen = observed(name, count=60, seed=3)
    is_fresh = seen.row >= 40
    used, fresh = part_of(seen, ~is_fresh), part_of(seen, is_fresh)
    fresh.position[7] += 0.005
    found = identify_with_instruments(load_robot(name), used)
    checked = validate_lines(found, fresh)
    before, after = checked.distances()
    assert np.mean(before) > 5e-3
    assert after.max() < 1e-11
    assert checked.outliers == (fresh.lines[7],)
    shifted = replace(fresh, position=fresh.position + 0.01)
    assert validate_lines(found, shifted).distances(0)[1].min() > 0.005
    with pytest.raises(ValueError, match="not predict fresh lines of tracker: half of the positions"):
        validate_lines(found, replace(seen, position=seen.position + 1.0))


def test_a_fixed_parameter_stays_zero_and_no_other_takes_its_place():
    """The zero of joint 1 turns the whole robot, as frames can; what joint 3 does nothing else can do."""
    _, seen = observed()
    robot = load_robot("irb1200")
    turned = identify_with_instruments(robot, seen, fixed=("zero_1",))
    assert "zero_1" not in turned.names
    assert np.nanmax(np.abs(turned.residuals)) < 1e-12
    bent = identify_with_instruments(robot, seen, fixed=("zero_3", "joint3_rz", "joint3_ry"))
    assert np.sqrt(np.nanmean(bent.residuals**2)) > 1e-4
    with pytest.raises(ValueError, match="no parameter is called zero_7; there are base_x"):
        identify_with_instruments(robot, seen, fixed=("zero_7",))


def test_the_noise_of_every_instrument_and_of_the_joints_is_found():
    """Instruments are weighed by it: 0.05 mm, 0.25 mm and 5 um."""
    _, seen = observed(count=150, noise=5e-5, joint=2e-5, seed=4)
    found = identify_with_instruments(load_robot("irb1200"), seen)
    np.testing.assert_allclose(
        found.noise[1:], [5e-5 * FACTORS[name] for name in seen.instruments], rtol=0.25
    )
    assert found.noise[0] == pytest.approx(2e-5, rel=0.25)
    assert not found.outliers


@pytest.mark.slow
def test_a_ball_bar_beside_a_tracker_makes_the_robot_more_accurate():
    """Ten times as good as the tracker, at half of the configurations; in the mean of six robots."""
    robot, errors = load_robot("irb1200"), []
    for seed in range(6):
        for instruments in (("tracker",), ("tracker", "bar")):
            true, seen = observed(count=30, noise=5e-5, seed=seed, instruments=instruments)
            sigmas = {name: 5e-5 * FACTORS[name] for name in instruments}
            found = identify_with_instruments(robot, seen, MeasuringCell({}, {}, {}, sigmas, 0.0))
            errors.append(worst_error(found, true))
    alone, both = np.array(errors).reshape(-1, 2).mean(axis=0)
    assert both < 0.9 * alone


@pytest.mark.slow
@pytest.mark.parametrize("count", [40, 400])
def test_lines_with_gross_errors_are_named_and_the_rest_of_their_configuration_is_used(count: int):
    true, seen = observed(count=count, noise=3e-5, seed=2)
    bad = np.array([10, 41, 77])
    position = seen.position.copy()
    position[bad] += 0.02
    damaged = type(seen)(**{**seen.__dict__, "position": position})
    found = identify_with_instruments(load_robot("irb1200"), damaged)
    is_bar = np.isfinite(seen.distance[bad])
    assert found.outliers == tuple(seen.lines[bad[~is_bar]])
    assert worst_error(found, true) < 5e-4


@pytest.mark.parametrize("factor", [1e3, -1e6])
def test_a_number_that_lost_its_decimal_point_is_left_out_wherever_it_stands(factor: float):
    """Of a tracker, of a camera and of a bar: kilometres say nothing of where an instrument stands."""
    _, seen = observed(noise=2e-5, joint=1e-5)
    robot, position, distance = load_robot("irb1200"), seen.position.copy(), seen.distance.copy()
    whole = np.isfinite(position).all(axis=1)
    bad = [int(np.flatnonzero(whole & (seen.instrument == i))[5]) for i in (0, 1)]
    position[bad, 1] *= factor
    bad.append(int(np.flatnonzero(np.isfinite(distance))[5]))
    distance[bad[-1]] *= abs(factor)
    found = identify_with_instruments(robot, replace(seen, position=position, distance=distance))
    assert set(found.outliers) == set(map(int, seen.lines[bad]))
    assert found.iterations < 3 * identify_with_instruments(robot, seen).iterations


@pytest.mark.slow
def test_a_thousand_positions_of_three_targets_tell_their_noise():
    _, seen = observed(count=1000, noise=5e-5, instruments=("tracker",))
    robot = load_robot("irb1200")
    found = identify_with_instruments(robot, seen)
    assert found.noise[1] == pytest.approx(5e-5, rel=0.05)


def test_an_instrument_that_nothing_places_is_refused():
    _, seen = observed(count=3, instruments=("tracker",))
    position = np.where(np.arange(3) == 0, np.nan, seen.position)
    with pytest.raises(IdentificationError, match="tracker: nothing says where it stands"):
        identify_with_instruments(
            load_robot("irb1200"), type(seen)(**{**seen.__dict__, "position": position})
        )


def test_a_slip_in_the_name_of_an_instrument_is_told_from_a_new_one():
    _, seen = observed(count=10, instruments=("tracker",))
    slipped = replace(
        seen, instrument=(np.arange(len(seen)) == 7).astype(int), instruments=("tracker", "traker")
    )
    with pytest.raises(IdentificationError, match=r"instrument traker: .*got 1; did you mean tracker\?"):
        identify_with_instruments(load_robot("irb1200"), slipped)


@pytest.mark.parametrize("name", ["tracker", "camera"])
def test_an_instrument_whose_lines_belong_to_other_configurations_is_named(name: str):
    """However noisy the adjustment would have to believe it, and though the others fit."""
    _, seen = observed(count=30)
    rng, lines = np.random.default_rng(0), np.flatnonzero(seen.instrument == seen.instruments.index(name))
    seen.position[lines] = seen.position[rng.permutation(lines)]
    with pytest.raises(IdentificationError, match=rf"explains the lines of {name}: half of the positions"):
        identify_with_instruments(load_robot("irb1200"), seen)


HEAD = "q1_deg;q2_deg;q3_deg;q4_deg;q5_deg;q6_deg;target;instrument;x_mm;y_mm;z_mm;distance_mm\n"


def test_decimal_commas_empty_fields_and_configurations_are_read(tmp_path):
    (tmp_path / "m.csv").write_text(
        HEAD + "1,5;2;3;4;5;6;a;tracker;100,25;;300;\n1,5;2;3;4;5;6;b;tracker;1;2;3;\n"
        "9;2;3;4;5;6;a;bar;;;;500,125\n1;2;3;4;5;six;a;bar;;;;5\n1;2;3;4;5;6;a;bar;1;;;5\n"
    )
    seen, problems = read_observations(tmp_path / "m.csv")
    assert (len(seen.q), seen.row.tolist(), seen.targets) == (2, [0, 0, 1], ("a", "b"))
    assert np.rad2deg(seen.q[0, 0]) == pytest.approx(1.5)
    np.testing.assert_allclose(seen.position[0], [0.10025, np.nan, 0.3])
    assert seen.distance[2] == pytest.approx(0.500125)
    assert [(each.row, each.what[:14]) for each in problems] == [(5, "q6_deg is not "), (6, "needs coordina")]


def test_decimal_commas_are_read_in_tables_of_poses_too(tmp_path):
    head = ";".join([*(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm"])
    (tmp_path / "m.csv").write_text(head + "\n1,5;2;3;4;5;6;100,25;2;3\n")
    table, problems = read_measurements(tmp_path / "m.csv")
    assert not problems
    np.testing.assert_allclose(table.position[0], [0.10025, 0.002, 0.003])


def test_a_cell_says_what_is_known(tmp_path):
    (tmp_path / "cell.yaml").write_text(
        "targets: {a: [0, 0, 100]}\nframes: {tracker: [1000, 0, 0, 90, 0, 0]}\n"
        f"anchors: {{bar: {(1e3 * ANCHOR).tolist()}}}\nsigma_mm: {{tracker: 0.05}}\njoint_sigma_deg: 0.001\n"
    )
    cell = read_cell(tmp_path / "cell.yaml")
    np.testing.assert_allclose(cell.places["a"], [0, 0, 0.1])
    np.testing.assert_allclose(cell.frames["tracker"][:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(cell.anchors["bar"], ANCHOR)
    assert cell.sigmas == {"tracker": pytest.approx(5e-5)}


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        ("targets: {a: [0, 0]}", r"line 1: targets\.a must be 3 numbers"),
        ("targets: [1, 2]", r"line 1: targets must be a group of names, got \[1, 2\]"),
        ("targets: {a: [0, 0, .nan]}", r"line 1: targets\.a\[2\] must be finite, in mm, got nan"),
        ("anchors: {}\nsigma_mm: 0.05", "line 2: sigma_mm must be a group of names, got 0.05"),
        ("sigma_mm:\n  t: 0", r"line 2: sigma_mm\.t must be positive, in mm, got 0"),
        ("joint_sigma_deg: [1]", r"line 1: joint_sigma_deg must be a number, got \[1\]"),
        ("joint_sigma_deg: abc", "line 1: joint_sigma_deg must be a number, got 'abc'"),
        ("joint_sigma_deg: -1", "line 1: joint_sigma_deg must be zero or positive, in deg, got -1"),
        ("targets:\n  a: [0, 0, 1]\n  a: [0, 0, 2]", "line 3: key 'a' is given twice"),
        ("target: {}", "line 1: unknown key 'target'; known here: targets, .*did you mean targets"),
    ],
)
def test_a_cell_that_cannot_be_used_is_refused_with_file_and_line(text: str, refusal: str, tmp_path):
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(ValueError, match=rf"bad\.yaml, {refusal}"):
        read_cell(tmp_path / "bad.yaml")


def test_noise_that_lines_say_is_shown_as_they_say_it():
    """A tracker says it of all lines, a camera of none, a bar of half: as it says, found, and found."""
    _, seen = observed(noise=5e-5)
    sizes = 5e-5 * np.array([FACTORS[name] for name in seen.instruments])[seen.instrument]
    numbers, names = np.arange(len(seen)), np.array(seen.instruments)[seen.instrument]
    says = (names == "tracker") | ((names == "bar") & (numbers % 4 < 2))
    seen = replace(seen, sigma=np.where(says, sizes, np.nan))
    found = identify_with_instruments(load_robot("irb1200"), seen)
    shown = dict(zip(seen.instruments, found.noise[1:].tolist(), strict=True))
    assert shown["tracker"] == pytest.approx(5e-5, rel=1e-12)
    assert shown["camera"] == pytest.approx(25e-5, rel=0.3)
    assert shown["bar"] == pytest.approx(5e-6, rel=0.6)


@pytest.mark.slow
@pytest.mark.parametrize("count", [9, 11])
def test_few_lines_are_not_taken_for_exact(count: int):
    """As many numbers as parameters leave nothing over: that shows neither exactness nor gross errors."""
    for seed in range(3):
        _, seen = observed(count=count, seed=seed, noise=5e-5, instruments=("tracker",))
        seen = part_of(seen, seen.target == 0)
        found = identify_with_instruments(load_robot("irb1200"), replace(seen, targets=("a",)))
        assert found.is_noise_believed
        assert found.noise[1] > 3e-5
        assert found.outliers == ()
