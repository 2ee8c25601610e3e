"""A block names what it loads late, so that a run server and an FMU can load it beforehand."""

import json
import subprocess
import sys
from collections.abc import Sequence

import pytest

from handover.fmus.catalog import UNITS

_MAKE = """
import importlib, json, os, sys
import numpy.random  # once for all
from handover.fmus.catalog import UNITS, import_class

def load(name):
    block = import_class(UNITS[name].block)
    for module in getattr(block, "deferred", ()):
        assert module not in sys.modules, f"{module} is loaded by the block's module already"
    for module in getattr(block, "deferred", ()):
        importlib.import_module(module)
    before = {*sys.modules}
    block(block.__init__.__annotations__["params"]())
    loaded = {name.partition(".")[0] for name in {*sys.modules} - before} - sys.stdlib_module_names - {"numpy"}
    return [name for name in loaded if "cython" not in name]  # which numpy.random is compiled by

for name in sys.argv[1:]:
    if os.fork():
        os.wait()
    else:
        try:
            print(json.dumps([name, load(name)]), flush=True)
        except BaseException as e:
            print(json.dumps([name, [repr(e)]]), flush=True)
        os._exit(0)
"""


def loaded_by(units: Sequence[str]) -> dict[str, list[str]]:
    """Return what constructors load besides, each in a process of its own."""
    done = subprocess.run([sys.executable, "-c", _MAKE, *units], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(map(json.loads, done.stdout.splitlines()))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="processes are forked")
def test_a_blocks_constructor_loads_nothing_but_what_it_names():
    assert loaded_by([*UNITS]) == {name: [] for name in UNITS}
