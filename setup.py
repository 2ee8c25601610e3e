"""Compiles the FMI runtime while the package is built; all else about the package is in pyproject.toml.

The wheel has it for this machine, or for the platforms that the environment variable HANDOVER_FMI_PLATFORMS names.
"""

import importlib.util
import shutil
from pathlib import Path
from types import ModuleType

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py
from setuptools.errors import CompileError, OptionError


def _compiler() -> ModuleType:
    """Return fmus/compile.py, by its path: the packages around it need more than a build environment has."""
    path = Path(__file__).parent / "fmus" / "compile.py"
    spec = importlib.util.spec_from_file_location("fmus_compile", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _wanted_platforms() -> tuple[str, ...]:
    compiler = _compiler()
    try:
        wanted: tuple[str, ...] = compiler.wanted_platforms()
    except compiler.UnknownPlatform as e:
        raise OptionError(f"HANDOVER_FMI_PLATFORMS: {e}") from e
    return wanted


class BuildWithRuntime(build_py):
    """Compiles the runtime into the source tree, from where it is packed as data, or used in an editable install."""

    def run(self) -> None:
        """Compile, then build."""
        compiler = _compiler()
        try:
            compiler.compile_runtime(_wanted_platforms())
        except compiler.CompilationError as e:
            raise CompileError(str(e)) from e
        shutil.rmtree(Path(self.build_lib, "fmus", "runtime", "bin"), ignore_errors=True)  # of a build before
        super().run()

    def find_data_files(self, package: str, src_dir: str) -> list[str]:
        """Leave out what a checkout has been compiled for besides."""
        wanted = _wanted_platforms()
        files = [Path(file) for file in super().find_data_files(package, src_dir)]
        return [str(file) for file in files if file.parent.parent.name != "bin" or file.parent.name in wanted]


class PlatformWheel(bdist_wheel):
    """Names the wheel for its platform but for every Python: the runtime needs no particular one."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags for Python, its ABI, and the platform."""
        return "py3", "none", super().get_tag()[2]


class WithRuntime(Distribution):
    """A distribution with files for one platform."""

    def has_ext_modules(self) -> bool:
        """Tell that the wheel is not for every platform."""
        return True


setup(cmdclass={"build_py": BuildWithRuntime, "bdist_wheel": PlatformWheel}, distclass=WithRuntime)
