"""`import handover` takes next to no time, and what it exports is there, documented, and typed."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import handover

SOURCE = Path(handover.__file__ or "")

PROGRAM = """
import importlib, sys, typing
before = set(sys.modules)
import handover
assert "run" in dir(handover)
print(*sorted(set(sys.modules) - before))
"""


def test_importing_it_loads_nothing_else():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["handover"]


def test_all_that_it_exports_can_be_loaded_and_is_documented():
    assert not hasattr(handover, "rum")
    for name in handover.__all__:
        found = getattr(handover, name)
        assert inspect.getdoc(found), name
        assert found.__name__ == name


def test_type_checkers_see_what_is_loaded():
    declared: dict[str, str] = {}
    for node in ast.walk(ast.parse(SOURCE.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("handover."):
            declared |= {alias.name: node.module for alias in node.names}
    assert set(declared) == set(handover.__all__)
    for name, module in declared.items():
        assert getattr(handover, name) is getattr(sys.modules.get(module) or __import__(module, fromlist=[name]), name)


def test_importing_results_leaves_the_users_matplotlib_alone():
    program = (
        "import matplotlib; matplotlib.use('svg'); import handover; handover.Run; "
        "import handover.scenarios.runs.reporting.run_figures; import sys; "
        "print(matplotlib.get_backend(), 'matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["svg", "False"]
