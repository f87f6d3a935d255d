"""The reference in a diagram: its ports follow the path, the preview looks ahead, no work is done twice."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from systems.reference.paths import CartesianPath, ReferenceConfig
from systems.reference.reference import Reference
from systems.reference.shapes import Circle, Rectangle

QUANTITIES = ("X_WE", "V_WE", "A_WE")


def in_diagram(config: ReferenceConfig) -> tuple[Reference, Context, Context]:
    """The system, the context of the diagram around it, and its own part of that context."""
    builder = DiagramBuilder()
    reference = builder.AddSystem(Reference(config))
    root = builder.Build().CreateDefaultContext()
    return reference, root, reference.GetMyContextFromRoot(root)


def outputs(reference: Reference, context: Context, which: str) -> list[np.ndarray]:
    X_WE, V_WE, A_WE = (reference.GetOutputPort(f"{name}_{which}").Eval(context) for name in QUANTITIES)
    assert isinstance(X_WE, RigidTransform)
    return [X_WE.GetAsMatrix4(), V_WE, A_WE]


def test_the_ports_follow_the_path_and_the_preview_runs_ahead():
    reference, root, context = in_diagram(ReferenceConfig(preview=0.06))
    for time in (0.0, 0.004, 1.3, 5.0, reference.path.dwell_start - 0.03, reference.path.duration + 1.0):
        root.SetTime(time)
        for actual, expected in zip(
            outputs(reference, context, "desired"), reference.path.sample(time), strict=True
        ):
            # Ticks are computed as a batch, whose sines and cosines may round otherwise.
            np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-14)
        preview = outputs(reference, context, "preview")
        root.SetTime(time + 0.06)
        for ahead, later in zip(preview, outputs(reference, context, "desired"), strict=True):
            np.testing.assert_allclose(ahead, later, rtol=0.0, atol=1e-14)


def test_velocity_and_acceleration_add_up_in_a_simulation():
    builder = DiagramBuilder()
    reference = builder.AddSystem(Reference(ReferenceConfig(Circle())))
    logs = [
        LogVectorOutput(reference.GetOutputPort(f"{name}_desired"), builder, 0.004) for name in QUANTITIES[1:]
    ]
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(2.0)
    context = simulator.get_context()
    V, A = (log.FindLog(context).data() for log in logs)
    # The trapezoidal rule in steps of 4 ms: h^2/12 times 2 s times |d^2 A / dt^2| < 100 m/s^4.
    np.testing.assert_allclose(V[:, -1], 0.004 * (A.sum(axis=1) - 0.5 * (A[:, 0] + A[:, -1])), atol=3e-4)
    assert np.linalg.norm(V[:, -1]) > 0.2


def test_the_rotations_are_rotations():
    reference, root, context = in_diagram(ReferenceConfig())
    for time in np.linspace(0.0, reference.path.duration, 50):
        root.SetTime(time)
        R_WE = reference.GetOutputPort("X_WE_desired").Eval(context).rotation()
        np.testing.assert_allclose(R_WE.matrix() @ R_WE.matrix().T, np.eye(3), atol=1e-14)
        assert np.linalg.det(R_WE.matrix()) > 0.0


def test_ticks_are_computed_many_at_once_and_other_times_when_they_are_asked_for(monkeypatch):
    asked = []
    sample = CartesianPath.sample
    monkeypatch.setattr(CartesianPath, "sample", lambda path, time: asked.append(time) or sample(path, time))
    reference, root, context = in_diagram(ReferenceConfig(preview=0.1013))
    for tick in range(700):
        root.SetTime(0.004 * tick)
        outputs(reference, context, "desired")
        outputs(reference, context, "preview")
    assert sum(map(len, asked)) < 2 * 1000
    assert min(map(len, asked)) > 50
    asked.clear()
    root.SetTime(0.0051)
    outputs(reference, context, "desired")
    assert asked == [0.0051] * 3  # once a port


@pytest.mark.parametrize("time", [-0.3, 0.0, 0.004, 2.0001, 1.0243, 3.0 + 1.7e-3, 1e5])
def test_what_is_asked_at_one_time_is_the_path(time):
    reference, _, context = in_diagram(ReferenceConfig(preview=1.7e-3))
    moment = reference.GetOutputPort("reference").Eval(context).moment(time)
    for actual, expected in zip(moment, reference.path.sample(time), strict=True):
        np.testing.assert_allclose(actual, expected[:3] if expected.ndim == 2 else expected, atol=1e-14)


def test_another_time_after_ticks_is_as_quick(monkeypatch):
    asked = []
    sample = CartesianPath.sample
    monkeypatch.setattr(CartesianPath, "sample", lambda path, time: asked.append(time) or sample(path, time))
    reference, _, context = in_diagram(ReferenceConfig())
    path = reference.GetOutputPort("reference").Eval(context)
    asked.clear()
    delay = 0.0353
    moments = [path.moment(0.004 * tick + delay, delay) for tick in range(100)]
    assert len(asked) <= 2
    np.testing.assert_allclose(
        [moment.X_WE for moment in moments],
        reference.path.sample(0.004 * np.arange(100) + delay)[0][:, :3],
        atol=1e-14,
    )


def test_refuses_a_path_that_does_not_exist():
    with pytest.raises(ValueError, match=r"path 'rectangle' needs at least one waypoint"):
        Reference(ReferenceConfig(Rectangle([])))
