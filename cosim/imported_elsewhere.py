"""Imports libraries that read their configuration from the working directory, without that.

A file there may be somebody else's: one that is damaged, or a pipe, ends the command or lets it wait for ever.
"""

import contextlib
import os
import sys
import types
from collections.abc import Generator, Mapping, Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from typing import Any, ClassVar


class ImportedElsewhere:
    """A finder of such libraries, as `sys.meta_path` has them."""

    _files: ClassVar[Mapping[str, str]] = {"matplotlib": "matplotlibrc", "numba": ".numba_config.yaml"}

    @classmethod
    def install(cls) -> None:
        """Import so from now on in this process."""
        finders: list[Any] = sys.meta_path
        finders.insert(0, cls)

    @classmethod
    @contextlib.contextmanager
    def installed(cls) -> Generator[None, None, None]:
        """Import so within this context, as in a process of another program."""
        cls.install()
        try:
            yield
        finally:
            finders: list[Any] = sys.meta_path
            finders.remove(cls)

    @classmethod
    def find_spec(cls, name: str, path: Sequence[str] | None, _target: object = None) -> ModuleSpec | None:
        """Return how such a library is imported: where its file is there, with its own folder as working directory."""
        spec = PathFinder.find_spec(name, path) if name in cls._files else None
        if spec is not None and spec.origin is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _LoaderElsewhere(name, spec.origin, cls._files[name])
        return spec


class _LoaderElsewhere(SourceFileLoader):
    def __init__(self, name: str, path: str, file: str) -> None:
        super().__init__(name, path)
        self._file = file

    def exec_module(self, module: types.ModuleType) -> None:
        if not os.path.lexists(self._file):
            super().exec_module(module)
        else:
            here = os.getcwd()
            os.chdir(os.path.dirname(self.path))
            try:
                super().exec_module(module)
            finally:
                os.chdir(here)
        if self.name == "numba":  # it would read the file again whenever it compiles
            config: Any = sys.modules["numba.core.config"]
            config._config_fname = ""
