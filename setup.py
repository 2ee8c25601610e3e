"""Compiles the FMI runtime and the master's plan while the package is built; all else is in pyproject.toml.

The wheel has the runtime for this machine, or for the platforms that the environment variable HANDOVER_FMI_PLATFORMS
names, and the plan and the process of isolated units for this machine.
"""

import shutil
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py
from setuptools.errors import CompileError, OptionError

sys.path.insert(0, str(Path(__file__).parent))  # a build frontend leaves it out

from handover.cosim.isolation.compile import compile_isolation
from handover.cosim.native_libraries import CompilationError, host_platform
from handover.cosim.plan.compile import compile_plan
from handover.fmus.compile import UnknownPlatform, compile_runtime, wanted_platforms

_FOR_THE_HOST = ("handover.cosim.plan", "handover.cosim.isolation")


def _wanted_platforms() -> tuple[str, ...]:
    try:
        return wanted_platforms()
    except UnknownPlatform as e:
        raise OptionError(f"HANDOVER_FMI_PLATFORMS: {e}") from e


class BuildWithLibraries(build_py):
    """Compiles C into the source tree, from where it is packed as data, or used in an editable install."""

    def run(self) -> None:
        """Compile, then build."""
        try:
            compile_runtime(_wanted_platforms())
            compile_plan()
            compile_isolation()
        except CompilationError as e:
            raise CompileError(str(e)) from e
        for package in (("handover", "fmus", "runtime"), *(name.split(".") for name in _FOR_THE_HOST)):
            shutil.rmtree(Path(self.build_lib, *package, "bin"), ignore_errors=True)  # of a build before
        super().run()

    def find_data_files(self, package: str, src_dir: str) -> list[str]:
        """Leave out what a checkout has been compiled for besides."""
        wanted = (host_platform(),) if package in _FOR_THE_HOST else _wanted_platforms()
        files = [Path(file) for file in super().find_data_files(package, src_dir)]
        return [str(file) for file in files if file.parent.parent.name != "bin" or file.parent.name in wanted]


class PlatformWheel(bdist_wheel):
    """Names the wheel for its platform but for every Python: the libraries need no particular one."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags for Python, its ABI, and the platform."""
        return "py3", "none", super().get_tag()[2]


class WithLibraries(Distribution):
    """A distribution with files for one platform."""

    def has_ext_modules(self) -> bool:
        """Tell that the wheel is not for every platform."""
        return True


setup(cmdclass={"build_py": BuildWithLibraries, "bdist_wheel": PlatformWheel}, distclass=WithLibraries)
