"""Describes a Python interpreter for hosts that are not Python, which load it to run an FMU's block.

The builder writes the description of its own interpreter into each FMU (resources/python.txt). The FMU also contains
this file: run as a script, it prints the description of the interpreter that runs it. So the runtime queries the
`python3` on the PATH, on Windows the `python`. Standard library only.
"""

import os
import sys
import sysconfig


def describe() -> str:
    """Return lines `name = value`: executable, library (empty if Python was built without one), version, site."""
    folders = [p for p in sys.path if os.path.basename(p) in ("site-packages", "dist-packages") and os.path.isdir(p)]
    properties = [
        ("executable", executable()),
        ("library", library()),
        ("version", f"{sys.version_info.major}.{sys.version_info.minor}"),
        *[("site", folder) for folder in folders],
    ]
    return "".join(f"{name} = {value}\n" for name, value in properties)


def executable() -> str:
    """Return the interpreter's path: one name of it, whichever of its names it was called by.

    An environment has it as python, python3 and python3.11. The links are not followed: by its place in the environment
    it finds the environment's packages.
    """
    name = os.path.join(sys.prefix, "bin", "python3")
    try:
        return name if os.path.samefile(name, sys.executable) else sys.executable
    except OSError:  # there is none, as on Windows, or nobody knows what runs
        return sys.executable


def library() -> str:
    """Return the path of the interpreter's shared library, or an empty string."""
    if os.name == "nt":
        names = [f"python{sys.version_info.major}{sys.version_info.minor}.dll"]
        folders = [sys.base_prefix, os.path.dirname(sys.executable)]
    else:
        names = [str(sysconfig.get_config_var(v) or "") for v in ("INSTSONAME", "LDLIBRARY")]
        variables = ("LIBDIR", "LIBPL", "PYTHONFRAMEWORKPREFIX")
        folders = [str(sysconfig.get_config_var(v) or "") for v in variables] + [os.path.join(sys.base_prefix, "lib")]
        folders.insert(1, os.path.join(folders[0], str(sysconfig.get_config_var("MULTIARCH") or "")))
    for name in names:
        for folder in folders:
            path = os.path.join(folder, name)
            if name and folder and not name.endswith(".a") and os.path.isfile(path):
                return path
    return ""


if __name__ == "__main__":
    sys.stdout.buffer.write(os.fsencode(describe()))
