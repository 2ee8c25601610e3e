"""Builds the project's wheels from a copy of its sources."""

import os
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[3]


def copy_sources(folder: Path) -> Path:
    """Copy the sources with what builds them, `build-tools`, to a folder, and return that."""

    def ignored(place: str, names: list[str]) -> set[str]:
        at_root = ("tests", "runs") if Path(place) == ROOT else ()
        patterns = (".*", "bin", "build", "dist", "*.egg-info", "__pycache__", *at_root)
        return shutil.ignore_patterns(*patterns)(place, names)

    shutil.copytree(ROOT, folder, symlinks=True, ignore=ignored)
    tools = folder / "build-tools"
    (zig,) = re.findall(r'"ziglang==([\d.]+)"\]', (ROOT / "pyproject.toml").read_text())
    wanted = ["setuptools>=77", f"ziglang=={zig}"]
    for installed in metadata.distributions(name="ziglang"):
        if installed.version != zig:
            continue
        tools.mkdir()  # links it, as it is large
        (tools / "ziglang").symlink_to(Path(str(installed.locate_file("ziglang"))))
        del wanted[1]
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--target", str(tools), *wanted]
    subprocess.run(command, check=True)
    return folder


def build_wheel(checkout: Path, platform: str, **environment: str) -> Path:
    """Build the wheel for a platform into a folder beside the copied sources, and return its path."""
    out = checkout.parent / platform
    command = [
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--wheel-dir",
        str(out),
        str(checkout),
    ]
    names = {"PYTHONPATH": str(checkout / "build-tools"), "HANDOVER_WHEEL_PLATFORM": platform, **environment}
    subprocess.run([sys.executable, *command], env={**os.environ, **names}, check=True)
    (made,) = out.iterdir()
    return made
