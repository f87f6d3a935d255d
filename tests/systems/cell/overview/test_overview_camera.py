"""Whole images in time: exposed at their instants, late by the delay, missing while lost; light and noise."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from robots.description.model import load_robot
from robots.kinematics.arm_capsules import ArmCapsules
from systems.cell.overview.overview_camera import LightConfig, OverviewCamera, OverviewConfig, recorded

CONFIG = OverviewConfig(period=0.05, delay=0.03, losses=[0.2, 0.32], light=LightConfig(noise=0.0))


class Clocked:
    """Stands for the renderer: a picture whose brightness is the turn of joint 1 in degrees."""

    def take(self, robot, people):
        x, y = robot.end[-1, :2] - robot.start[0, :2]
        return np.full((2, 3, 4, 3), round(np.rad2deg(np.arctan2(y, x))), np.uint8)


def test_images_show_the_robot_at_their_exposure_and_arrive_after_the_delay():
    camera = OverviewCamera(CONFIG, Clocked(), ArmCapsules(load_robot("irb1200")))
    simulator = Simulator(camera)
    context, port = simulator.get_mutable_context(), camera.GetOutputPort("image_sample")
    camera.GetInputPort("noise").FixValue(context, np.zeros(2))
    arrivals: dict[float, float] = {}
    for tick in range(100):
        now = 0.005 * tick
        turn = np.deg2rad(100.0 * now)
        camera.GetInputPort("motor_state").FixValue(context, [turn, 0.5, 0, 0, 0.5, 0, *np.zeros(6)])
        simulator.AdvanceTo(now + 1e-6)
        sample = port.Eval(context)
        if np.isfinite(sample.time) and sample.time not in arrivals:
            arrivals[sample.time] = now
            assert sample.images.max() == round(100.0 * sample.time)
    exposures = [0.0, 0.05, 0.1, 0.15, 0.35, 0.4, 0.45]  # from 0.2 to 0.32 s they are lost
    np.testing.assert_allclose(list(arrivals), exposures, atol=1e-9)
    np.testing.assert_allclose(list(arrivals.values()), np.add(exposures, 0.03), atol=0.006)


def test_light_and_noise_are_as_declared_and_the_key_decides_the_noise():
    light = LightConfig(noise=3.0, swing=0.05, swing_period=60.0, step=0.2, step_at=20.0)
    grey, key = np.full((2, 100, 100, 3), 100, np.uint8), np.array([0.3, -0.1])
    once, again, other = (recorded(grey, 15.0, light, k) for k in (key, key.copy(), key + 1e-9))
    np.testing.assert_array_equal(once, again)
    assert not np.array_equal(once, other)
    assert once.std() == pytest.approx(np.hypot(3.0, np.sqrt(1 / 12)), rel=0.02)
    assert once.mean() == pytest.approx(105.0, abs=0.1)
    assert recorded(grey, 60.0, light, key).mean() == pytest.approx(120.0, abs=0.1)
