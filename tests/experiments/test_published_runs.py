"""Figures that others have printed come out of the shipped scenarios."""

import numpy as np
import pytest

from diagrams.runs.simulation import run
from diagrams.scenario.scenario import load_scenario
from experiments.metrics.run_metrics import error_metrics


@pytest.mark.slow
def test_the_open_loop_rests_where_table_6_7_of_probst_says():
    # Faster along the path and less waiting: at rest that makes no difference.
    scenario = load_scenario("probst-6-7", ["reference.settle=0.2", "reference.acceleration=4"])
    errors = error_metrics(run(scenario, "open_loop"), "true")
    np.testing.assert_allclose(errors["static_mm"], [3.15, 9.39, 10.23], atol=0.006)
    np.testing.assert_allclose(errors["static_deg"], [1.03, 7.01, 0.48], atol=0.006)
