"""What happens at ticks is left alone by the integrator between them."""

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem, System
from pydrake.systems.primitives import Integrator

from diagrams.runs.simulation import Experiment
from systems.sampled_system import SampledSystem
from tests.diagrams.rigs import scenario


@pytest.mark.parametrize(("base", "is_asked"), [(LeafSystem, True), (SampledSystem, False)])
def test_the_integrator_does_not_ask_python_for_derivatives_that_there_are_not(base, is_asked):
    asked = []

    class Ticking(base):
        def DoCalcTimeDerivatives(self, context, derivatives):  # noqa: N802
            asked.append(context.get_time())

    builder = DiagramBuilder()
    builder.AddSystem(Ticking())
    builder.AddSystem(Integrator(1))
    builder.ExportInput(builder.GetSystems()[1].get_input_port(), "rate")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    diagram.get_input_port().FixValue(simulator.get_mutable_context(), [1.0])
    simulator.AdvanceTo(0.1)
    assert bool(asked) == is_asked


def test_a_sampled_system_begins_without_ports_and_state():
    system = SampledSystem()
    assert system.num_input_ports() == system.num_output_ports() == 0
    assert system.CreateDefaultContext().num_total_states() == 0


@pytest.mark.parametrize("kind", ["vector", "abstract"])
@pytest.mark.parametrize("said", [True, False], ids=["all sources", "nothing said"])
def test_an_output_of_all_sources_depends_on_the_inputs(kind: str, said: bool):
    class Doubled(SampledSystem):
        def __init__(self):
            super().__init__()
            port = self.DeclareVectorInputPort("u", 1)
            sources = [{self.all_sources_ticket()}] if said else []

            def calc(context, output):
                (output.SetFromVector if kind == "vector" else output.set_value)(2 * port.Eval(context))

            if kind == "vector":
                self.DeclareVectorOutputPort("y", 1, calc, *sources)
            else:
                self.DeclareAbstractOutputPort("y", lambda: AbstractValue.Make(np.zeros(1)), calc, *sources)

    builder = DiagramBuilder()
    system = builder.AddSystem(Doubled())
    assert system.HasAnyDirectFeedthrough()
    builder.ExportInput(system.get_input_port())
    builder.ExportOutput(system.get_output_port())
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    for value in (1.0, 3.0):
        diagram.get_input_port().FixValue(context, [value])
        assert diagram.get_output_port().Eval(context) == 2 * value


def test_a_diagram_with_one_is_copied_to_no_other_scalar():
    """A copy would lack what is declared in Python; to make it, or to use it, crashed the process."""
    builder = DiagramBuilder()
    builder.AddSystem(SampledSystem())
    diagram = builder.Build()
    for convert in (diagram.ToAutoDiffXd, diagram.ToSymbolic):
        with pytest.raises(RuntimeError, match="does not support scalar conversion"):
            convert()


def every_system(diagram: Diagram) -> list[System]:
    return [
        each
        for own in diagram.GetSystems()
        for each in (every_system(own) if isinstance(own, Diagram) else [own])
    ]


@pytest.mark.parametrize("law", ["numerical_ik", "self_calibrating"])
def test_no_system_of_a_run_is_asked(law):
    diagram = Experiment(scenario("misaligned"), law).diagram
    own = [each for each in every_system(diagram) if type(each).__module__.startswith("systems.")]
    assert len(own) >= 5
    assert all(isinstance(each, SampledSystem) for each in own)
