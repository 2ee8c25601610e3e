"""What only pages and statistics need is not loaded by commands that write none."""

import subprocess
import sys


def test_the_command_loads_neither_plots_nor_statistics():
    heavy = ("scipy.stats", "plotly", "networkx", "tsdownsample", "distributed", "handover.scenarios.reporting.page")
    told = f"import sys, handover.scenarios.command; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
