"""Tells in one line why a package cannot be imported, and what to do about it.

Every FMU carries this file, as its block's packages are imported in whatever host it is loaded into. Standard library
only.
"""

import importlib.util
import os
import re
import sys

_OWN = "handover-cosim"
_DISTRIBUTIONS = {"cv2": "opencv-python-headless", "imageio_ffmpeg": "imageio-ffmpeg"}
"""The distributions of modules that are not named like them."""

_MISSING_LIBRARY = re.compile(r"(?:^|[\s'\"])([\w.+-]+\.so[.\d]*): cannot open shared object file")
_INSTALLED = re.compile(r"[\\/](?:site|dist)-packages[\\/](\w+)")
_REQUIRED = re.compile(r"[\w.-]+")
_EXTRA = re.compile(r"extra == ['\"]([\w-]+)['\"]")
_LIBRARY_NAME = re.compile(r"(.+)\.so\.([\d.]+)$")


def explain_import(error: BaseException) -> str:
    """Return in one line which package could not be imported, why, and the cure."""
    messages = [str(e) for e in _chain(error)]
    package = _package(error)
    for message in messages:
        if library := _MISSING_LIBRARY.search(message):
            return (
                f"{package or 'a package'} needs the shared library {library[1]}, which this system does not have."
                f" Cure: install it, on Debian and Ubuntu with `apt-get install {debian_package(library[1])}`"
            )
    module = error.name.partition(".")[0] if isinstance(error, ModuleNotFoundError) and error.name else ""
    if module and module != package:
        needs = f"{package} needs the module {module}" if package else f"the module {module} is needed"
        here = f"which this Python does not have ({sys.executable or sys.prefix})"
        unknown = " Cure: install what brings it" if package else " Is it spelt so, or not installed?"
        cure = _install(module)
        return f"{needs}, {here}." + (f" Cure: {cure}" if cure else unknown)
    cause = [str(e) for e in _chain(error) if isinstance(e, ImportError)] or messages
    reason = next((line.strip() for line in cause[-1].splitlines() if line.strip()), type(error).__name__)
    what = package or module
    place = "" if package else " ({}, line {})".format(*_raised_at(error))
    anew = f" Cure: install it anew, `python -m pip install --force-reinstall {_distribution(what)}`" if what else ""
    return f"importing {what or 'a module'} fails: {reason.rstrip('.')}{place}.{anew}"


def is_of_a_package(error: BaseException) -> bool:
    """Return whether an exception is a failed import, as of a module or a library that is missing."""
    return isinstance(error, ImportError) or any(_MISSING_LIBRARY.search(str(e)) for e in _chain(error))


def debian_package(library: str) -> str:
    """Return the package that has a shared library by Debian's rule for names: `libGL.so.1` is in `libgl1`."""
    parts = _LIBRARY_NAME.match(library)
    if not parts:
        return library.partition(".so")[0].lower().replace("_", "-")
    name, version = parts[1].lower().replace("_", "-"), parts[2]
    return f"{name}-{version}" if name[-1].isdigit() else f"{name}{version}"


def missing_modules(extra: str) -> list[str]:
    """Return the modules that an extra of this project brings and that are not installed."""
    modules = {distribution: module for module, distribution in _DISTRIBUTIONS.items()}
    wanted = [modules.get(name, name) for name, of in _requirements() if of == extra and name != _OWN]
    return [module for module in wanted if importlib.util.find_spec(module) is None]


def install_extra(extra: str) -> str:
    """Return the command that installs an extra of this project."""
    return f'python -m pip install "{_OWN}[{extra}]"'


def _install(module: str) -> str:
    """Return how to install what brings a missing module; "" of one that this project does not require.

    Under a misspelled name there may be anything.
    """
    distribution, extras = _distribution(module), dict(reversed(_requirements()))
    if extra := extras.get(distribution):
        return install_extra(extra)
    return f"python -m pip install {distribution}" if distribution in extras or module in _DISTRIBUTIONS else ""


def _requirements() -> list[tuple[str, str]]:
    """Return distributions that this project requires, each with the name of the extra that brings it, or with ""."""
    from importlib import metadata  # slow to load, here and below: the catalog imports this module

    try:
        wanted = metadata.requires(_OWN) or []
    except metadata.PackageNotFoundError:  # in an environment that only runs its FMUs
        return []
    parts = [(_REQUIRED.match(requirement), _EXTRA.search(requirement)) for requirement in wanted]
    return [(name[0], extra[1] if extra else "") for name, extra in parts if name]


def _distribution(module: str) -> str:
    if module in _DISTRIBUTIONS:
        return _DISTRIBUTIONS[module]
    from importlib import metadata

    return next(iter(metadata.packages_distributions().get(module, [])), module)


def _chain(error: BaseException | None) -> list[BaseException]:
    """Return an exception and those that led to it."""
    chain: list[BaseException] = []
    while error is not None and error not in chain:
        chain.append(error)
        error = error.__cause__ or error.__context__
    return chain


def _package(error: BaseException) -> str:
    """Return the installed package whose import failed; empty if what imported it is no other package's."""
    file, _ = _raised_at(error)
    path = getattr(error, "path", None)  # of a compiled module
    installed = _INSTALLED.search(file) or (_INSTALLED.search(path) if isinstance(path, str) else None)
    return installed[1] if installed and installed[1] != "handover" else ""


def _raised_at(error: BaseException) -> tuple[str, int]:
    """Return file and line of the innermost frame that is not the import system's or the standard library's."""
    place, trace = ("", 0), error.__traceback__
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if _INSTALLED.search(file) or not file.startswith(("<frozen", os.path.dirname(os.__file__))):
            place = (file, trace.tb_lineno)
        trace = trace.tb_next
    return place
