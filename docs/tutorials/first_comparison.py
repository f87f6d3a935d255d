"""Two laws on a small circle, with a tool that is not where the controller believes it to be."""

from diagrams.scenario.scenario import load_scenario
from experiments.cli.workers import LocalProcesses
from experiments.library import compare

SETTINGS = ["reference.path=circle", "reference.acceleration=8", "reference.settle=1", "reference.dwell=1"]

if __name__ == "__main__":  # laws run in processes of their own, which import this file
    scenario = load_scenario("misaligned", SETTINGS)
    result = compare(scenario, ["open_loop", "pbvs"], executor=LocalProcesses(1))
    for law, largest in result.figure("max_norm_mm").items():
        at_rest = result.summary["runs"][law]["true"]["static_mm"]
        print(f"{law}: largest {largest:.3f} mm, at rest {max(at_rest):.3f} mm along an axis")
    print(result.verdict)
    log = result.logs["pbvs"][0]  # arrays: times, poses wanted, true and measured, joints, commands
    print(f"{len(log.time)} samples of {log.X_WE_true.shape[1:]} poses, {log.time[-1]:.1f} s")
