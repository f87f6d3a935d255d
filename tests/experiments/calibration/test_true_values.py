"""What a simulated robot has in place of identified values: errors of its encoders and gears, too."""

import numpy as np

from diagrams.scenario.scenario import load_scenario
from experiments.calibration.calibrate import true_values
from robots.calibration.identification import IdentificationConfig, identify
from robots.calibration.identified import Identified
from robots.calibration.measurements import MeasurementNoise, Measurements
from robots.description.model import load_robot
from robots.kinematics.error_kinematics import ErrorKinematics
from robots.kinematics.forward import Kinematics

COUNT = 120


def identified_from(q: np.ndarray, links: np.ndarray, scenario, *kinds: str) -> Identified:
    """From true poses of a scenario's robot whose links stand at ``links`` where its encoders say q."""
    robot = load_robot(scenario.robot)
    true = ErrorKinematics(robot).robot_with_errors(scenario.station.errors.vector(robot))
    X = Kinematics(true).forward(links)
    config = IdentificationConfig(joint_errors=kinds, noise=MeasurementNoise(0.0, 1e-9, 1e-9))
    return identify(robot, Measurements(q, X[:, :3, 3], X[:, :3, :3]), config)


def configurations(scenario) -> np.ndarray:
    robot = load_robot(scenario.robot)
    return np.random.default_rng(0).uniform(0.9 * robot.lower, 0.9 * robot.upper, (COUNT, 6))


def test_scales_of_encoders_and_coupled_wrists_are_found_as_the_station_has_them():
    errors = ["station.encoder.scale_ppm=[500,-300,400,-200,600,300]"]
    errors += ["station.encoder.coupling_ppm=[800,-500,700]", "station.elasticity=rigid"]
    scenario = load_scenario("misaligned", errors)
    q = configurations(scenario)
    links = q * (1.0 + 1e-6 * scenario.station.encoder.scale_ppm)
    links[:, 4] += 800e-6 * q[:, 3]
    links[:, 5] += -500e-6 * q[:, 3] + 700e-6 * q[:, 4]
    found = identified_from(q, links, scenario, "scale", "coupling")
    truth = true_values(scenario, load_robot(scenario.robot), found)
    np.testing.assert_allclose(found.values, truth, atol=1e-9)
    by_name = dict(zip(found.names, found.values, strict=True))
    assert abs(by_name["scale_5"] - 600e-6) < 1e-9
    assert abs(by_name["coupling_46"] + 500e-6) < 1e-9


def test_the_ripple_of_strain_wave_gears_is_found_as_the_robot_file_has_it():
    """Twice per turn of the motor, 20 urad; their second order is a hundredth of that."""
    scenario = load_scenario("misaligned", ["robot=kr16-realistic", "station.payload=0"])
    robot, q = load_robot(scenario.robot), configurations(load_scenario("misaligned", ["robot=kr16"]))
    parts = [joint.drive_train.ratio_error for joint in robot.joints]
    size, phase = np.array([[p.amplitudes[0], np.deg2rad(p.phases_deg[0])] for p in parts if p]).T
    found = identified_from(q, q + size * np.sin(2.0 * robot.gear_ratio * q + phase), scenario, "strain_wave")
    by_name = dict(zip(found.names, found.values, strict=True))
    for joint in range(6):
        assert abs(by_name[f"wave_sine_{joint + 1}"] - size[joint] * np.cos(phase[joint])) < 3e-7
        assert abs(by_name[f"wave_cosine_{joint + 1}"] - size[joint] * np.sin(phase[joint])) < 3e-7
    np.testing.assert_allclose(found.values, true_values(scenario, robot, found), atol=1e-6)
