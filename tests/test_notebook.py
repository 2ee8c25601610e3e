"""The notebook shows what it says, and its outputs are those of its cells. Run as a program, writes them there.

`make notebook` does that. What depends on the machine, or is as large as a page, is left out of the file.
"""

import re
import tempfile
from pathlib import Path
from typing import Any, cast

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parent.parent / "docs" / "python.ipynb"
LARGEST = 500_000
"""Letters of an output that the file keeps."""

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?")
_PICTURE = re.compile(r"data:image/png;base64,[\w+/=]+")
_VARYING = (
    (_PICTURE, "PICTURE"),
    (re.compile(r"\d{4}-\d\d-\d\d_\d{6}"), "DATE"),
    (re.compile(r"(CPU [^<]*</td><td[^>]*>)[^<]*"), r"\1TIME"),
)

Output = dict[str, Any]


def read() -> Any:
    return cast(Any, nbformat).read(NOTEBOOK, as_version=4)


def executed(folder: Path) -> Any:
    """Return the notebook after its cells were run in a folder."""
    notebook = read()
    client = NotebookClient(
        notebook,
        timeout=300,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(folder)}},
    )
    client.execute()
    return notebook


def kept(output: Output) -> Output | None:
    """Return what the file keeps of an output: no bar that is gone, no page, and no text beside a picture or table."""
    if "data" not in output:
        return output
    data = {kind: value for kind, value in output["data"].items() if 0 < len(value) <= LARGEST}
    if output["output_type"] == "display_data" and not data.keys() - {"text/plain"}:
        return None
    return {**output, "data": {kind: v for kind, v in data.items() if kind != "text/plain" or len(data) == 1}}


def outputs_of(notebook: Any) -> dict[str, list[Output]]:
    """Return the outputs of each cell with code by its first line."""
    return {cell.source.splitlines()[0]: cell.outputs for cell in notebook.cells if cell.cell_type == "code"}


COMMITTED = outputs_of(read())


def test_the_file_is_small_and_knows_nothing_of_the_machine_that_made_it():
    text = NOTEBOOK.read_text(encoding="utf-8")
    assert len(text) < 1_000_000
    assert not re.search(r"/(root|home|tmp|Users|work)/|[A-Z]:\\\\Users|\bat 0x[0-9a-f]{6}", _PICTURE.sub("", text))
    assert all(outputs for line, outputs in COMMITTED.items() if line != "import handover")


@pytest.mark.slow
def test_the_outputs_are_those_of_the_cells(tmp_path: Path):
    made = outputs_of(executed(tmp_path))
    replay = made["run.replay()"][0]["data"]["text/html"]
    assert replay.startswith("<iframe srcdoc=")
    bars = [o for line in ("run = ", "campaign = ") for k in made if k.startswith(line) for o in made[k]]
    assert [o["data"]["text/html"] for o in bars if o["output_type"] == "display_data"] == ["", ""]  # gone at the end
    for line, outputs in COMMITTED.items():
        again = [k for o in made[line] if (k := kept(o)) is not None]
        assert len(again) == len(outputs), line
        for old, new in zip(outputs, again, strict=True):
            assert_alike(old, new)


def assert_alike(old: Output, new: Output) -> None:
    """Assert that two outputs have the same texts, and numbers to the digits that show; of pictures, that both are."""
    assert old["output_type"] == new["output_type"]
    texts = ({"text": o["text"]} if "text" in o else dict(o["data"]) for o in (old, new))
    before, after = ({k: _plain(k, v) for k, v in of.items()} for of in texts)
    assert before.keys() == after.keys()
    for kind, text in before.items():
        assert _NUMBER.split(text) == _NUMBER.split(after[kind])
        numbers = [[float(n) for n in _NUMBER.findall(t)] for t in (text, after[kind])]
        assert numbers[1] == pytest.approx(numbers[0], rel=0.02, abs=0.002)


def _plain(kind: str, text: str) -> str:
    """Return a text without what differs from day to day; "" of a picture."""
    for pattern, name in _VARYING:
        text = pattern.sub(name, text)
    return "" if kind == "image/png" else text


def main() -> None:
    """Run the notebook's cells, and write their outputs into it."""
    with tempfile.TemporaryDirectory(prefix="handover-") as folder:
        notebook = executed(Path(folder))
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [cast(Any, nbformat).from_dict(k) for o in cell.outputs if (k := kept(o)) is not None]
    notebook.metadata["language_info"] = {"name": "python"}
    cast(Any, nbformat).write(notebook, NOTEBOOK)


if __name__ == "__main__":
    main()
