"""A robot from what a laser tracker measured: positions only, half of them kept for validation."""

from pathlib import Path

import numpy as np

from experiments.library import calibrate
from robots.calibration.measurement_file import read_measurements

TABLE = Path(__file__).with_name("tracker.csv")

measurements, problems = read_measurements(TABLE)
print(f"{len(measurements)} configurations, {len(problems)} lines that cannot be right")
rows = np.arange(len(measurements))
first, fresh = measurements.select(rows < 40), measurements.select(rows >= 40)
found = calibrate("irb1200", first, fresh)
assert found.before is not None
assert found.after is not None
print(f"at configurations that it has not seen: {found.before.mean_norm_mm:.3f} mm before")
print(f"and {found.after.mean_norm_mm:.3f} mm after")
for name, value in list(zip(found.identified.names, found.identified.values, strict=True))[:5]:
    print(f"{name}: {value:.3e}")
