"""Nothing in the product makes or reads pickles, or anything else that runs code as it is read."""

import ast
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1]
FOLDERS = ("cosim", "plants", "controllers", "fmus", "scenarios")
FORBIDDEN = {"pickle", "cPickle", "_pickle", "cloudpickle", "dill", "marshal", "shelve", "copyreg", "joblib"}


def modules_in(source: str) -> set[str]:
    """Return the top-level modules that a source imports, and the names after which it looks one up.

    Of a source in which no forbidden one is as much as mentioned, none.
    """
    if not any(name in source for name in FORBIDDEN):
        return set()
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add((node.module or "").partition(".")[0])
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(node.value)
        elif isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            found.add("pickle")
    return found


def test_it_is_found_wherever_it_is_imported():
    imports = "import pickle", "def f():\n    from pickle import loads", "import_module('marshal')", "import dill.x"
    for source in (*imports, "np.load(f, allow_pickle=True)"):
        assert modules_in(source) & FORBIDDEN
    assert not modules_in("import json, msgpack") & FORBIDDEN


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_source_imports_it(folder: str):
    sources = [*(HOUSE / folder).rglob("*.py")]
    assert len(sources) > 10
    guilty = {str(s.relative_to(HOUSE)): modules_in(s.read_text("utf-8")) & FORBIDDEN for s in sources}
    assert {source: names for source, names in guilty.items() if names} == {}
