"""Compiles the FMI runtime while the package is built; all else about the package is in pyproject.toml."""

import importlib.util
from pathlib import Path
from types import ModuleType

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py


def _compiler() -> ModuleType:
    """Return fmus/compile.py, by its path: the packages around it need more than a build environment has."""
    path = Path(__file__).parent / "fmus" / "compile.py"
    spec = importlib.util.spec_from_file_location("fmus_compile", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class BuildWithRuntime(build_py):
    """Compiles the runtime into the source tree, from where it is packed as data, or used in an editable install."""

    def run(self) -> None:
        """Compile, then build."""
        _compiler().compile_runtime()
        super().run()


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
