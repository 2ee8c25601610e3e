"""The wheels for all platforms: what they are called, what they are for, and what an index shows of them."""

import re
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
