"""The wheels for all platforms: what they are called, what they are for, what an index shows of them; the sdist."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from email import message_from_bytes
from email.message import Message
from pathlib import Path

import pytest
from support.fmus.libraries import facts
from support.fmus.wheels import ROOT, build_wheel, copy_sources

from handover.cosim.native_libraries import TARGETS

TAGS = {
    "x86_64-linux": "manylinux_2_17_x86_64",
    "aarch64-linux": "manylinux_2_17_aarch64",
    "x86_64-windows": "win_amd64",
    "x86_64-darwin": "macosx_11_0_x86_64",
    "aarch64-darwin": "macosx_11_0_arm64",
}
OLDEST = {"linux": (2, 17), "windows": (), "darwin": (11, 0, 0)}
LIBRARIES = (
    "cosim/isolation/bin/{}/proxy",
    "cosim/plan/bin/{}/plan",
    "fmus/runtime/bin/{}/fmi2",
    "fmus/runtime/bin/{}/fmi3",
)
PARTS = ("controllers", "cosim", "fmus", "plants", "scenarios")
SITE = "https://example.org/files"


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copy_sources(tmp_path_factory.mktemp("checkout") / "handover")


@pytest.mark.parametrize(
    "platform", [pytest.param(t, marks=pytest.mark.platforms if i else pytest.mark.slow) for i, t in enumerate(TAGS)]
)
def test_a_wheel_has_the_libraries_of_its_platform_alone_and_shows_pictures_by_their_address(
    checkout: Path, platform: str
):
    made = build_wheel(checkout, platform, HANDOVER_SITE=SITE)
    assert made.name.endswith(f"-py3-none-{TAGS[platform]}.whl")
    system, suffix = platform.partition("-")[2], TARGETS[platform][1]
    expected = [f"handover/{name.format(platform)}{suffix}" for name in LIBRARIES]
    expected = [name for name in expected if system != "windows" or "isolation" not in name]
    with zipfile.ZipFile(made) as archive:
        assert [n for n in sorted(archive.namelist()) if n.endswith((".so", ".dll", ".dylib"))] == expected
        assert {n.split("/bin/")[1].split("/")[0] for n in archive.namelist() if "/bin/" in n} == {platform}
        modules = {f"handover/{p.relative_to(checkout)}" for part in PARTS for p in (checkout / part).rglob("*.py")}
        assert {n for n in archive.namelist() if n.endswith(".py")} == {"handover/__init__.py", *modules}
        for name in expected:
            found = facts(archive.read(name))
            assert found.platform == platform
            assert found.oldest <= OLDEST[system]
        metadata, text = metadata_in(archive)
    assert metadata["Project-URL"]
    assert "](docs/" not in text
    assert f"]({SITE}/docs/helix_handover.gif)" in text
    pictures = re.findall(rf"\({SITE}/([^)]*)\)", text)
    assert len(pictures) > 5
    assert [file for file in pictures if not (ROOT / file.partition("#")[0]).exists()] == []


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="only a clone knows which files are the project's")
def test_an_sdist_is_the_repository(checkout: Path, tmp_path: Path):
    listed = subprocess.check_output(["git", "ls-files", "-z"], cwd=ROOT, text=True).split("\0")
    files = {name for name in listed if (ROOT / name).is_file()}
    for name in files:
        (tmp_path / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tmp_path / "clone" / name)
    build = [sys.executable, "-c", "import setuptools.build_meta as b; b.build_sdist('..')"]
    environment = {**os.environ, "PYTHONPATH": str(checkout / "build-tools")}
    subprocess.run(build, cwd=tmp_path / "clone", env=environment, stdout=subprocess.DEVNULL, check=True)
    (made,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(made) as archive:
        packed = {member.name.partition("/")[2] for member in archive if member.isfile()}
    of_setuptools = {name for name in packed if name in ("PKG-INFO", "setup.cfg") or ".egg-info/" in name}
    assert packed - of_setuptools == files


@pytest.mark.platforms
def test_an_index_shows_no_pictures_where_it_is_given_no_address(checkout: Path):
    with zipfile.ZipFile(build_wheel(checkout, next(iter(TAGS)), HANDOVER_SITE="")) as archive:
        metadata, text = metadata_in(archive)
    assert not metadata["Project-URL"]
    assert "](docs/" not in text
    assert "![" not in text


def metadata_in(archive: zipfile.ZipFile) -> tuple[Message, str]:
    """Return a wheel's metadata and the page that an index shows of it."""
    (name,) = [n for n in archive.namelist() if n.endswith(".dist-info/METADATA")]
    metadata = message_from_bytes(archive.read(name))
    assert metadata["Author"] == "The handover-cosim authors"
    return metadata, str(metadata.get_payload())
