"""A package of a unit that cannot be imported is reported in one line with its cure, by the builder and in an FMU."""

import functools
import sys
from importlib import metadata
from pathlib import Path

import pytest
from support.fmus.workshop import Workshop

from handover.fmus.catalog import PackageFailure, UnknownBlock, import_class
from handover.fmus.import_failure import debian_package, explain_import

LIBRARY = "libof_nothing.so.7: cannot open shared object file: No such file or directory"
FAILURES = {
    "missing_module": ("import no_such_module", "needs the module no_such_module, which this Python does not have"),
    "missing_library": (f"raise ImportError({LIBRARY!r})", "needs the shared library libof_nothing.so.7"),
    "wrapped": (
        f"try:\n    raise ImportError({LIBRARY!r})\nexcept ImportError:\n    raise ImportError('No.\\nTried.')",
        "apt-get install libof-nothing7`",
    ),
    "wrong_build": (
        "raise ImportError('undefined symbol: f\\nsee below')",
        "fails: undefined symbol: f. Cure: install it anew",
    ),
    "missing_name": ("from math import no_such_name", "cannot import name 'no_such_name'"),
}


_installed = functools.cache(metadata.packages_distributions)
"""Which takes seconds."""


@pytest.fixture(autouse=True)
def of_all_installed_asked_once(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(metadata, "packages_distributions", _installed)


def broken_package(folder: Path, monkeypatch: pytest.MonkeyPatch, code: str, name: str) -> str:
    """Install a package whose import fails; return its name."""
    (folder / "site-packages" / name).mkdir(parents=True)
    (folder / "site-packages" / name / "__init__.py").write_text(code)
    monkeypatch.syspath_prepend(str(folder / "site-packages"))
    return name


@pytest.mark.parametrize("case", FAILURES)
def test_the_builder_tells_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str):
    code, reported = FAILURES[case]
    name = broken_package(tmp_path, monkeypatch, code, f"package_with_{case}")
    (tmp_path / "own_blocks.py").write_text(f"import {name}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "own_blocks", raising=False)
    with pytest.raises(PackageFailure) as failure:
        import_class("own_blocks:Block")
    text = str(failure.value)
    assert text.startswith("own_blocks:Block: ")
    assert name in text
    assert reported in text
    assert "\n" not in text
    assert text.count("Cure: ") == 1


@pytest.mark.parametrize(("module", "command"), [("nunpy", False), ("pyarrow", True)])
def test_nothing_is_to_be_installed_that_may_be_misspelled(module: str, command: bool):
    reported = explain_import(ModuleNotFoundError(f"No module named {module!r}", name=module))
    assert module in reported
    assert ("pip install" in reported) is command


def test_an_fmu_tells_it(workshop: Workshop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    host = workshop.own("scalars:Scalars", 3)
    code, reported = FAILURES["missing_library"]
    name = broken_package(tmp_path, monkeypatch, code, "package_in_an_fmu")
    unit = host.folder / "resources" / "unit.json"
    unit.write_text(unit.read_text().replace("_fmu_", f"_fmu_{name}_"))
    (host.folder / "resources" / "sources" / "support" / "sample_units" / "scalars.py").write_text(f"import {name}\n")
    assert not host.instantiate()
    for part in ("unit Scalars cannot be loaded: ", name, reported):
        assert part in host.log[-1]
    assert "Traceback" not in host.log[-1]


def test_a_module_that_a_block_itself_lacks_is_named_with_the_extra_that_brings_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pymunk", None)
    for module in ("handover.plants.ir_grasp.pymunk_edge", "handover.plants.ir_grasp.scene"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(PackageFailure, match=r'the module pymunk is needed.* "handover-cosim\[robots\]"'):
        import_class("handover.plants.ir_grasp.pymunk_edge:Space")


@pytest.mark.parametrize(
    ("code", "error", "reported"),
    [
        ("1 / 0\n", UnknownBlock, r"cannot be loaded \(own_fault\.py, line 1\): ZeroDivisionError"),
        ("\nfrom math import no_such_name\n", PackageFailure, r"own_fault\.py, line 2"),
    ],
)
def test_an_error_of_the_blocks_own_module_is_reported_with_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, error: type[Exception], reported: str
):
    (tmp_path / "own_fault.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(error, match=reported) as failure:
        import_class("own_fault:Block")
    assert type(failure.value) is error


def test_packages_are_named_by_debians_rule():
    libraries = ("libGL.so.1", "libX11.so.6", "libatomic.so.1", "libstdc++.so.6", "libgcc_s.so.1")
    assert [*map(debian_package, libraries)] == ["libgl1", "libx11-6", "libatomic1", "libstdc++6", "libgcc-s1"]
    assert explain_import(ImportError()).startswith("importing a module fails: ImportError")
