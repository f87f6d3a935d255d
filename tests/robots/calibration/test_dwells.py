"""Rows from a recording: only from exposures at rest, whatever clock and camera there were."""

from dataclasses import replace

import numpy as np
import pytest

from robots.calibration.dwells import DwellRule, Recording, RecordingError, dwell_measurements, rests
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics

KINEMATICS = Kinematics(load_robot("irb1200"))
PLACES = np.deg2rad([[0, 20, 10, 0, 40, 0], [15, 10, 0, 20, 30, 10], [-20, 30, 15, -10, 50, 40]])
PERIOD, MOVE = 4e-3, 1.0  # s


def motion(rest: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and joints of smooth moves between the places, with rests of so many seconds."""
    time = np.arange(0.0, 3 * rest + 2 * MOVE, PERIOD)
    ends = np.cumsum([rest, MOVE, rest, MOVE])
    shares = [np.clip((time - ends[k]) / MOVE, 0.0, 1.0) for k in (0, 2)]
    smooth = [s**3 * (10 - 15 * s + 6 * s**2) for s in shares]
    q = (
        PLACES[0]
        + smooth[0][:, None] * (PLACES[1] - PLACES[0])
        + smooth[1][:, None] * (PLACES[2] - PLACES[1])
    )
    return time, q


def recording(rest: float = 2.0, camera_period: float = 0.01, late: float = 0.0) -> Recording:
    time, q = motion(rest)
    exposed = np.arange(0.0, time[-1], camera_period)
    seen = KINEMATICS.forward(np.column_stack([np.interp(exposed, time, joint) for joint in q.T]))
    return Recording(time, q, exposed + late, seen)


def test_rests_are_where_the_robot_rests():
    """A smooth motion begins and ends so slowly that some hundredths of a second of it count as rest."""
    found = rests(*motion(2.0), 1.5)
    np.testing.assert_allclose(found, [[0.0, 2.0], [3.0, 5.0], [6.0, 8.0]], atol=0.06)
    assert not rests(*motion(1.2), 1.5)


@pytest.mark.parametrize("camera_period", [0.01, 0.24, 0.37])
@pytest.mark.parametrize("late", [0.0, 0.13])
def test_a_row_is_the_pose_at_rest_whatever_the_rate_and_the_clock_of_the_camera(
    camera_period: float, late: float
):
    given = recording(rest=3.0, camera_period=camera_period, late=late)
    table, lag = dwell_measurements(given, KINEMATICS, payload=2.0)
    assert lag == pytest.approx(late, abs=0.003 if camera_period < 0.1 else 0.06)
    np.testing.assert_allclose(table.q, PLACES, atol=1e-12)
    np.testing.assert_allclose(table.X_WE, KINEMATICS.forward(PLACES), atol=1e-9)
    assert set(table.payload) == {2.0}


def test_a_dwell_that_a_slow_camera_saw_too_seldom_gives_no_row():
    """At 0.7 s there are two exposures in the 1.5 s of rest that follow the settling of a 2 s dwell."""
    with pytest.raises(RecordingError, match="none of 3 dwells has 3 exposures"):
        dwell_measurements(recording(2.0, 0.7), KINEMATICS)


def test_a_recording_without_dwell_or_of_two_motions_is_refused():
    with pytest.raises(RecordingError, match=r"the robot nowhere rests for 1\.5 s"):
        dwell_measurements(recording(1.2), KINEMATICS)
    given = recording()
    with pytest.raises(RecordingError, match="do not show the same motion"):
        dwell_measurements(replace(given, X_WE=np.roll(given.X_WE, 250, axis=0)), KINEMATICS)
    with pytest.raises(RecordingError, match=r"have only 0\.00 s in common"):
        dwell_measurements(replace(given, exposed=given.exposed + 60.0), KINEMATICS)


def test_a_gap_in_the_record_is_no_rest():
    """While nothing was heard the robot may have moved away and come back."""
    time, q = motion(4.0)
    heard = (time < 1.0) | (time > 2.5)
    found = rests(time[heard], q[heard], 1.5)
    assert found[0] == pytest.approx((2.5, 4.0), abs=0.06)


def test_a_rule_that_measures_nothing_is_refused():
    with pytest.raises(ValueError, match=r"2 or more exposures, got 0\.5 s, 0\.0 s and 3"):
        DwellRule(mean=0.0)
