"""Recordings of a simulated robot: the full nonlinear plant with drives and all parts of drive trains."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput

from diagrams.integration import Integration, IntegratorConfig
from diagrams.scenario.scenario import StationConfig
from diagrams.station import Station
from experiments.cli.workers import Executor, LocalProcesses, Progress, SimulationError, in_order
from experiments.feedforward.trial import CommandPlayer, Trial, commands
from experiments.identify.cases import MotionCases
from experiments.identify.recording_map import Recording
from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.motion import SensorPlace
from robots.identification.recording import RecordedCase
from systems.cell.drive import DriveConfig
from systems.cell.inertial_sensors import InertialLoggerConfig
from systems.feedforward import FeedforwardConfig

_STEP = 1e-3  # s, of the integrator and of the robot's log
_ACCURACY = 2e-3  # relative, of one step
_WITHIN = 1e-6  # of a tick


@dataclass(frozen=True)
class CaseRun:
    """One motion under a rigid-body feedforward, which excites without damage; Reiner (2010), 4.2.2."""

    name: str
    trial: Trial
    logger: InertialLoggerConfig
    ringing: float  # s
    seed: int
    drive: DriveConfig = field(default_factory=DriveConfig)  # of the robot that moves

    def run(self, progress: Progress | None = None) -> RecordedCase:
        """Simulates it.

        Raises:
            SimulationError: if the integration breaks off.
        """
        trial = self.trial
        config = StationConfig(elasticity="structure", payload=trial.payload, drive=self.drive)
        period, ahead = config.period, config.drive.command_delay + config.drive.dead_time
        end = trial.settle + trial.profile.duration + self.ringing
        told = commands(trial, np.arange(0.0, end, period) + ahead, period)
        log = driven(self.name, trial.plant or trial.robot, config, told, self.logger, end, self.seed)
        if progress:
            progress(1.0)
        issued = np.minimum(np.floor(log.time / period + _WITHIN), len(told) - 1).astype(int)
        return RecordedCase(
            self.name,
            log.time,
            log.motor[:, :NUM_JOINTS],
            log.motor[:, NUM_JOINTS:],
            log.torque,
            log.samples[:, 0],
            log.samples[:, 1:].reshape(len(log.samples), -1, 3),
            told[issued],
        )


@dataclass(frozen=True)
class DrivenLog:
    """What is logged of a station that is told commands; n steps, m samples of the sensors."""

    time: np.ndarray  # (n,) s
    motor: np.ndarray  # (n, 12), positions in rad, then velocities
    torque: np.ndarray  # (n, 6) N m
    samples: np.ndarray  # (m, 1 + 3 sensors), stamps in s, then readings


def driven(
    name: str,
    plant: RobotModel,
    config: StationConfig,
    told: np.ndarray,
    logger: InertialLoggerConfig,
    end: float,
    seed: int,
) -> DrivenLog:
    """Simulates a station that is told commands, from rest.

    Args:
        name: of the motion, for messages.
        plant: what moves, as the drives know it, too.
        config: of the station.
        told: positions in rad, velocities in rad/s and torques in N m, one row a period, (k, 3, 6).
        logger: of the sensors.
        end: in s.
        seed: of their noise.

    Raises:
        SimulationError: if the integration breaks off.
    """
    builder = DiagramBuilder()
    station = Station(builder, plant, config, "cascade", takes_torque=True, inertial=[logger])
    player = builder.AddNamedSystem("commands", CommandPlayer(told, config.period))
    for port in ("position_command", "velocity_command", "torque_feedforward"):
        builder.Connect(player.GetOutputPort(port), station.inputs[port])
    logs = [
        LogVectorOutput(station.outputs[port], builder, step)
        for port, step in (
            ("truth.motor_state", _STEP),
            ("truth.motor_torque", _STEP),
            ("inertial_sample_1", logger.true_period),
        )
    ]
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    station.set_at_rest(context, told[0, 0], seed)
    rate = station.fastest_rate(context)
    stiff = IntegratorConfig("radau3", accuracy=_ACCURACY, max_step=_STEP)
    integration = Integration(stiff, config.period, rate)
    integration.initialize(simulator)
    # Play and friction break the estimate of the error, which then asks for ever smaller steps.
    simulator.get_mutable_integrator().set_fixed_step_mode(True)
    try:
        integration.advance(simulator, end)
    except RuntimeError as error:
        raise SimulationError(f"{name}: {' '.join(str(error).split())}") from error
    motor, torque, samples = (log.FindLog(context).data().T for log in logs)
    # What is logged of a sampled port at a tick is the sample of the tick before.
    return DrivenLog(logs[0].FindLog(context).sample_times(), motor, torque, samples[1:])


def simulated(
    robot: RobotModel,
    plant: RobotModel,
    cases: MotionCases,
    seed: int,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[RecordedCase]:
    """Records all cases.

    Args:
        robot: as the controller knows it.
        plant: what moves.
        cases: what is moved.
        seed: of the noise of the sensors.
        executor: where the motions are simulated, each of them a job; None for all cores of this machine.
        progress: is called now and then with the share that is done, 0 to 1.

    Raises:
        ValueError: if a case or a sensor is impossible.
        SimulationError: if a run broke off.
    """
    payload = robot.payload.largest_mass if cases.payload is None else cases.payload
    config = FeedforwardConfig(kind="rigid")
    runs = []
    planned = cases.planned(robot)
    for number, motion in enumerate(planned, 1):
        trial = Trial(
            robot,
            payload if motion.payload is None else motion.payload,
            motion.start,
            motion.angle,
            config,
            plant,
            settle=cases.settle,
            speeding_up=cases.speeding_up,
        )
        runs.append(CaseRun(f"{number}", trial, cases.logger, cases.ringing, 1000 * seed + number))
    found = in_order(executor or LocalProcesses(), _run, runs, progress)
    loads = [None if motion.payload == payload else motion.payload for motion in planned]
    return [replace(case, payload=load) for case, load in zip(found, loads, strict=True)]


def simulated_recording(
    robot: RobotModel,
    plant: RobotModel,
    motions: MotionCases,
    seed: int,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """What `simulated` records, with payload and places of the sensors; arguments and errors as there."""
    cases = simulated(robot, plant, motions, seed, executor, progress)
    payload = robot.payload.largest_mass if motions.payload is None else motions.payload
    return Recording(payload, cases, places(motions.logger))


def _run(job: CaseRun, progress: Progress) -> RecordedCase:
    return job.run(progress)


def places(logger: InertialLoggerConfig) -> list[SensorPlace]:
    """The sensors of a logger as their data sheets have them, without their bias."""
    return [
        SensorPlace(
            sensor.name,
            sensor.kind,
            sensor.body,
            np.array(sensor.position, dtype=float),
            sensor.rotation,
            sensor.bandwidth,
            sensor.noise_sigma,
        )
        for sensor in logger.sensors
    ]
