"""A station at the other end of a wire: when its camera saw what, on the clock of the path."""

import numpy as np
import pytest

from diagrams.hardware_link import EndedOnRequest, HardwareLink
from diagrams.scenario.scenario import load_scenario
from robots.description.model import load_robot
from tests.diagrams.lockstep import Lockstep


def ages(seconds: float, catches_up: bool, messages: int = 480) -> np.ndarray:
    """How old samples seem at each message (n,) in s, when the cell stands still before the hundredth."""
    scenario = load_scenario("cell")
    wire = Lockstep(scenario)
    link = HardwareLink(wire.link, wire.camera(), scenario, load_robot(scenario.robot), False, wire.now)
    link.connect(needs_camera=True)
    wire.halts = [(wire.cell.time + 100 * scenario.station.period, seconds, catches_up)]
    found = []
    for _ in range(messages):
        if link.next_report() is not None:
            sample = link.pose_at(0.0)
            found.append(-sample.time if sample.valid else np.nan)
    return np.array(found)


def test_waiting_for_the_camera_ends_on_request():
    """It may take as long as `station.link.connect` says, and nobody has moved the robot."""
    scenario = load_scenario("cell", ["station.camera.dropouts=[[0, 100]]", "station.link.connect=60"])
    wire = Lockstep(scenario)
    link = HardwareLink(
        wire.link,
        wire.camera(),
        scenario,
        load_robot(scenario.robot),
        False,
        wire.now,
        lambda: wire.cell.time > 0.5,
    )
    with pytest.raises(EndedOnRequest):
        link.connect(needs_camera=True)
    assert wire.cell.time < 0.6


@pytest.mark.slow
@pytest.mark.parametrize("catches_up", [False, True])
def test_a_clock_that_stood_still_puts_no_sample_into_the_future(catches_up: bool):
    """It would be the newest one until then, and the law blind; in a second the clock is known again."""
    found = ages(0.7, catches_up)
    assert np.nanmin(found) > -0.1
    assert np.isfinite(found[:90]).mean() > 0.9
    assert np.isfinite(found[-40:]).all()
    usual = np.nanmedian(found[:90])
    np.testing.assert_allclose(found[-40:], usual, atol=8e-3)  # a period of the camera and one of the robot
