"""The environment in which the tutorials are executed: the project's wheel, what it requires, and no clone.

Packages are linked from the environment that builds the site; `handover` comes from a wheel that is built of the
sources. It is made again where product or packages have changed.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from support.fmus.wheels import build_wheel, copy_sources
from support.installed import distributions, link_distributions
from support.kept_runs import code_key

from handover.cosim.native_libraries import host_platform

INSTALLED_BY_READERS = ("pythonfmu",)
"""Packages that tutorials say to install beside the wheel with its extra `all`."""


def make(environment: Path) -> None:
    """Make the environment in a folder, with its description for Jupyter, unless it is there."""
    whole = environment / "whole"
    if whole.exists() and whole.read_text() == code_key():
        return
    shutil.rmtree(environment, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    (packages,) = environment.glob("lib/python*/site-packages")
    required = distributions("handover-cosim", ["all"]) - {"handover-cosim"}
    for name in INSTALLED_BY_READERS:
        required |= distributions(name)
    link_distributions(required, packages)
    with tempfile.TemporaryDirectory(prefix="handover-") as sources:
        wheel = build_wheel(copy_sources(Path(sources) / "handover"), host_platform())
        pip = [sys.executable, "-m", "pip", "--python", str(environment / "bin" / "python")]
        subprocess.run([*pip, "install", "--quiet", "--no-deps", wheel], check=True)
    _describe(environment)
    whole.write_text(code_key())


def _describe(environment: Path) -> None:
    """Write Jupyter's description of the kernel; commands of the pages find the environment's programs."""
    programs = environment / "bin"
    specification = {
        "argv": [str(programs / "python"), "-m", "ipykernel_launcher", "-f", "{connection_file}"],
        "display_name": "handover",
        "language": "python",
        "env": {"PATH": f"{programs}{os.pathsep}${{PATH}}", "PYTHONNOUSERSITE": "1", "COLUMNS": "88"},
    }
    file = environment / "jupyter" / "kernels" / "tutorial" / "kernel.json"
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(specification), encoding="utf-8")
