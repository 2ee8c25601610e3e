"""Prints the names of the modules that a block imports, as JSON: a script, run with BLOCK and FOLDERS, a list in JSON.

BLOCK is the path of a class, such as `package.module:Class`; modules are looked for in the FOLDERS. It runs in its own
process, where nothing else has been imported.
"""

import importlib
import json
import sys

_OF_INSTALLATIONS = ("__editable__", "_distutils_hack", "_virtualenv", "sitecustomize", "usercustomize")
"""Beginnings of the names of modules by which Python finds installations as it starts: they belong to this machine."""


def main(block: str, folders: str) -> None:
    """Import a block, and what it imports late, and print the names of all modules that are loaded then."""
    sys.path[:] = json.loads(folders)
    module, _, name = block.partition(":")
    for deferred in getattr(getattr(importlib.import_module(module), name), "deferred", ()):
        importlib.import_module(deferred)
    print(json.dumps(sorted(name for name in sys.modules if _is_needed(name))))


def _is_needed(name: str) -> bool:
    return all(part.isidentifier() for part in name.split(".")) and not name.startswith(_OF_INSTALLATIONS)


if __name__ == "__main__":
    main(*sys.argv[1:])
