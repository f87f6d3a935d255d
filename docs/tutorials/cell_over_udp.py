"""The controller over UDP against a virtual ABB cell in a process of its own, in real time."""

from diagrams.scenario.scenario import load_scenario
from experiments.metrics.run_metrics import summary
from experiments.station.guided import compare_on_station
from robots.description.model import load_robot

SETTINGS = ["reference.path=circle", "reference.acceleration=8", "reference.settle=1", "reference.dwell=1"]

if __name__ == "__main__":  # the cell is a process that imports this file
    scenario = load_scenario("cell", SETTINGS)
    robot = load_robot(scenario.robot)
    result = compare_on_station(scenario, robot, ["numerical_ik"], with_cell=True)
    numbers = summary("cell", result.logs)["runs"]["numerical_ik"]["true"]
    print(f"largest error {numbers['max_norm_mm']:.2f} mm, known to the cell alone")
    wire = result.link_json()["runs"]["numerical_ik"][0]
    print("what the wire did:", {name: wire[name] for name in list(wire)[:4]})
