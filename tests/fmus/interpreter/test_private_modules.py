"""Units in one process do not see each other's modules, nor does the host see theirs."""

import importlib
import json
import math
import os
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest
from support.fmus.ctypes_host import OK, CtypesHost
from support.fmus.workshop import Workshop
from support.fmus.written_blocks import write_block

from handover.fmus import loader
from handover.fmus.build import build_block


@pytest.fixture
def hosts() -> Iterator[list[CtypesHost]]:
    made: list[CtypesHost] = []
    yield made
    for host in made:
        host.close()


def build_in(folder: Path, answer: str) -> Path:
    """Build an FMU from a folder whose modules have the same names as those of other folders."""
    block = write_block(folder, "same_name", answer)
    sys.path.insert(0, str(folder))
    for name in ("same_name", "shared_helper"):
        sys.modules.pop(name, None)
    importlib.invalidate_caches()
    try:
        return build_block(block, 3, folder)
    finally:
        sys.path.remove(str(folder))
        sys.modules.pop("same_name", None)


def test_units_with_modules_of_the_same_name_run_their_own_code(tmp_path: Path, hosts: list[CtypesHost]):
    hosts += [CtypesHost(build_in(tmp_path / f"version{i}", str(float(i))), 3) for i in (1, 2)]
    path_before, modules_before = list(sys.path), set(sys.modules)
    for host in hosts:
        assert host.instantiate(), host.log
        assert host.initialise() == OK
    assert [host.get("y") for host in hosts] == [[1.0], [2.0]]
    assert sys.path == path_before
    assert all(name.startswith("_fmu_") for name in set(sys.modules) - modules_before)


def test_a_step_that_imports_does_not_ask_the_disk_again(
    tmp_path: Path, hosts: list[CtypesHost], monkeypatch: pytest.MonkeyPatch
):
    host = CtypesHost(build_in(tmp_path / "imports_in_steps", "__import__('math').pi"), 3)
    hosts.append(host)
    assert host.instantiate()
    assert host.initialise() == OK
    assert host.step(0.0, 0.5) == OK
    asked: list[str] = []
    exists = os.path.exists

    def counted(path: str) -> bool:
        asked.append(path)
        return exists(path)

    monkeypatch.setattr(os.path, "exists", counted)
    assert [host.step(0.5, 0.5), host.get("y")] == [OK, [math.pi]]
    assert asked == []


def test_a_second_instance_finds_its_modules_though_the_first_ones_folder_is_gone(
    tmp_path: Path, hosts: list[CtypesHost]
):
    fmu = build_in(tmp_path / "unpacked_twice", "[][0]")  # fails where its helper is imported, in the first outputs
    first = CtypesHost(fmu, 3)
    assert first.instantiate()
    first.close()
    hosts.append(CtypesHost(fmu, 3))
    assert hosts[0].instantiate()
    assert hosts[0].initialise() != OK
    assert "return [][0]" in hosts[0].log[-1]


@pytest.mark.machine
def test_missing_packages_are_named_with_version_interpreter_and_cure(workshop: Workshop):
    host = workshop.own("scalars:Scalars", 3)
    file = host.folder / "resources" / "unit.json"
    unit = json.loads(file.read_text())
    unit["packages"].append({"module": "no_such_module", "distribution": "no-such-package", "version": "4.5.6"})
    file.write_text(json.dumps(unit))
    assert not host.instantiate()
    for part in ("no-such-package (built with version 4.5.6)", sys.executable, "pip install no-such-package==4.5.6"):
        assert part in host.log[-1]


@pytest.mark.parametrize(("change", "warned"), [(1, True), (0, False), (-1, False)])
def test_a_package_older_than_that_of_the_build_is_a_warning(workshop: Workshop, change: int, warned: bool):
    host = workshop.own("scalars:Scalars", 3)
    host.log.clear()
    here = metadata.version("numpy")
    major, minor = (int(n) for n in here.split(".")[:2])
    built = f"{major}.{minor + change}.99"
    file = host.folder / "resources" / "unit.json"
    unit = json.loads(file.read_text())
    unit["packages"] = [{"module": "numpy", "distribution": "numpy", "version": built}]
    file.write_text(json.dumps(unit))
    host.logging = True
    assert host.instantiate()
    expected = [f"x: fmi3InstantiateCoSimulation: numpy: built with {built}, found {here}"]
    assert host.log == (expected if warned else [])


def test_a_missing_source_is_a_logged_error(workshop: Workshop):
    host = workshop.own("scalars:Scalars", 3)
    (host.folder / "resources" / "sources" / "handover" / "fmus" / "loader.py").unlink()
    assert not host.instantiate()
    assert "loader.py cannot be read" in host.log[-1]


def test_a_unit_whose_import_fails_is_a_logged_error(workshop: Workshop):
    host = workshop.own("scalars:Scalars", 3)
    unit = host.folder / "resources" / "unit.json"
    unit.write_text(unit.read_text().replace("_fmu_", "_fmu_broken_"))
    (host.folder / "resources" / "sources" / "support" / "sample_units" / "scalars.py").write_text(
        "import handover.cosim.nothing\n"
    )
    assert not host.instantiate()
    assert "the FMU has no module 'handover.cosim.nothing'" in host.log[-1]


def test_an_explanation_of_a_refusal_has_no_traceback():
    assert loader.explain(loader.HostError("why")) == "why"


def test_the_prefix_of_a_units_modules_is_reported_nowhere(workshop: Workshop):
    host = workshop.host("every_kind:EveryKind", 3)
    assert host.initialise() == OK
    host.set("a", [666.0])
    assert host.step(0.0, 1 / 64) != OK
    assert "\nsupport.sample_units.every_kind.Misfortune: the number of the beast" in host.log[-1]
    assert "_fmu_" not in host.log[-1]


def test_a_path_keeps_all_its_parts():
    error = ValueError("in /tmp/_fmu_12.d/a.py: <_fmu_12ab.plants.arm.Arm object>, _fmu_12ab.größe.Ünit")
    assert loader.explain(error) == "ValueError: in /tmp/_fmu_12.d/a.py: <plants.arm.Arm object>, größe.Ünit"


def test_two_builds_in_one_folder_are_reported_with_a_cure(workshop: Workshop):
    host = workshop.own("scalars:Scalars", 3)
    assert not host.instantiate(token="{0}")
    for part in ("token {0} is not that of the resources", "of two different builds. Cure: unpack the FMU again"):
        assert part in host.log[-1]
