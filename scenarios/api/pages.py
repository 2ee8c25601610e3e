"""A page, such as a report or a replay, that a notebook shows and a browser opens."""

import html
import webbrowser
from dataclasses import dataclass
from pathlib import Path

from handover.scenarios.api.arguments import path_of
from handover.scenarios.runs.results.run_folder import make_folder_of, write_whole


@dataclass(frozen=True)
class Page:
    """An HTML page that needs no network.

    Attributes:
        html: its text.
        path: the file that it is in; None where it was not saved.
        height: of its frame in a notebook, pixels.
    """

    html: str
    path: Path | None = None
    height: int = 640

    def save(self, path: Path | str) -> "Page":
        """Write the page to a file, whose folder is made, and return it with that as its path.

        Raises:
            InvalidInput: it is not a path.
            RecordNotWritten: it cannot be written.
        """
        file = path_of("path", path)
        make_folder_of(file)
        write_whole(file, self.html)
        return Page(self.html, file, self.height)

    def show(self) -> None:
        """Open the page in a browser.

        Raises:
            ValueError: it is in no file.
        """
        if self.path is None:
            raise ValueError("the page is in no file: page.save('page.html').show()")
        webbrowser.open(self.path.absolute().as_uri())

    def __repr__(self) -> str:
        """Return where the page is."""
        return f"<page {self.path or 'that is not saved'}>"

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe srcdoc="{html.escape(self.html)}" style="{style}"></iframe>'
