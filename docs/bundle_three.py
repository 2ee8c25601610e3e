"""Make `scenarios/runs/reporting/page/scene/three.min.js`: the parts of three.js that our scripts use.

Needs npm. The version is pinned below; the licence is copied beside the file.

    python docs/bundle_three.py
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

THREE, ESBUILD = "0.187.0", "0.28.1"
PAGE = Path(__file__).parents[1] / "scenarios" / "runs" / "reporting" / "page"
SCRIPTS = ("scene/scene_objects.js", "scene/scene.js", "hand/hand_input.js")
ADDONS = {
    "OrbitControls": "controls/OrbitControls.js",
    "LineSegments2": "lines/LineSegments2.js",
    "LineSegmentsGeometry": "lines/LineSegmentsGeometry.js",
    "LineMaterial": "lines/LineMaterial.js",
}


def main() -> None:
    """Bundle what the `SCRIPTS` name after `THREE.`."""
    code = "".join(re.sub(r"//.*", "", (PAGE / script).read_text("utf-8")) for script in SCRIPTS)
    names = set(re.findall(r"\bTHREE\.(\w+)", code))
    core = ", ".join(sorted(names - set(ADDONS)))
    lines = [f'export {{ {core} }} from "three";']
    lines += [f'export {{ {name} }} from "three/addons/{path}";' for name, path in ADDONS.items() if name in names]
    scene = PAGE / "scene"
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder)
        (there / "entry.js").write_text("\n".join(lines), encoding="utf-8")
        (there / "package.json").write_text("{}", encoding="utf-8")
        run = ["npm", "install", "--silent", f"three@{THREE}", f"esbuild@{ESBUILD}"]
        subprocess.run(run, cwd=there, check=True)
        bundle = ["npx", "esbuild", "entry.js", "--bundle", "--minify", "--format=iife", "--global-name=THREE"]
        subprocess.run([*bundle, "--legal-comments=none", "--outfile=three.min.js"], cwd=there, check=True)
        notice = f"/* three.js {THREE}, MIT licence: see three.LICENSE.txt. The parts that our scripts use. */\n"
        (scene / "three.min.js").write_text(notice + (there / "three.min.js").read_text(encoding="utf-8"), "utf-8")
        shutil.copyfile(there / "node_modules" / "three" / "LICENSE", scene / "three.LICENSE.txt")


if __name__ == "__main__":
    main()
