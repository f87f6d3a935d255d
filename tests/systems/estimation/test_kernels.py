"""Who waits for numba: only who makes a law that needs it."""

import subprocess
import sys

_READ = "from diagrams.scenario.scenario import load_scenario; load_scenario('everything')"
_ASK = "import sys; print('numba' in sys.modules)"


def test_reading_a_scenario_does_not_import_numba():
    said = subprocess.run(
        [sys.executable, "-c", f"{_READ}; {_ASK}"], capture_output=True, text=True, check=True
    )
    assert said.stdout.strip() == "False"
