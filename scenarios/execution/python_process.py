"""How a command of another Python process is made, so that it imports the same code as this one.

Python looks for modules in the folder where it was called before all else (`python -m`, `python -c`): called in a clone
of a project of which another copy is installed, a process would take the clone's modules, and the one that started it
the installed ones. The folders from which this process imports are therefore handed over, as they are.
"""

import sys
from collections.abc import Sequence

_MODULE = "import runpy; runpy.run_module(sys.argv.pop(1), None, '__main__', True)"
_CODE = "import sys; sys.path[:] = {path!r}; {code}"


def module_command(name: str, *arguments: str) -> Sequence[str]:
    """Return the command that runs a module as `python -m NAME ARGUMENTS` does, from this process's modules."""
    return code_command(_MODULE, name, *arguments)


def code_command(code: str, *arguments: str) -> Sequence[str]:
    """Return the command that runs code as `python -c CODE ARGUMENTS` does, from this process's modules."""
    return [sys.executable, "-c", _CODE.format(path=sys.path, code=code), *arguments]
