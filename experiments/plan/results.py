"""What a plan has found, as numbers for a machine and as a motion."""

from typing import Any

import numpy as np

from experiments.plan.study import LegResult, Plan
from robots.planning.rigid_start import quickest_rigid


def plan_json(plan: Plan, results: list[LegResult]) -> dict[str, Any]:
    """The numbers: sums over the legs, the worst of criterion, iterations and seconds."""
    binding = sorted({name for each in results for name in each.planned.run.use(plan.limits).binding})
    return {
        "robot": plan.robot.name,
        "payload_kg": plan.payload,
        "path": plan.path,
        "objective": plan.objective,
        "dynamics": plan.dynamics,
        "time_s": sum(each.planned.timing.duration for each in results),
        "baseline_s": sum(each.baseline.timing.duration for each in results),
        "energy_j": sum(each.planned.run.energy(plan.recuperation) for each in results),
        "baseline_energy_j": sum(each.baseline.run.energy(plan.recuperation) for each in results),
        "criterion": max(each.planned.run.criterion for each in results),
        "baseline_criterion": max(each.baseline.run.criterion for each in results),
        "limits_kept": all(each.planned.keeps for each in results),
        "baseline_limits_kept": all(each.baseline.keeps for each in results),
        "binding": binding,
        "iterations": max(each.iterations for each in results),
        "seconds": max(each.seconds for each in results),
        "front": [[{"time_s": t, "energy_j": e} for t, e in each.front] for each in results if each.front],
        "legs": [
            {
                "name": each.leg.name,
                "inverse": each.planned.run.inverse,
                "time_s": each.planned.timing.duration,
                "baseline_s": each.baseline.timing.duration,
                "rigid_s": float(quickest_rigid(plan.robot, plan.payload, each.way, plan.limits)[0][-1]),
                "energy_j": each.planned.run.energy(plan.recuperation),
                "baseline_energy_j": each.baseline.run.energy(plan.recuperation),
                "criterion": each.planned.run.criterion,
                "baseline_criterion": each.baseline.run.criterion,
            }
            for each in results
        ],
    }


def joint_table(results: list[LegResult], period: float) -> tuple[np.ndarray, np.ndarray]:
    """All legs one after the other: times in s, shape (n,), and joint positions in rad, shape (n, 6)."""
    times, rows, begin = [], [], 0.0
    for each in results:
        duration = each.planned.timing.duration
        t = np.arange(0.0, duration, period)
        s = each.planned.timing.rates(t)[0]
        times.append(begin + t)
        rows.append(each.leg.path.at(s))
        begin += np.ceil(duration / period) * period
    times.append(np.array([begin]))
    rows.append(results[-1].leg.path.at(np.array([1.0])))
    return np.concatenate(times), np.concatenate(rows)
