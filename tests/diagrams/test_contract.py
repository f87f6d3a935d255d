"""The port contract: what a station and a servo are, seen from outside, and what they may not share."""

from typing import SupportsIndex

import numpy as np
import pytest
from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, PortDataType, System

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


def station(experiment: Experiment) -> Diagram:
    assert isinstance(experiment.station, Diagram)
    return experiment.station


def servo(experiment: Experiment) -> Diagram:
    assert isinstance(experiment.servo, Diagram)
    return experiment.servo


@pytest.fixture(scope="module", params=["open_loop", *LAWS])
def experiment(request) -> Experiment:
    return Experiment(scenario("misaligned"), request.param, is_nested=True)


def test_a_simulated_station_has_the_ports_of_a_real_one_and_the_truth_beside_them(experiment: Experiment):
    assert inputs(station(experiment)) == COMMANDS
    assert outputs(station(experiment)) == SAMPLES | TRUTH


def test_a_servo_is_the_mirror_image_and_shows_what_one_wants_to_plot(experiment: Experiment):
    assert inputs(servo(experiment)) == outputs(station(experiment)) - TRUTH
    assert outputs(servo(experiment)) == inputs(station(experiment)) | TO_LOOK_AT


def test_commands_are_six_numbers_on_both_sides(experiment: Experiment):
    for name in COMMANDS:
        port = servo(experiment).GetOutputPort(name)
        other = station(experiment).GetInputPort(name)
        assert (port.get_data_type(), port.size()) == (PortDataType.kVectorValued, 6)
        assert (other.get_data_type(), other.size()) == (PortDataType.kVectorValued, 6)


def test_nothing_of_the_truth_leads_to_the_servo(experiment: Experiment):
    """Every wire into the servo comes from a port of the contract, and every such port has a wire."""
    fed = {
        servo(experiment).get_input_port(sink[1]).get_name(): (
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


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_run_is_the_same_with_station_and_servo_in_diagrams_of_their_own_and_without(law: str):
    """To the last bit: what is wired is the same, the integrator only reaches it sooner."""
    own, flat = (Experiment(scenario("misaligned"), law, is_nested=is_nested) for is_nested in (True, False))
    assert own.station.inputs.keys() == flat.station.inputs.keys()
    assert own.station.outputs.keys() == flat.station.outputs.keys()
    for each in (own, flat):
        each.advance(0.4)
    for name in ("X_WE_true", "position_command", "joint_effort", "X_WE_measured"):
        np.testing.assert_array_equal(getattr(own.log(), name), getattr(flat.log(), name))


def test_between_the_parts_of_a_station_no_truth_leads_to_the_servo_either():
    experiment = Experiment(scenario("misaligned"), "pbvs")
    flat = experiment.servo
    parts = {id(system) for system in (flat.reference, flat.law, flat.guard)}
    taken = [port for ports in flat.inputs.values() for port in ports]
    given = [experiment.station.outputs[name] for name in SAMPLES]
    wires = experiment.diagram.connection_map().items()
    fed = [wire for wire in wires if id(wire[0][0]) in parts and id(wire[1][0]) not in parts]
    assert {place(*sink) for sink, _ in fed} == {place(port.get_system(), port.get_index()) for port in taken}
    assert {place(*source) for _, source in fed} == {
        place(port.get_system(), port.get_index()) for port in given
    }


def place(system: System, index: SupportsIndex) -> tuple[int, int]:
    return id(system), int(index)
