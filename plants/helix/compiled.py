"""Compilation of numerical kernels by Numba where that is installed; without it the same functions run as plain Python.

Numba is looked for at run time and not imported by a statement, since an FMU demands of its host what its sources
import, and this one is content without.
"""

import contextlib
import hashlib
import importlib
import os
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from handover.cosim.native_libraries import cache_folder

P = ParamSpec("P")
T = TypeVar("T")


def _load() -> Any:
    """Return Numba, or None where it is not installed or HANDOVER_COMPILE is 0."""
    if os.environ.get("HANDOVER_COMPILE") == "0":
        return None
    try:
        return importlib.import_module("numba")
    except ImportError:
        return None


_numba = _load()

IS_COMPILED = _numba is not None
"""Whether functions are compiled."""


_MODULE = "handover_compiled_kernels"
"""Name of an empty module, to which kept machine code belongs: an FMU's modules have other names in each build."""


def compiled(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function of numbers, tuples and arrays as a part of the compiled ones that call it.

    Division follows IEEE 754, so a zero divisor gives no exception; without Numba it is Python's, so none may be zero.
    """
    # nothing else calls it, and what makes it callable from Python takes a quarter of the time to compile
    return _compile(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def compiled_inline(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function into those that call it, for parts of one: passing many numbers costs as much as a contact."""
    return _compile(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, forceinline=True)


def _compile(function: Callable[P, T], **options: bool) -> Callable[P, T]:
    if _numba is None:
        return function
    sys.modules.setdefault(_MODULE, types.ModuleType(_MODULE))
    own: Any = function
    kernel = types.FunctionType(own.__code__, own.__globals__, own.__name__)  # its own may be called by Python, too
    kernel.__module__ = _MODULE
    return cast("Callable[P, T]", _numba.njit(error_model="numpy", nogil=True, **options)(kernel))


def compiled_once(*sources: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Compile a function and keep its machine code in the cache of this project, for later processes.

    Numba's own cache lies beside the sources and goes by their dates, but an FMU is unpacked anew for each run. This
    one goes by what the sources are. Where it cannot be written, each process compiles for itself.

    Args:
        sources: names of all modules whose compiled functions or constants the function uses.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        made = _compile(function)
        if _numba is not None:
            with contextlib.suppress(ImportError, AttributeError, OSError, RuntimeError):
                _keep(made, sources)
        return made

    return decorate


def _keep(dispatcher: Any, sources: tuple[str, ...]) -> None:
    """Give a compiled function a cache by content; Numba has no public way to say where it lies."""
    caching = importlib.import_module("numba.core.caching")
    digest = hashlib.sha256()
    for source in (*sources, __name__):
        digest.update(Path(str(sys.modules[source].__file__)).read_bytes())
    name = digest.hexdigest()[:16]

    class Locator(caching._CacheLocator):
        def get_cache_path(self) -> str:
            return str(cache_folder() / "kernels" / name)

        def get_source_stamp(self) -> str:
            return name

        def get_disambiguator(self) -> str:
            return name

        @classmethod
        def from_function(cls, py_func: Any, py_file: str) -> Any:  # noqa: ARG003
            locator = cls()
            locator.ensure_cache_path()
            return locator

    class Implementation(caching.CompileResultCacheImpl):
        _locator_classes = [Locator]

    class ContentCache(caching.FunctionCache):
        _impl_class = Implementation

    dispatcher._cache = ContentCache(dispatcher.py_func)
