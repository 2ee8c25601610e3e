"""documentation/index.html: how it describes a unit."""

import re
import zipfile
from fractions import Fraction
from pathlib import Path

import pytest

from handover.fmus.build import build_block
from handover.fmus.contents.documentation import PAPERS, cited, seconds

HOUSE = Path(__file__).parents[3]


def page_of(block: str, folder: Path, fmi: int, *, scalar: bool = False) -> str:
    with zipfile.ZipFile(build_block(f"support.sample_units.{block}", fmi, folder, scalar=scalar)) as archive:
        return archive.read("documentation/index.html").decode()


@pytest.mark.parametrize(
    ("fmi", "scalar", "integer", "real"),
    [(2, False, "Integer", "Real"), (3, False, "Int64", "Float64"), (3, True, "Int32", "Float64")],
)
def test_types_are_those_of_the_model_description(fmi: int, scalar: bool, integer: str, real: str, tmp_path: Path):
    page = page_of("every_kind:EveryKind", tmp_path, fmi, scalar=scalar)
    assert f"<code>k</code></td><td>{integer}</td>" in page
    assert f"<code>a</code></td><td>{real}</td>" in page
    assert "<code>mood</code></td><td>Mood</td>" in page
    assert "<dt>Mood</dt><dd>0 CALM, 1 KEEN, 5 WILD</dd>" in page
    assert "1, 0, 0; 0, 1, 0; 0, 0, 1" in page


def test_the_clock_is_named_where_there_is_one(tmp_path: Path):
    pages = [page_of("sampled:Sampled", tmp_path, fmi, scalar=scalar) for fmi, scalar in ((2, False), (3, False))]
    assert ["sample_clock" in page for page in pages] == [False, True]
    assert all("Sampled with a period of 1/30 s" in page for page in pages)


def test_the_variables_of_the_environment_are_those_that_the_runtime_reads(tmp_path: Path):
    runtime = "".join(file.read_text() for file in (HOUSE / "fmus" / "runtime").glob("*.c"))
    read = set(re.findall(r'"(FMU_[A-Z_]+)"', runtime))
    assert read == set(re.findall(r"<dt><code>(FMU_\w+)</code></dt>", page_of("scalars:Scalars", tmp_path, 3)))


@pytest.mark.parametrize(("time", "content"), [(Fraction(2, 125), "0.016 s"), (Fraction(1, 30), "1/30 s")])
def test_times_are_decimal_where_that_is_exact(time: Fraction, content: str):
    assert seconds(time) == content


def test_papers_are_called_as_where_their_numbers_are():
    content = [" ".join(file.read_text().replace("\n# ", " ").split()) for file in HOUSE.glob("scenarios/*/paper.toml")]
    for key, paper in PAPERS.items():
        assert any(f"# {paper} [{key}]." in text for text in content), key


def test_every_paper_that_a_block_cites_is_known():
    sources = [file.read_text() for folder in ("plants", "controllers") for file in (HOUSE / folder).rglob("*.py")]
    dated = {key for source in sources for key in re.findall(r"\[([A-Z][a-z]+\d{4}\w?)\]", source)}
    after = {key for source in sources for key in re.findall(r"(?:after|of|see) \[([A-Z]\w+)\]", source)}
    assert dated | after == set(PAPERS) == set(cited("\n".join(sources)))
