"""The gallery: a run of every scenario by the command, with its verdict, figures and page.

Runs are those that tests keep (`support.kept_runs`): made anew only when code, packages or arguments have changed.
"""

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from support.kept_runs import kept_run

_FIRST = ("scene", "pictures", "shape", "hand", "path", "error", "motion")
"""Names of figures that show most of a scenario, best first."""


@dataclass(frozen=True)
class GalleryRun:
    """What the gallery shows of a run.

    Attributes:
        success, reason: its verdict.
        figures: paths of its figures by name, relative to the site.
        page: the path of its report page.
    """

    success: bool
    reason: str
    figures: Mapping[str, str]
    page: str

    @property
    def first(self) -> str:
        """The figure that shows most."""
        known = [self.figures[name] for name in _FIRST if name in self.figures]
        return (known or list(self.figures.values()))[0]


def gallery_run(name: str, files: Path) -> GalleryRun:
    """Run a scenario with its defaults, unless that is kept, and copy figures and page below the site's files."""
    run = kept_run("run", name)
    folder = files / "gallery" / name
    folder.mkdir(parents=True, exist_ok=True)
    made = [*sorted((run / "figures").glob("*.png")), run / "report.html"]
    for file in made:
        shutil.copyfile(file, folder / file.name)
    for other in folder.iterdir():
        if other.name not in {file.name for file in made}:
            other.unlink()
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    figures = {file.stem: f"gallery/{name}/{file.name}" for file in made[:-1]}
    return GalleryRun(bool(summary["success"]), summary["reason"], figures, f"gallery/{name}/report.html")
