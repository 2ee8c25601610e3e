"""Compiles the FMI runtime and the master's plan while the package is built; all else is in pyproject.toml.

The wheel has the runtime, the plan and the process of isolated units for this machine, or for the platform that the
environment variable HANDOVER_WHEEL_PLATFORM names, by FMI 3.0's names such as `x86_64-darwin`. With
HANDOVER_FMI_PLATFORMS it has the runtime for the platforms that this names instead.

HANDOVER_SITE is the address below which this folder's files can be fetched, such as `https://example.org/handover`: an
index of packages then shows the README's pictures and links. Without it they are left out there.
"""

import os
import re
import shutil
import sys
from pathlib import Path

from setuptools import Distribution, find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py
from setuptools.errors import CompileError, OptionError

ROOT = Path(__file__).parent
PARTS = ("cosim", "plants", "controllers", "fmus", "scenarios")
"""Folders beside `handover/` that are its subpackages; none is a package of its own."""

sys.path.insert(0, str(ROOT))  # a build frontend leaves it out
import handover

handover.__path__.append(str(ROOT))  # what is not installed yet

from handover.cosim.isolation.compile import compile_isolation
from handover.cosim.native_libraries import TARGETS, CompilationError, host_platform
from handover.cosim.plan.compile import compile_plan
from handover.fmus.compile import UnknownPlatform, compile_runtime, named_platforms, wanted_platforms

_FOR_ONE_PLATFORM = ("handover.cosim.plan", "handover.cosim.isolation")


def _platform() -> str:
    """Return the platform of the wheel."""
    named = os.environ.get("HANDOVER_WHEEL_PLATFORM")
    if named and named not in TARGETS:
        raise OptionError(f"HANDOVER_WHEEL_PLATFORM: no platform {named!r}; there are {', '.join(TARGETS)}")
    return named or host_platform()


def _wanted_platforms() -> tuple[str, ...]:
    try:
        return wanted_platforms() if os.environ.get("HANDOVER_FMI_PLATFORMS") else named_platforms([_platform()])
    except UnknownPlatform as e:
        raise OptionError(f"HANDOVER_FMI_PLATFORMS: {e}") from e


def _platform_tag(default: str) -> str:
    """Return the tag of the oldest system that the compiled files run on, as given to zig; else the default."""
    if _platform() not in TARGETS:
        return default
    architecture, _, system = _platform().partition("-")
    version = "_".join(re.findall(r"\d+", TARGETS[_platform()][0].rpartition("-")[2]))
    return {
        "linux": f"manylinux_{version}_{architecture}",
        "darwin": f"macosx_{version}_{architecture.replace('aarch64', 'arm64')}",
        "windows": f"win_{architecture.replace('x86_64', 'amd64')}",
    }[system]


def _packages() -> list[str]:
    return ["handover", *(f"handover.{name}" for part in PARTS for name in (part, *_below(part)))]


def _below(part: str) -> list[str]:
    return [f"{part}.{name}" for name in find_packages(str(ROOT / part))]


def _site() -> str:
    return os.environ.get("HANDOVER_SITE", "").rstrip("/")


def _readme() -> str:
    """Return the README as an index of packages shows it, which has none of the files that it links to."""
    text = Path(__file__).with_name("README.md").read_text(encoding="utf-8")
    link = re.compile(r"(!?)\[([^\]]*)\]\((?![a-z]+:|#)([^)]*)\)")
    if _site():
        return link.sub(rf"\1[\2]({_site()}/\3)", text)
    return link.sub(lambda found: f"*{found[2]}*" if found[1] else found[2], text)


def _links() -> dict[str, str]:
    return {"Homepage": _site(), "Changelog": f"{_site()}/CHANGELOG.md"} if _site() else {}


class BuildWithLibraries(build_py):
    """Compiles C into the source tree, from where it is packed as data, or used in an editable install."""

    def run(self) -> None:
        """Compile, then build."""
        try:
            compile_runtime(_wanted_platforms())
            compile_plan(_platform())
            compile_isolation(_platform())
        except CompilationError as e:
            raise CompileError(str(e)) from e
        for package in (("handover", "fmus", "runtime"), *(name.split(".") for name in _FOR_ONE_PLATFORM)):
            shutil.rmtree(Path(self.build_lib, *package, "bin"), ignore_errors=True)  # of a build before
        super().run()

    def find_data_files(self, package: str, src_dir: str) -> list[str]:
        """Leave out what a checkout has been compiled for besides."""
        wanted = (_platform(),) if package in _FOR_ONE_PLATFORM else _wanted_platforms()
        files = [Path(file) for file in super().find_data_files(package, src_dir)]
        return [str(file) for file in files if file.parent.parent.name != "bin" or file.parent.name in wanted]


class PlatformWheel(bdist_wheel):
    """Names the wheel for its platform, from the oldest system on, and for every Python."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags for Python, its ABI, and the platform."""
        return "py3", "none", _platform_tag(super().get_tag()[2])


class WithLibraries(Distribution):
    """A distribution with files for one platform."""

    def has_ext_modules(self) -> bool:
        """Tell that the wheel is not for every platform."""
        return True


setup(
    cmdclass={"build_py": BuildWithLibraries, "bdist_wheel": PlatformWheel},
    distclass=WithLibraries,
    packages=_packages(),
    package_dir={"handover": "handover", **{f"handover.{part}": part for part in PARTS}},
    long_description=_readme(),
    long_description_content_type="text/markdown",
    project_urls=_links(),
)
