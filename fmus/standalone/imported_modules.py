"""Writes the names of the modules that a block imports to a file, as JSON: a script, run with BLOCK FOLDERS RESULT.

BLOCK is the path of a class, such as `package.module:Class`; modules are looked for in the FOLDERS, a list in JSON.
It runs in its own process, where nothing else has been imported; what the modules print is nobody's result.
"""

import importlib
import json
import sys

_OF_INSTALLATIONS = ("__editable__", "_distutils_hack", "_virtualenv", "sitecustomize", "usercustomize")
"""Beginnings of the names of modules by which Python finds installations as it starts: they belong to this machine."""


def main(block: str, folders: str, result: str) -> None:
    """Import a block, and what it imports late, and write the names of all modules that are loaded then."""
    sys.path[:] = json.loads(folders)
    module, _, name = block.partition(":")
    for deferred in getattr(getattr(importlib.import_module(module), name), "deferred", ()):
        importlib.import_module(deferred)
    names = sorted(name for name in sys.modules if _is_needed(name))
    with open(result, "w", encoding="utf-8") as file:
        json.dump(names, file)


def _is_needed(name: str) -> bool:
    return all(part.isidentifier() for part in name.split(".")) and not name.startswith(_OF_INSTALLATIONS)


if __name__ == "__main__":
    main(*sys.argv[1:])
