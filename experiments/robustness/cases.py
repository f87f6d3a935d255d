"""Test cases for robustness: the plain scenario, and one property of the station degraded at a time."""

from experiments.robustness.mixed import mixture
from experiments.robustness.study import Case

_LATE = ("station.drive.dead_time=0.139", "servo.model.command_delay=0.14")
# The controller goes on believing in 4 ms where a dead time is called unknown.
_AT = 6.0  # s, an event on the move, on every path
_EGM = 0.004032  # s, the period of the controller of scenario 'cell'


def _event(text: str) -> str:
    return f"station.events=[{text}]"


CASES = {
    case.name: case
    for case in (
        Case("plain"),
        Case("140ms", _LATE),
        Case(
            "egm",
            (
                "station.interface=egm",
                f"station.period={_EGM}",
                f"station.drive.command_delay={_EGM}",
                f"servo.model.command_delay={_EGM}",
                f"reference.preview={_EGM}",
            ),
        ),
        Case("unknown-100ms", ("station.drive.dead_time=0.096",)),
        Case("unknown-300ms", ("station.drive.dead_time=0.296",)),
        Case("slow-camera", (*_LATE, "station.camera.period=0.01", "station.camera.delay=0.02")),
        Case(
            "drop-outs",
            (
                "station.camera.dropouts=[[5, 5.5], [8, 8.5]]",
                "station.camera.dropout_probability=0.05",
            ),
        ),
        Case(
            "tool-displaced",
            (_event(f"!ToolShift {{at: {_AT}, shift_mm: [0.29, 0.29, 0.29]}}"),),
            recovered_at=_AT + 0.5,
        ),
        Case(
            "load-picked-up",
            (
                "station.payload=0",
                "servo.model.payload=0",
                _event(f"!PayloadChange {{at: {_AT}, payload: 7}}"),
            ),
            recovered_at=_AT + 1.5,
        ),
        # All of its 7 kg: told to nobody, to the robot's controller alone, and to truetip alone
        Case("load-not-told", ("station.drive.payload=0", "servo.model.payload=0")),
        Case("load-told-robot-only", ("servo.model.payload=0",)),
        Case("load-not-told-robot", ("station.drive.payload=0",)),
        Case(
            "camera-moved",
            (_event(f"!CameraShift {{at: {_AT}, shift_mm: [0.3, 0, 0]}}"),),
            recovered_at=_AT + 5.0,
        ),
        Case(
            "joints-shifted",
            (_event(f"!JointZeroShift {{at: {_AT}, shift_deg: [0, 0.02, 0, 0, 0.03, 0]}}"),),
            recovered_at=_AT + 5.0,
        ),
        Case(
            "dead-time-step",
            (_event(f"!DeadTimeChange {{at: {_AT}, dead_time: 0.033}}"),),
            recovered_at=_AT + 1.5,
        ),
        Case(
            "noisy-camera",  # four times what the controller is told
            ("station.camera.position_sigma=2e-4", "station.camera.orientation_sigma_deg=0.04"),
        ),
        Case("reflections", ("station.camera.outlier_probability=0.2",)),
        Case("clock-drift", ("station.camera.clock_drift_ppm=500",)),
        Case("mixed", draw=mixture),  # a robot of ten types with many of these and others at once
    )
}
