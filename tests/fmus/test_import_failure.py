"""A package of a unit that cannot be imported is told in one line with its cure, by the builder and in an FMU."""

import functools
import sys
from importlib import metadata
from pathlib import Path

import pytest
from support.fmus.ctypes_host import CtypesHost
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


@pytest.fixture(params=FAILURES)
def package(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> "tuple[str, str]":
    """Return the name of an installed package whose import fails, and what is to be told."""
    code, told = FAILURES[request.param]
    name = f"package_with_{request.param}"
    (tmp_path / "site-packages" / name).mkdir(parents=True)
    (tmp_path / "site-packages" / name / "__init__.py").write_text(code)
    (tmp_path / "own_blocks.py").write_text(f"import {name}\n")
    monkeypatch.syspath_prepend(str(tmp_path / "site-packages"))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "own_blocks", raising=False)
    return name, told


def test_the_builder_tells_it(package: "tuple[str, str]"):
    name, told = package
    with pytest.raises(PackageFailure) as failure:
        import_class("own_blocks:Block")
    text = str(failure.value)
    assert text.startswith("own_blocks:Block: ")
    assert name in text
    assert told in text
    assert "\n" not in text
    assert text.count("Cure: ") == 1


@pytest.fixture
def host(workshop: Workshop) -> CtypesHost:
    """Return an instance's host, whose FMU is made before `package` changes the folders that it notes."""
    return workshop.own("scalars:Scalars", 3)


def test_an_fmu_tells_it(host: CtypesHost, package: "tuple[str, str]"):
    name, told = package
    unit = host.folder / "resources" / "unit.json"
    unit.write_text(unit.read_text().replace("_fmu_", f"_fmu_{name}_"))
    (host.folder / "resources" / "sources" / "support" / "sample_units" / "scalars.py").write_text(f"import {name}\n")
    assert not host.instantiate()
    assert "unit Scalars cannot be loaded: " in host.log[-1]
    assert name in host.log[-1]
    assert told in host.log[-1]
    assert "Traceback" not in host.log[-1]


def test_a_module_that_a_block_itself_lacks_is_named_with_the_extra_that_brings_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pymunk", None)
    for module in ("handover.plants.ir_grasp.pymunk_edge", "handover.plants.ir_grasp.scene"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    with pytest.raises(PackageFailure, match=r'the module pymunk is needed.* "handover-cosim\[robots\]"'):
        import_class("handover.plants.ir_grasp.pymunk_edge:Space")


def test_an_error_of_the_blocks_own_module_is_told_as_such(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "own_fault.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(UnknownBlock, match=r"cannot be loaded \(own_fault\.py, line 1\): ZeroDivisionError") as failure:
        import_class("own_fault:Block")
    assert not isinstance(failure.value, PackageFailure)


def test_a_name_that_no_module_has_is_told_with_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "own_name.py").write_text("\nfrom math import no_such_name\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(PackageFailure, match=r"own_name\.py, line 2"):
        import_class("own_name:Block")


@pytest.mark.parametrize(
    ("library", "package"),
    [
        ("libGL.so.1", "libgl1"),
        ("libX11.so.6", "libx11-6"),
        ("libatomic.so.1", "libatomic1"),
        ("libstdc++.so.6", "libstdc++6"),
        ("libgcc_s.so.1", "libgcc-s1"),
    ],
)
def test_packages_are_named_by_debians_rule(library: str, package: str):
    assert debian_package(library) == package


def test_an_empty_message_is_told_by_its_type():
    assert explain_import(ImportError()).startswith("importing a module fails: ImportError")
