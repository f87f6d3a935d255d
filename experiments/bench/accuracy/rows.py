"""What the tables are made of: commands, each a row."""

from dataclasses import dataclass

COMMAND = "robustness --laws self_calibrating --laps 2"  # what every row begins with


@dataclass(frozen=True)
class Row:
    """One command."""

    name: str  # of the file with its numbers
    options: str  # after `COMMAND`
    what: str = ""  # in words, where the options do not say it


_SOFT = "cascade.velocity=60 --set station.drive.cascade.position=15 --set station.drive.cascade.integral=5"
_HALF = "camera.position_sigma=25e-6 --set station.camera.orientation_sigma_deg=0.005"
_REALISTIC = "--scenario everything-realistic"
_DISTURBED = (
    "load-told-robot-only,egm,drop-outs,load-picked-up,tool-displaced,slow-camera,noisy-camera,"
    "unknown-300ms,dead-time-step"
)

SECTIONS: dict[str, tuple[Row, ...]] = {
    "cells": (
        Row("plain", "--cases plain --seeds 20 --first-seed 3000"),
        Row("unseen", "--cases plain --seeds 20 --first-seed 7000", "robots on which nothing was tuned"),
        Row(
            "paths",
            "--cases plain --paths circle,figure_eight --seeds 20 --first-seed 3000",
            "a circle and a figure eight for each robot",
        ),
        Row("egm", "--cases egm --seeds 20 --first-seed 3000", "period and interface of EGM"),
        Row("140ms", "--cases 140ms --seeds 20 --first-seed 3000", "dead time of 140 ms"),
        Row("100ms", "--cases unknown-100ms --seeds 8 --first-seed 3000", "one of 100 ms that nobody told"),
        Row("300ms", "--cases unknown-300ms --seeds 20 --first-seed 3000", "the same of 300 ms"),
        Row(
            "calibrated",
            "--laws self_calibrating@calibrated --cases 140ms --seeds 8 --first-seed 3000",
            "140 ms, from a calibrated robot",
        ),
        Row(
            "drop-outs",
            "--cases drop-outs --seeds 20 --first-seed 3000",
            "no image for 0.5 s twice, 5 % lost",
        ),
        Row(
            "slow-camera",
            "--cases slow-camera --seeds 20 --first-seed 3000",
            "10 ms period, 20 ms late, 140 ms dead time",
        ),
        Row(
            "noisy-camera",
            "--cases noisy-camera --seeds 5 --first-seed 3000",
            "four times as noisy as the law is told",
        ),
        Row(
            "clock-drift",
            "--cases clock-drift --seeds 2 --first-seed 3013",
            "a camera whose clock drifts by 500 ppm",
        ),
        Row(
            "load-told-robot-only",
            "--cases load-told-robot-only --seeds 8 --first-seed 3000",
            "7 kg that the robot's controller knows of and the law does not",
        ),
        Row(
            "load-not-told-robot",
            "--cases load-not-told-robot --seeds 8 --first-seed 3000",
            "7 kg that the law knows of and the robot's controller does not",
        ),
        Row("load-not-told", "--cases load-not-told --seeds 8 --first-seed 3000", "7 kg that nobody told"),
        Row(
            "soft-drives",
            f"--cases egm --seeds 4 --first-seed 3000 --set station.drive.{_SOFT}",
            "EGM before drives that give way 5.6 times as far as anybody told",
        ),
        Row(
            "soft-cascades",
            f"--cases plain --seeds 4 --first-seed 3000 --set station.drive.{_SOFT}",
            "drives that give way as far and take torques",
        ),
        Row(
            "half-noise",
            f"--cases plain --seeds 4 --first-seed 3000 --set station.{_HALF}",
            "half of the camera's noise",
        ),
        Row(
            "slow-half-noise",
            f"--cases slow-camera --seeds 4 --first-seed 3000 --set station.{_HALF}",
            "likewise, the slow camera",
        ),
    ),
    "mixtures": (
        Row(
            "mixed",
            "--cases mixed --paths circle --seeds 60 --first-seed 100",
            "ten robots, and of all that may differ a mixture that the seed draws",
        ),
        Row(
            "mixed-unseen",
            "--cases mixed --paths circle --seeds 40 --first-seed 400",
            "mixtures on which nothing was tuned",
        ),
    ),
    "robots": tuple(
        Row(name, f"--robot {name} --seeds 4 --first-seed 3000", what)
        for name, what in (
            ("kr16", ""),
            ("ur10", ""),
            ("irb140", ""),
            ("kr210", "2.7 m of reach, 210 kg"),
            ("puma560", ""),
            ("crx10ial", "nothing was tuned on this one and the next three"),
            ("crb15000", ""),
            ("mh5", ""),
            ("tx2_90", ""),
        )
    ),
    "realistic": (
        Row(
            "realistic",
            f"{_REALISTIC} --cases plain --seeds 20 --first-seed 3000",
            "backlash of 0.5', hysteresis and more",
        ),
        Row(
            "realistic-unseen",
            f"{_REALISTIC} --cases plain --seeds 10 --first-seed 7000",
            "robots on which nothing was tuned",
        ),
        Row(
            "realistic-0.1",
            f"{_REALISTIC} --set station.variation.backlash=0.2 --cases plain --seeds 20 --first-seed 3000",
            "backlash of 0.1'",
        ),
        Row(
            "realistic-not-fed-back",
            f"{_REALISTIC} --set servo.laws.self_calibrating.estimator.gear_feedback=0 --cases plain "
            "--seeds 20 --first-seed 3000",
            "nothing is fed back of teeth that are seen elsewhere",
        ),
        Row("realistic-140ms", f"{_REALISTIC} --cases 140ms --seeds 20 --first-seed 3000"),
        Row(
            "realistic-kr16",
            f"{_REALISTIC} --robot kr16-realistic --seeds 4 --first-seed 3000",
            "1.6 m of reach",
        ),
        Row(
            "realistic-disturbed",
            f"{_REALISTIC} --cases {_DISTURBED} --seeds 2 --first-seed 3000",
        ),
    ),
    "events": (
        Row(
            "tool-displaced",
            "--cases tool-displaced --seeds 8 --first-seed 3000",
            "the tool is knocked by 0.5 mm; half a second later",
        ),
        Row(
            "load-picked-up",
            "--cases load-picked-up --seeds 8 --first-seed 3000",
            "7 kg are picked up; 1.5 s later",
        ),
        Row(
            "dead-time-step",
            "--cases dead-time-step --seeds 4 --first-seed 3000",
            "the dead time grows by 30 ms; 1.5 s later",
        ),
        Row("camera-moved", "--cases camera-moved --seeds 4 --first-seed 3000", "the camera moves by 0.3 mm"),
        Row(
            "joints-shifted",
            "--cases joints-shifted --seeds 4 --first-seed 3000",
            "two joints slip against their encoders by 0.02 and 0.03 degrees",
        ),
        Row(
            "reflections",
            "--cases reflections --seeds 4 --first-seed 3000",
            "a reflection in every fifth image",
        ),
    ),
}
