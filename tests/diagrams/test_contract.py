"""The port contract: what a station and a servo are, seen from outside, and what they may not share."""

import pytest
from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, PortDataType

from diagrams.runs.simulation import Experiment
from tests.diagrams.rigs import LAWS, scenario

COMMANDS = {"position_command", "velocity_command"}
SAMPLES = {"joint_sample", "pose_sample"}
TRUTH = {f"truth.{name}" for name in ("X_WE", "state", "motor_state", "motor_torque", "exposure")}
TO_LOOK_AT = {"path_time", "X_WE_desired", "correction", "guard_status"}


def inputs(diagram: Diagram) -> set[str]:
    return {diagram.get_input_port(InputPortIndex(i)).get_name() for i in range(diagram.num_input_ports())}


def outputs(diagram: Diagram) -> set[str]:
    return {diagram.get_output_port(OutputPortIndex(i)).get_name() for i in range(diagram.num_output_ports())}


@pytest.fixture(scope="module", params=["open_loop", *LAWS])
def experiment(request) -> Experiment:
    return Experiment(scenario("misaligned"), request.param)


def test_a_simulated_station_has_the_ports_of_a_real_one_and_the_truth_beside_them(experiment: Experiment):
    assert inputs(experiment.station) == COMMANDS
    assert outputs(experiment.station) == SAMPLES | TRUTH


def test_a_servo_is_the_mirror_image_and_shows_what_one_wants_to_plot(experiment: Experiment):
    assert inputs(experiment.servo) == outputs(experiment.station) - TRUTH
    assert outputs(experiment.servo) == inputs(experiment.station) | TO_LOOK_AT


def test_commands_are_six_numbers_on_both_sides(experiment: Experiment):
    for name in COMMANDS:
        port = experiment.servo.GetOutputPort(name)
        other = experiment.station.GetInputPort(name)
        assert (port.get_data_type(), port.size()) == (PortDataType.kVectorValued, 6)
        assert (other.get_data_type(), other.size()) == (PortDataType.kVectorValued, 6)


def test_nothing_of_the_truth_leads_to_the_servo(experiment: Experiment):
    """Every wire into the servo comes from a port of the contract, and every such port has a wire."""
    fed = {
        experiment.servo.get_input_port(sink[1]).get_name(): (
            source[0],
            source[0].get_output_port(source[1]).get_name(),
        )
        for sink, source in experiment.diagram.connection_map().items()
        if sink[0] is experiment.servo
    }
    assert {name: port for name, (_, port) in fed.items()} == {name: name for name in SAMPLES}
    assert all(system is experiment.station for system, _ in fed.values())


def test_the_station_is_fed_by_the_servo_alone(experiment: Experiment):
    sources = [
        source[0]
        for sink, source in experiment.diagram.connection_map().items()
        if sink[0] is experiment.station
    ]
    assert len(sources) == len(COMMANDS)
    assert all(system is experiment.servo for system in sources)
