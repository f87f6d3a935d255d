"""The test cycle of ISO 9283: five poses in a cube, visited again and again, and a square through four."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from diagrams.record.log import RunLog
from diagrams.scenario.scenario import Scenario
from experiments.metrics.iso9283 import path_distance, repeatability
from robots.pose import pose_error, zyx_from_rotation
from systems.reference.paths import CartesianPath, make_path
from systems.reference.shapes.points import Points, Rectangle, Waypoint

ORDER = (0, 1, 2, 3, 4, 0, 1, 0, 3, 0)  # poses of a cycle; P1 is reached from P5, P2 and P4
_INSIDE = 0.8  # P2 to P5 are a tenth of the diagonal within the corners of the cube
_ATTAINED = 0.1  # s, over which an attained pose is the mean
_AFTER_CORNER = 0.3  # s, in which the path overshoots
_MIDDLE = 0.15  # of an edge, on both sides of its middle, over which its velocity is a mean


@dataclass(frozen=True)
class Cycle:
    """Where the five poses are, and how the cycle is run."""

    poses: np.ndarray  # X_WE of P1 to P5, (5, 4, 4)
    dwell: float  # s, at rest at every pose
    band: float  # m, within which a pose counts as stable


def cube_poses(scenario: Scenario, edge: float) -> np.ndarray:
    """P1 to P5 of a cube about the middle of the scenario's path, (5, 4, 4), the tool as half way along it.

    The plane is that of the corners C1, C2, C7 and C8: it is inclined by 45 degrees.
    """
    path = make_path(scenario.reference)
    X = path.sample(np.linspace(path.path_start, path.dwell_start, 401))[0]
    middle = 0.5 * (X[:, :3, 3].min(axis=0) + X[:, :3, 3].max(axis=0))
    half = 0.5 * edge * _INSIDE
    corners = half * np.array([[0, 0, 0], [1, 1, 1], [-1, 1, -1], [-1, -1, -1], [1, -1, 1]])
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, :3] = X[200, :3, :3]
    poses[:, :3, 3] = middle + corners
    return poses


def pose_scenario(scenario: Scenario, cycle: Cycle, cycles: int, speed: float) -> Scenario:
    """The scenario that visits the poses; a move takes 1/speed of the time that it has at full speed."""
    points = Points([_waypoint(cycle.poses[i]) for i in ORDER])
    return _with_path(scenario, points, cycle, cycles, speed)


def path_scenario(scenario: Scenario, cycle: Cycle, cycles: int, speed: float) -> Scenario:
    """The scenario that runs the square P2, P3, P4, P5 through its corners."""
    square = Rectangle([_waypoint(cycle.poses[i]) for i in (1, 2, 3, 4, 1)])
    return _with_path(scenario, square, cycle, cycles, speed)


def _with_path(
    scenario: Scenario, path: Points | Rectangle, cycle: Cycle, cycles: int, speed: float
) -> Scenario:
    acceleration = speed**2 * scenario.reference.acceleration
    reference = replace(
        scenario.reference, path=path, dwell=cycle.dwell, laps=cycles, acceleration=acceleration
    )
    return replace(scenario, reference=reference)


def _waypoint(X: np.ndarray) -> Waypoint:
    return Waypoint(1e3 * X[:3, 3], np.rad2deg(zyx_from_rotation(X[:3, :3])))


@dataclass(frozen=True)
class Visits:
    """What was attained at each visit to a pose, n of them."""

    pose: np.ndarray  # (n,), 0 for P1
    before: np.ndarray  # (n,), the pose that it came from
    position: np.ndarray  # (n, 3), of the tip in the world, m
    error: np.ndarray  # (n, 6), wanted less attained: rotation vector in rad, then position in m
    stable: np.ndarray  # (n,), s from the end of the command until the tip stays within the band
    overshoot: np.ndarray  # (n,), m beyond the attained position after it came into the band

    def of_pair(self, pose: int, before: int) -> np.ndarray:
        """Attained positions of those visits to a pose that began at another, (k, 3)."""
        return self.position[self.pair(pose, before)]

    def pair(self, pose: int, before: int) -> np.ndarray:
        """Which visits to a pose began at another, (n,) bool."""
        return (self.pose == pose) & (self.before == before)


def visits(log: RunLog, scenario: Scenario, cycle: Cycle, cycles: int) -> Visits:
    """What a run of `pose_scenario` attained.

    Args:
        log: of the run.
        scenario: of that run.
        cycle: its poses.
        cycles: how often they were visited, at least 2.
    """
    moves = len(ORDER) - 1
    settle, on_path = scenario.reference.settle, _on_path(log)
    span = (make_path(scenario.reference).dwell_start - settle) / (moves * cycles)  # of a rest and a move
    reached = [
        (ORDER[k % moves + 1], ORDER[k % moves], settle + (k + 1) * span) for k in range(moves * cycles)
    ]
    attained, error, stable, overshoot = [], [], [], []
    for pose, _, arrival in reached:
        rest = (on_path >= arrival - 1e-9) & (on_path < arrival + cycle.dwell - 1e-9)
        end = rest & (on_path >= arrival + cycle.dwell - _ATTAINED)
        e = pose_error(np.broadcast_to(cycle.poses[pose], (int(end.sum()), 4, 4)), log.X_WE_true[end])
        mean = log.X_WE_true[end, :3, 3].mean(axis=0)
        away = np.linalg.norm(log.X_WE_true[rest, :3, 3] - mean, axis=1)
        since = log.time[rest] - log.time[rest][0] + on_path[rest][0] - arrival
        seconds, beyond = _settled(away, since, cycle.band)
        attained.append(mean)
        error.append(e.mean(axis=0))
        stable.append(seconds)
        overshoot.append(beyond)
    pose, before, _ = zip(*reached, strict=True)
    arrays = (np.array(each) for each in (pose, before, attained, error, stable, overshoot))
    return Visits(*arrays)


def pose_results(found: Visits, cycle: Cycle) -> dict[str, float | None]:
    """AP, RP, vAP, distances, drift, stabilisation and overshoot, in mm, degrees and s; None for none.

    Accuracy, repeatability and drift are those of visits from one side, each pose from the one before it, as
    the standard has them (ISO 9283:1998, 7.2): what another side changes is vAP.
    """
    e = found.error
    at = [found.pair(k, (k - 1) % 5) for k in range(5)]
    accuracy = [float(np.linalg.norm(e[here, 3:].mean(axis=0))) for here in at]
    attained = [found.position[here] for here in at]
    middles = [found.of_pair(0, before).mean(axis=0) for before in (4, 1, 3)]
    apart = [float(np.linalg.norm(a - b)) for a in middles for b in middles]
    # P2 to P4 in the first half of each cycle; P1 to P2 comes again in the second.
    second = found.of_pair(3, 2)
    count = len(second)
    lengths = np.linalg.norm(found.of_pair(1, 0)[::2] - second, axis=1)
    wanted = float(np.linalg.norm(cycle.poses[1, :3, 3] - cycle.poses[3, :3, 3]))
    quarter = max(1, len(attained[0]) // 4)
    stable = float(found.stable.max())
    drift = attained[0][-quarter:].mean(axis=0) - attained[0][:quarter].mean(axis=0)
    return {
        "AP_mm": 1e3 * max(accuracy),
        "RP_mm": 1e3 * max(float(repeatability(x)) for x in attained if len(x) > 1),
        "AP_deg": float(np.rad2deg(max(np.linalg.norm(e[here, :3].mean(axis=0)) for here in at))),
        "vAP_mm": 1e3 * max(apart),
        "AD_mm": 1e3 * float(lengths.mean() - wanted),
        "RD_mm": 1e3 * 3.0 * float(lengths.std(ddof=1)) if count > 1 else None,
        "dAP_mm": 1e3 * float(np.linalg.norm(drift)),
        "stabilisation_s": stable if np.isfinite(stable) else None,
        "overshoot_mm": 1e3 * float(found.overshoot.max()),
    }


@dataclass(frozen=True)
class Square:
    """How the square was run: its results, and the distances that the largest are of."""

    results: dict[str, float]  # AT, RT, CR, CO in mm, AT in degrees, AV and RV in percent
    edge: np.ndarray  # (n,), 0 at P2, 1 at P3 and so on up to 4, by the time of the path
    off: np.ndarray  # (n,), m, of the mean of the cycles from the path
    scatter: np.ndarray  # (n,), m, repeatability there, across the path


def path_results(log: RunLog, scenario: Scenario, cycle: Cycle) -> Square:
    """AT and RT with orientation, corner deviation and velocity of a run of `path_scenario`."""
    path = make_path(scenario.reference)
    lap, on_path = float(path.lap_starts[1] - path.lap_starts[0]), _on_path(log)
    since = np.arange(0.0, lap, scenario.station.period)
    wanted = path.sample(path.lap_starts[0] + since)[0]
    # Laps may begin between two ticks: errors vary less between these than positions do.
    off = log.X_WE_true[:, :3, 3] - log.X_WE_desired[:, :3, 3]
    p = wanted[:, :3, 3] + np.stack([_at(on_path, off, start + since) for start in path.lap_starts])
    nearest = np.clip(np.searchsorted(on_path, path.lap_starts[:, None] + since), 0, len(log.time) - 1)
    angles = pose_error(wanted, log.X_WE_true[nearest])[..., :3].mean(axis=0)
    mean = p.mean(axis=0)
    # Some time before and after, for the tip is late.
    around = path.sample(path.lap_starts[0] + np.arange(-0.5, lap + 0.5, scenario.station.period))[0]
    placed, across = _by_place(path, cycle, on_path, off, since)
    distances = path_distance(
        since, placed.mean(axis=0), np.arange(-0.5, lap + 0.5, scenario.station.period), around[:, :3, 3]
    )
    # Where the path was slowed, its time and that of the clock are two.
    clock = np.interp(path.lap_starts[:, None] + since, on_path, log.time)
    commanded = _velocities(since, wanted[:, :3, 3], cycle)
    ratio = np.array([np.mean(_velocities(*each, cycle) / commanded) for each in zip(clock, p, strict=True)])
    rounding, over = _corners(mean, since, cycle, lap)
    scatter = repeatability(across)
    results = {
        "AT_mm": 1e3 * float(distances.max()),
        "RT_mm": 1e3 * float(scatter.max()),
        "AT_deg": float(np.rad2deg(np.linalg.norm(angles, axis=1).max())),
        "CR_mm": 1e3 * rounding,
        "CO_mm": 1e3 * over,
        "AV_percent": 100.0 * float(ratio.mean() - 1.0),
        "RV_percent": 300.0 * float(ratio.std(ddof=1)),
    }
    return Square(results, 4.0 * since / lap, distances, scatter)


def _by_place(
    path: CartesianPath, cycle: Cycle, on_path: np.ndarray, off: np.ndarray, since: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the cycles pass the places of the square, in m, and what of that is across it, (cycles, n, 3).

    Being late is no error of a path, and cycles that are late by more or less do not scatter: the standard
    compares them in planes across the path (ISO 9283:1998, 8.2 and 8.3). Each edge of a cycle is taken as
    much later as the tip comes later to its middle; the first cycle begins at rest, and others do not.
    """
    edge = float(path.lap_starts[1] - path.lap_starts[0]) / 4.0
    which = np.minimum((since / edge).astype(int), 3)
    corners = cycle.poses[[1, 2, 3, 4, 1], :3, 3]
    along = np.diff(corners, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # Into the next edge, on which a late tip comes to the end: along this one nothing moves there.
    times = np.arange(0.0, 2.0 * edge, float(since[1] - since[0]))

    def at(when: np.ndarray) -> np.ndarray:
        return path.sample(when)[0][:, :3, 3] + _at(on_path, off, when)

    placed = []
    for start in path.lap_starts:
        late = np.zeros(4)
        for k in range(4):
            gone = (at(start + k * edge + times) - 0.5 * (corners[k] + corners[k + 1])) @ along[k]
            after = int(np.argmax(gone >= 0.0))
            if after:
                share = gone[after - 1] / (gone[after - 1] - gone[after])
                late[k] = times[after - 1] + share * (times[1] - times[0]) - 0.5 * edge
        placed.append(at(start + since + late[which]))
    placed = np.stack(placed)
    beyond = np.einsum("cni,ni->cn", placed - corners[which], along[which])
    return placed, placed - beyond[..., None] * along[which]


def _on_path(log: RunLog) -> np.ndarray:
    """The time on the path in s at the times of a log, (n,)."""
    return log.time if log.path_time is None else log.path_time


def _settled(away: np.ndarray, since: np.ndarray, band: float) -> tuple[float, float]:
    """When a tip stays within a band, in s from the end of the command, and by how much it overshoots.

    The time is infinite where it is still outside when the next motion begins. Overshoot is how far it goes
    where it leaves the band again, and zero where it does not (ISO 9283).
    """
    outside = np.flatnonzero(away > band)
    last = int(outside[-1]) + 1 if len(outside) else 0
    seconds = (float(since[last]) if last < len(since) else np.inf) if last else 0.0
    inside = np.flatnonzero(away <= band)
    beyond = float(away[inside[0] :].max()) if len(inside) else float(away.max())
    return seconds, beyond if beyond > band else 0.0


def _at(time: np.ndarray, p: np.ndarray, when: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(when, time, p[:, k]) for k in range(3)], -1)


def _corners(p: np.ndarray, since: np.ndarray, cycle: Cycle, lap: float) -> tuple[float, float]:
    """The largest rounding of the corners P3, P4 and P5, and the largest overshoot behind them, in m.

    A tip that is late and has not come to the corner yet does not overshoot (ISO 9283).
    """
    corners = cycle.poses[[1, 2, 3, 4, 1], :3, 3]
    rounding, over = [], []
    for k in (1, 2, 3):
        corner, after = corners[k], corners[k + 1]
        time = k * lap / 4.0
        near = np.abs(since - time) < 0.5
        rounding.append(float(np.linalg.norm(p[near] - corner, axis=1).min()))
        late = (since >= time) & (since < time + _AFTER_CORNER)
        along = (after - corner) / np.linalg.norm(after - corner)
        off = p[late] - corner
        off = off[off @ (corner - corners[k - 1]) >= 0.0]
        beside = np.linalg.norm(off - np.outer(off @ along, along), axis=1)
        over.append(float(beside.max(initial=0.0)))
    return max(rounding), max(over)


def _velocities(time: np.ndarray, p: np.ndarray, cycle: Cycle) -> np.ndarray:
    """The mean velocity in m/s over the middle of each edge, (4,), of positions p (n, 3) at times in s, (n,).

    By place and not by time: a tip that is late is as fast. It is the slope of a line through the samples,
    for differences of neighbours, and the largest of them above all, are mostly the camera's noise.
    """
    found, edge = [], len(p) / 4.0
    for k, (begin, end) in enumerate(pairwise(cycle.poses[[1, 2, 3, 4, 1], :3, 3])):
        # With the next edge, on which a late tip comes to the end: along this one nothing moves there.
        during = slice(round(k * edge), round((k + 2) * edge))
        length = float(np.linalg.norm(end - begin))
        along = (p[during] - begin) @ (end - begin) / length
        off = np.abs(along - 0.5 * (along.min() + along.max()))
        middle = np.argsort(off)[: max(3, int(np.sum(off < _MIDDLE * length)))]
        t = time[during][middle]
        found.append(np.polyfit(t - t.mean(), along[middle], 1)[0])
    return np.array(found)
