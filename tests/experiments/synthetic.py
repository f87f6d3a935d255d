"""Run logs made by hand, with errors that are known exactly."""

from collections.abc import Sequence

import numpy as np

from diagrams.record.log import GuardEvent, RunLog
from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics, robust_inverse
from robots.pose import pose_error, rotation_from_zyx

LAWS = ("open_loop", "numerical_ik", "pbvs", "position_level")
CORNERS = 1e-3 * np.array(
    [[350, 450, 400], [550, 450, 400], [550, -450, 400], [350, -450, 400], [350, 450, 400]]
)
ALPHA = np.deg2rad([180.0, 90.0, 0.0, 90.0, 180.0])
SEGMENT = 3.38  # s
DWELL = 2.0  # s


def turn(rotation_vectors: np.ndarray) -> np.ndarray:
    """exp of rotation vectors (n, 3) in rad; (n, 3, 3)."""
    angle = np.linalg.norm(rotation_vectors, axis=-1)[..., None, None]
    tilde = np.cross(np.eye(3), rotation_vectors[..., None, :])
    sinc = np.sinc(angle / np.pi)
    return np.eye(3) + sinc * tilde + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * tilde @ tilde


def rectangle(time: np.ndarray) -> np.ndarray:
    """The rectangle of Probst (2024), table 5.1, with a smooth time law; (n, 4, 4)."""
    leg = np.clip((time // SEGMENT).astype(int), 0, 3)
    s = np.clip(time / SEGMENT - leg, 0.0, 1.0)
    s = (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))[:, None]
    X = np.tile(np.eye(4), (len(time), 1, 1))
    X[:, :3, 3] = (1.0 - s) * CORNERS[leg] + s * CORNERS[leg + 1]
    alpha = (1.0 - s[:, 0]) * ALPHA[leg] + s[:, 0] * ALPHA[leg + 1]
    X[:, :3, :3] = rotation_from_zyx(np.stack([alpha, 0.0 * alpha, 0.0 * alpha + 0.5 * np.pi], -1))
    return X


def straight(time: np.ndarray, speed: float = 0.1) -> np.ndarray:
    """A straight line along x at constant speed (m/s); (n, 4, 4)."""
    X = np.tile(np.eye(4), (len(time), 1, 1))
    X[:, 0, 3] = speed * time
    return X


def displaced(X_WD: np.ndarray, e: np.ndarray) -> np.ndarray:
    """The poses whose error to X_WD is exactly e (rad, m); shapes (n, 4, 4) and (n, 6) or (6,)."""
    e = np.broadcast_to(e, (len(X_WD), 6))
    X = X_WD.copy()
    X[:, :3, :3] = np.swapaxes(turn(e[:, :3]), -1, -2) @ X_WD[:, :3, :3]
    X[:, :3, 3] -= e[:, 3:]
    return X


def make_log(
    time: np.ndarray,
    X_WE_desired: np.ndarray,
    X_WE_true: np.ndarray,
    X_WE_measured: np.ndarray | None = None,
    law: str = "pbvs",
    seed: int = 0,
    start: float = 0.0,
    q: np.ndarray | None = None,
    events: Sequence[GuardEvent] = (),
) -> RunLog:
    """A log of these poses, with a dwell of two seconds at its end."""
    zero = np.zeros((len(time), 6))
    counts: dict[str, int] = {}
    for event in events:
        counts[event.kind] = counts.get(event.kind, 0) + 1
    return RunLog(
        law=law,
        seed=seed,
        time=time,
        X_WE_desired=X_WE_desired,
        X_WE_true=X_WE_true,
        X_WE_measured=X_WE_true if X_WE_measured is None else X_WE_measured,
        joint_position=zero,
        joint_effort=zero,
        link_position=zero if q is None else q,
        position_command=zero,
        velocity_command=zero,
        correction=zero,
        guard_counts=counts,
        guard_events=list(events),
        path_start=start,
        dwell_start=float(time[-1]) - DWELL,
        path_end=float(time[-1]),
        wall_time=2.5,
    )


def follow(X_WE: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Joint positions of the IRB 1200 that reach the poses one after the other; (n, 6)."""
    kinematics = Kinematics(load_robot("irb1200"))
    q, out = guess.copy(), np.empty((len(X_WE), 6))
    for i, X_WD in enumerate(X_WE):
        for _ in range(30 if i == 0 else 2):
            X, J = kinematics.forward_and_jacobian(q)
            q = q + np.clip(robust_inverse(J) @ pose_error(X_WD, X), -0.3, 0.3)
        out[i] = q
    return out


def comparison(period: float = 0.02, cycles: int = 1, with_joints: bool = False) -> dict[str, list[RunLog]]:
    """Four laws on the rectangle, with smooth errors of the size that the scenario ``misaligned`` has."""
    settle = 1.0
    time = np.arange(0.0, settle + 4.0 * SEGMENT + DWELL + 0.5 * period, period)
    X_WD = rectangle(np.maximum(time - settle, 0.0))
    q = follow(X_WD, np.array([0.9, 0.3, 0.3, 0.1, 0.9, 0.1])) if with_joints else None
    moving = np.linalg.norm(np.gradient(X_WD[:, :3, 3], period, axis=0), axis=1)[:, None]
    size = dict(zip(LAWS, [(0.06, 0.012), (2e-3, 3e-3), (1.2e-3, 2e-3), (9e-4, 2e-3)], strict=True))  # rad, m
    logs = {}
    for number, law in enumerate(LAWS):
        shape = np.random.default_rng(number)
        frequency, phase = shape.uniform(0.5, 3.0, 6), shape.uniform(0.0, 6.0, 6)
        spread = np.repeat([size[law][0], size[law][1]], 3) * shape.uniform(0.5, 1.5, 6)
        wave = np.sin(frequency * time[:, None] + phase) * spread
        e = wave if law == "open_loop" else wave * moving + spread * np.exp(-4.0 * time[:, None])
        events = (
            []
            if law != "pbvs"
            else [
                GuardEvent(2.1, "velocity_limit", "joint 4: 8.1 rad/s held at 6.98 rad/s"),
                GuardEvent(7.4, "stale_measurement", "no valid camera sample for 52 ms, correction held"),
            ]
        )
        logs[law] = []
        for seed in range(cycles):
            noise = np.random.default_rng(100 * number + seed)
            wobble = noise.normal(0.0, 2e-6, 6)
            X_WE = displaced(X_WD, e + wobble)
            scale = np.repeat([np.deg2rad(0.01), 5e-5], 3)
            measured = displaced(X_WE, noise.normal(0.0, 1.0, (len(time), 6)) * scale)
            measured[300:303] = np.nan
            logs[law].append(make_log(time, X_WD, X_WE, measured, law, seed, settle, q, events))
    return logs
