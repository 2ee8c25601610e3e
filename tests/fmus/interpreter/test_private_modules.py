"""Units in one process do not see each other's modules, nor does the host see theirs."""

import importlib
import json
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


def test_a_second_instance_reads_data_beside_its_own_modules(tmp_path: Path):
    (folder := tmp_path / "with_data").mkdir()
    (folder / "table.csv").write_text("2.5")
    fmu = build_in(folder, "float(__import__('pathlib').Path(__file__).with_name('table.csv').read_text())")
    (folder / "table.csv").unlink()
    for _ in range(2):
        host = CtypesHost(fmu, 3)
        assert host.instantiate(), host.log
        assert host.initialise() == OK, host.log
        assert host.get("y") == [2.5]
        host.close()


def edited(host: CtypesHost, **changed: object) -> None:
    """Change what stands in an unpacked unit's facts."""
    file = host.folder / "resources" / "unit.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **changed}))


@pytest.mark.machine
def test_missing_packages_are_named_with_version_interpreter_and_cure(workshop: Workshop):
    host = workshop.own("scalars:Scalars", 3)
    edited(host, packages=[{"module": "no_such_module", "distribution": "no-such-package", "version": "4.5.6"}])
    assert not host.instantiate()
    for part in ("no-such-package (built with version 4.5.6)", sys.executable, "pip install no-such-package==4.5.6"):
        assert part in host.log[-1]


def test_a_package_older_than_that_of_the_build_is_a_warning(workshop: Workshop):
    host, here = workshop.own("scalars:Scalars", 3), metadata.version("numpy")
    major, minor = (int(n) for n in here.split(".")[:2])
    host.logging = True
    for change in (-1, 0, 1):
        built = f"{major}.{minor + change}.99"
        edited(host, packages=[{"module": "numpy", "distribution": "numpy", "version": built}])
        assert host.instantiate()
        host.free()
    assert host.log == [f"x: fmi3InstantiateCoSimulation: numpy: built with {built}, found {here}"]


def test_a_unit_whose_import_fails_is_a_logged_error(workshop: Workshop):
    host = workshop.own("scalars:Scalars", 3)
    unit = host.folder / "resources" / "unit.json"
    unit.write_text(unit.read_text().replace("_fmu_", "_fmu_broken_"))
    source = host.folder / "resources" / "sources" / "support" / "sample_units" / "scalars.py"
    source.write_text("import handover.cosim.nothing\n")
    assert not host.instantiate()
    assert "the FMU has no module 'handover.cosim.nothing'" in host.log[-1]


def test_a_refusal_is_explained_without_traceback_and_a_path_keeps_all_its_parts():
    assert loader.explain(loader.HostError("why")) == "why"
    error = ValueError("in /tmp/_fmu_12.d/a.py: <_fmu_12ab.plants.arm.Arm object>, _fmu_12ab.größe.Ünit")
    assert loader.explain(error) == "ValueError: in /tmp/_fmu_12.d/a.py: <plants.arm.Arm object>, größe.Ünit"
