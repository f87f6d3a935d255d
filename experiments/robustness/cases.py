"""The cases in which laws are tried: one thing after another made worse."""

from experiments.robustness.study import Case

_DROPOUTS = "station.camera.dropouts=[[8, 8.5], [12, 12.5]]"
_LOSS = "station.camera.dropout_probability=0.05"

CASES = {
    case.name: case
    for case in (
        Case("plain"),
        Case("140ms", ("station.drive.dead_time=0.139", "servo.model.command_delay=0.14")),
        Case(
            "slow-camera",
            (
                "station.drive.dead_time=0.139",
                "servo.model.command_delay=0.14",
                "station.camera.period=0.012",
                "station.camera.delay=0.02",
            ),
        ),
        Case("drop-outs", (_DROPOUTS, _LOSS)),
        Case("tool-displaced", ("station.events=[!ToolShift {at: 9, shift_mm: [0.29, 0.29, 0.29]}]",)),
        Case(
            "load-picked-up",
            (
                "station.payload=0",
                "servo.model.payload=0",
                "station.events=[!PayloadChange {at: 9, payload: 7}]",
            ),
        ),
        Case("camera-moved", ("station.events=[!CameraShift {at: 9, shift_mm: [0.3, 0, 0]}]",)),
        Case("dead-time-step", ("station.events=[!DeadTimeChange {at: 9, dead_time: 0.033}]",)),
        Case("reflections", ("station.camera.outlier_probability=0.2",)),
        Case("egm", ("station.interface=egm",)),
    )
}
