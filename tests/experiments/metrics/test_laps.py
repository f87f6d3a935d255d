"""The error of each lap on its own."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.metrics.laps import lap_metrics
from experiments.metrics.run_metrics import pose_errors
from tests.experiments.synthetic import displaced, make_log, straight


def test_each_lap_has_its_own_largest_error_and_the_dwell_belongs_to_none():
    time = np.arange(0.0, 4.0, 0.004)
    wanted = straight(time)
    millimetres = np.select([time < 1.0, time < 2.0, time < 3.0], [1.0, 2.0, 0.5], 9.0)
    e = np.zeros((len(time), 6))
    e[:, 3], e[:, 2] = 1e-3 * millimetres, np.deg2rad(0.1 * millimetres)
    log = make_log(time, wanted, displaced(wanted, e))
    log = replace(log, path_start=1.0, dwell_start=3.0, path_end=4.0, lap_starts=(1.0, 2.0))
    laps = lap_metrics(log, pose_errors(log, "true"))
    assert [lap["max_norm_mm"] for lap in laps] == pytest.approx([2.0, 0.5])
    assert [lap["max_angle_deg"] for lap in laps] == pytest.approx([0.2, 0.05])
    assert [lap["rms_mm"] for lap in laps] == pytest.approx([2.0, 0.5])


def test_a_lap_on_which_the_path_was_run_at_half_its_speed_took_twice_the_planned_time():
    time = np.arange(0.0, 4.0, 0.004)
    wanted = straight(time)
    log = make_log(time, wanted, displaced(wanted, np.zeros((len(time), 6))))
    path_time = np.interp(time, [0.0, 1.0, 2.0, 4.0], [0.0, 1.0, 1.5, 3.5])
    log = replace(log, path_start=1.0, dwell_start=3.0, path_end=4.0, lap_starts=(1.0, 2.0))
    laps = lap_metrics(replace(log, path_time=path_time), pose_errors(log, "true"))
    assert [lap["duration_s"] for lap in laps] == pytest.approx([1.0, 1.0])
    assert [lap["times_planned"] for lap in laps] == pytest.approx([2.0, 1.0])
    laps = lap_metrics(log, pose_errors(log, "true"))
    assert [lap["times_planned"] for lap in laps] == pytest.approx([1.0, 1.0])
