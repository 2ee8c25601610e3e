"""A block names what it loads late, so that a run server and an FMU can load it beforehand."""

import subprocess
import sys

import pytest

from handover.fmus.catalog import UNITS

DEFERRING = (
    "TendonArm",
    "TendonArmFast",
    "AdmittanceController",
    "ArmImpedanceController",
    "ImpedanceController",
    "PoseController",
)

_MAKE = """
import importlib, sys
from handover.fmus.catalog import UNITS, import_class

entry = UNITS[sys.argv[1]]
block = import_class(entry.block)
params = block.__init__.__annotations__["params"]
for module in getattr(block, "deferred", ()):
    assert module not in sys.modules, f"{module} is loaded by the block's module already"
for module in getattr(block, "deferred", ()):
    importlib.import_module(module)
before = {*sys.modules}
block(params())
print(*{name.partition(".")[0] for name in {*sys.modules} - before} - sys.stdlib_module_names - {"numpy"})
"""


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in DEFERRING else (pytest.mark.slow,)) for n in UNITS])
def test_a_blocks_constructor_loads_nothing_but_what_it_names(name: str):
    done = subprocess.run([sys.executable, "-c", _MAKE, name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not [name for name in done.stdout.split() if "cython" not in name]  # which numpy.random is compiled by
