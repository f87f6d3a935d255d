"""The results of the ISO 9283 cycle from made-up runs, whose errors are known."""

import numpy as np
import pytest

from diagrams.record.log import RunLog
from diagrams.scenario.scenario import Scenario, load_scenario
from experiments.accept.robot_cycle import (
    ORDER,
    Cycle,
    cube_poses,
    path_results,
    path_scenario,
    pose_results,
    pose_scenario,
    visits,
)
from experiments.accept.robot_page import Row, verdict, write_acceptance_page
from systems.reference.paths import make_path

BASE = load_scenario("nominal", ["reference.settle=0.5", "reference.acceleration=4"])
CYCLE = Cycle(cube_poses(BASE, 0.25), dwell=0.5, band=1e-4)
CYCLES = 4


def log_of(scenario: Scenario, error, share: float = 1.0) -> RunLog:
    """A run, at a share of the speed, whose tip is off by ``error(times)``, (n, 3) in m."""
    path = make_path(scenario.reference)
    time = np.arange(0.0, path.duration / share, 4e-3)
    wanted = path.sample(share * time)[0]
    true = wanted.copy()
    true[:, :3, 3] += error(time)
    none = np.zeros((len(time), 6))
    return RunLog(
        "made_up", 0, time, wanted, true, true, none, none, none, none, none, none, {}, [],
        path.path_start / share, path.dwell_start / share, path.duration / share,
        tuple(path.lap_starts / share),
        path_time=None if share == 1.0 else share * time,
    )  # fmt: skip


def poses_of(scenario: Scenario, error) -> dict[str, float | None]:
    return pose_results(visits(log_of(scenario, error), scenario, CYCLE, CYCLES), CYCLE)


def test_the_five_poses_are_a_tenth_of_the_diagonal_within_the_corners_of_an_inclined_plane():
    p = CYCLE.poses[:, :3, 3]
    np.testing.assert_allclose(np.linalg.norm(p[1:] - p[0], axis=1), 0.4 * np.sqrt(3.0) * 0.25, rtol=1e-9)
    normal = np.cross(p[1] - p[0], p[2] - p[0])
    np.testing.assert_allclose((p - p[0]) @ normal, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.ptp(p, axis=0), 0.2, rtol=1e-9)


def test_a_constant_offset_is_accuracy_and_neither_scatter_nor_drift():
    scenario = pose_scenario(BASE, CYCLE, CYCLES, 1.0)
    offset = np.array([3e-4, 0.0, 4e-4])
    found = poses_of(scenario, lambda t: np.tile(offset, (len(t), 1)))
    assert found["AP_mm"] == pytest.approx(0.5, rel=1e-9)
    for name in ("RP_mm", "vAP_mm", "AD_mm", "RD_mm", "dAP_mm", "AP_deg", "stabilisation_s", "overshoot_mm"):
        assert found[name] == pytest.approx(0.0, abs=1e-6), name


def test_a_tip_that_drifts_steadily_has_moved_by_three_quarters_of_its_way():
    scenario = pose_scenario(BASE, CYCLE, CYCLES, 1.0)
    end = make_path(scenario.reference).dwell_start

    def drifting(t: np.ndarray) -> np.ndarray:
        return np.outer(t / end, [1e-3, 0.0, 0.0])

    found = poses_of(scenario, drifting)
    assert found["dAP_mm"] == pytest.approx(0.75, abs=0.03)


def test_what_depends_on_the_side_is_variation_and_neither_accuracy_nor_repeatability_nor_drift():
    scenario = pose_scenario(BASE, CYCLE, 2, 1.0)

    def one_sided(t: np.ndarray) -> np.ndarray:
        span = (make_path(scenario.reference).dwell_start - 0.5) / 18
        move = np.clip(np.floor((t - 0.5 + 1e-9) / span).astype(int) - 1, 0, None) % 9
        before, pose = np.array(ORDER)[move], np.array(ORDER)[move + 1]
        is_another_side = before != (pose - 1) % 5
        return np.outer(1e-3 * is_another_side, [0.0, 0.0, 1.0])

    found = pose_results(visits(log_of(scenario, one_sided), scenario, CYCLE, 2), CYCLE)
    assert found["vAP_mm"] == pytest.approx(1.0, rel=1e-6)
    for name in ("AP_mm", "RP_mm", "dAP_mm", "AD_mm"):
        assert found[name] == pytest.approx(0.0, abs=1e-6), name


def test_distances_are_those_of_one_cycle_and_drift_does_not_make_them_scatter():
    scenario = pose_scenario(BASE, CYCLE, CYCLES, 1.0)
    p = CYCLE.poses[:, :3, 3]
    along = (p[3] - p[1]) / np.linalg.norm(p[3] - p[1])
    end = make_path(scenario.reference).dwell_start
    found = poses_of(scenario, lambda t: np.outer(1e-3 * t / end, along))
    # From P2 to P4 are two of the 36 moves of the whole run.
    assert found["AD_mm"] == pytest.approx(2.0 / 36.0, rel=0.02)
    assert found["RD_mm"] == pytest.approx(0.0, abs=1e-6)


def test_a_tip_that_rings_out_needs_the_time_until_its_amplitude_is_that_of_the_band():
    scenario = pose_scenario(BASE, CYCLE, CYCLES, 1.0)
    moves = 9 * CYCLES
    span = (make_path(scenario.reference).dwell_start - 0.5) / moves

    def ringing(t: np.ndarray) -> np.ndarray:
        since = np.mod(t - 0.5, span)  # of the last arrival
        return np.outer(1e-3 * np.exp(-since / 0.05) * np.cos(2 * np.pi * 20.0 * since), [0.0, 0.0, 1.0])

    found = poses_of(scenario, ringing)
    stabilised, overshoot = found["stabilisation_s"], found["overshoot_mm"]
    assert stabilised is not None
    assert overshoot is not None
    assert 0.05 * np.log(10.0) - 0.03 < stabilised < 0.05 * np.log(10.0) + 0.01
    assert 0.1 < overshoot < 1.0


def test_a_tip_that_creeps_into_the_band_and_stays_there_does_not_overshoot():
    """ISO 9283: overshoot is zero where the tip does not leave the band again."""
    scenario = pose_scenario(BASE, CYCLE, CYCLES, 1.0)
    path = make_path(scenario.reference)

    def behind(t: np.ndarray) -> np.ndarray:
        wanted = path.sample(t)[0][:, :3, 3]
        tip, share = wanted.copy(), np.exp(-4e-3 / 0.05)
        for k in range(1, len(t)):
            tip[k] = share * tip[k - 1] + (1.0 - share) * wanted[k]
        return tip - wanted

    found = poses_of(scenario, behind)
    assert found["stabilisation_s"] is not None
    assert found["stabilisation_s"] > 0.0
    assert found["overshoot_mm"] == 0.0


def test_a_tip_that_is_late_at_a_corner_does_not_overshoot_it_and_is_as_fast():
    """ISO 9283: there is no overshoot of a corner before the tip has come to it."""
    scenario = path_scenario(BASE, CYCLE, CYCLES, 1.0)
    path = make_path(scenario.reference)

    def late(t: np.ndarray) -> np.ndarray:
        return path.sample(np.maximum(t - 0.14, 0.0))[0][:, :3, 3] - path.sample(t)[0][:, :3, 3]

    found = path_results(log_of(scenario, late), scenario, CYCLE).results
    assert found["CO_mm"] < 0.001
    assert abs(found["AV_percent"]) < 0.1


def test_a_tip_that_goes_on_behind_a_corner_overshoots_it_by_that():
    scenario = path_scenario(BASE, CYCLE, CYCLES, 1.0)
    path = make_path(scenario.reference)
    onwards = CYCLE.poses[2, :3, 3] - CYCLE.poses[1, :3, 3]  # to P3 and beyond
    onwards = 5e-4 * onwards / np.linalg.norm(onwards)

    def beyond(t: np.ndarray) -> np.ndarray:
        lap = path.lap_starts[1] - path.lap_starts[0]
        since = np.mod(t - path.lap_starts[0], lap) - 0.25 * lap
        return np.outer(np.exp(-np.square((since - 0.1) / 0.03)), onwards)

    found = path_results(log_of(scenario, beyond), scenario, CYCLE).results
    assert found["CO_mm"] == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize(("least", "most"), [(0.14, 0.14), (0.3, 0.3), (0.02, 0.03)])
def test_a_tip_that_is_late_keeps_to_the_path_and_does_not_scatter(least: float, most: float):
    """It begins the first cycle at rest and is on its way to the corner where others begin."""
    scenario = path_scenario(BASE, CYCLE, CYCLES, 1.0)
    path, by = make_path(scenario.reference), np.linspace(least, most, CYCLES)

    def late(t: np.ndarray) -> np.ndarray:
        cycle = np.clip(np.searchsorted(path.lap_starts, t, side="right") - 1, 0, CYCLES - 1)
        return path.sample(np.maximum(t - by[cycle], 0.0))[0][:, :3, 3] - path.sample(t)[0][:, :3, 3]

    found = path_results(log_of(scenario, late), scenario, CYCLE).results
    assert found["AT_mm"] < 0.003
    assert found["RT_mm"] < 0.003


def test_cycles_that_are_apart_across_the_path_scatter_by_that():
    scenario = path_scenario(BASE, CYCLE, CYCLES, 1.0)
    path = make_path(scenario.reference)
    normal = np.cross(*(CYCLE.poses[[1, 2], :3, 3] - CYCLE.poses[0, :3, 3]))
    normal /= np.linalg.norm(normal)

    def apart(t: np.ndarray) -> np.ndarray:
        cycle = np.clip(np.searchsorted(path.lap_starts, t, side="right") - 1, 0, CYCLES - 1)
        return np.outer(np.where(cycle % 2, 1e-4, -1e-4), normal)

    found = path_results(log_of(scenario, apart), scenario, CYCLE)
    inside = (found.edge > 0.02) & (found.edge < 3.98)
    assert found.off[inside].max() < 1e-9
    np.testing.assert_allclose(found.scatter[inside], 1e-4, rtol=1e-3)  # alike far from the middle


@pytest.mark.parametrize("edge", [0.25, 0.02])
def test_noise_and_an_offset_of_the_tip_are_no_velocity(edge):
    cycle = Cycle(cube_poses(BASE, edge), dwell=0.5, band=1e-4)
    scenario, rng = path_scenario(BASE, cycle, CYCLES, 1.0), np.random.default_rng(0)

    def noisy(t: np.ndarray) -> np.ndarray:
        return [0.02, -0.01, 0.03] + 5e-5 * rng.standard_normal((len(t), 3))

    found = path_results(log_of(scenario, noisy), scenario, cycle).results
    assert abs(found["AV_percent"]) < 0.5
    assert found["RV_percent"] < 1.5


def test_a_tip_that_never_stays_within_the_band_has_no_stabilisation_time():
    scenario = pose_scenario(BASE, CYCLE, CYCLES, 1.0)
    found = poses_of(scenario, lambda t: np.outer(2e-4 * np.sin(2e3 * t), [0.0, 0.0, 1.0]))
    assert found["stabilisation_s"] is None


def test_a_tip_that_is_late_is_on_the_path_and_one_beside_it_is_not():
    scenario = path_scenario(BASE, CYCLE, CYCLES, 1.0)
    path = make_path(scenario.reference)

    def late(t: np.ndarray) -> np.ndarray:
        return path.sample(t - 0.02)[0][:, :3, 3] - path.sample(t)[0][:, :3, 3]

    found = path_results(log_of(scenario, late), scenario, CYCLE).results
    assert found["AT_mm"] < 0.01
    assert found["CR_mm"] < 0.01  # every corner is reached, for the path rests in it
    assert abs(found["AV_percent"]) < 0.5
    normal = np.cross(*(CYCLE.poses[[1, 2], :3, 3] - CYCLE.poses[0, :3, 3]))
    beside = 2e-4 * normal / np.linalg.norm(normal)
    found = path_results(log_of(scenario, lambda t: np.tile(beside, (len(t), 1))), scenario, CYCLE).results
    assert found["AT_mm"] == pytest.approx(0.2, rel=1e-3)
    assert found["RT_mm"] == pytest.approx(0.0, abs=1e-6)


def test_a_path_that_was_slowed_is_attained_as_well_and_its_velocity_is_not():
    poses, square = (make(BASE, CYCLE, CYCLES, 1.0) for make in (pose_scenario, path_scenario))
    offset = np.array([3e-4, 0.0, 4e-4])

    def beside(t: np.ndarray) -> np.ndarray:
        return np.tile(offset, (len(t), 1))

    found = pose_results(visits(log_of(poses, beside, 0.8), poses, CYCLE, CYCLES), CYCLE)
    assert found["AP_mm"] == pytest.approx(0.5, rel=1e-6)
    for name in ("RP_mm", "vAP_mm", "AD_mm", "RD_mm", "dAP_mm", "stabilisation_s"):
        assert found[name] == pytest.approx(0.0, abs=1e-5), name
    along = path_results(log_of(square, beside, 0.8), square, CYCLE).results
    assert along["RT_mm"] == pytest.approx(0.0, abs=0.01)
    assert along["AV_percent"] == pytest.approx(-20.0, abs=0.5)


def test_half_the_speed_takes_twice_the_time():
    fast, slow = (make_path(pose_scenario(BASE, CYCLE, 2, speed).reference) for speed in (1.0, 0.5))
    rests = 18 * CYCLE.dwell
    assert slow.dwell_start - 0.5 - rests == pytest.approx(2.0 * (fast.dwell_start - 0.5 - rests))


def test_the_page_says_the_worst_of_all_loads_and_draws_what_it_is_the_largest_of(tmp_path):
    poses, square = (make(BASE, CYCLE, CYCLES, 1.0) for make in (pose_scenario, path_scenario))
    rows = []
    for load, off in ((0.0, 1e-4), (7.0, 3e-4)):

        def above(t: np.ndarray, off: float = off) -> np.ndarray:
            return np.tile([0.0, 0.0, off], (len(t), 1))

        found = visits(log_of(poses, above), poses, CYCLE, CYCLES)
        along = path_results(log_of(square, above), square, CYCLE)
        assert 1e3 * along.off.max() == pytest.approx(along.results["AT_mm"])
        assert 1e3 * along.scatter.max() == pytest.approx(along.results["RT_mm"])
        np.testing.assert_allclose(found.error[:, 5], -off, atol=1e-12)
        rows.append(Row(load, 100.0, pose_results(found, CYCLE) | along.results, found, along))
    told = verdict(rows, "PBVS", CYCLES, 250.0)
    assert "AP of 0.300 mm" in told
    write_acceptance_page(tmp_path / "page.html", "ISO 9283", told, "nominal", rows)
    assert told in (tmp_path / "page.html").read_text()
