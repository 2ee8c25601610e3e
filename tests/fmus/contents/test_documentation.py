"""documentation/index.html: how it describes a unit, whose docstring it takes apart."""

import re
import zipfile
from fractions import Fraction
from pathlib import Path
from textwrap import dedent

import pytest
from support.fmus.workshop import Workshop

from handover.fmus.contents.documentation import PAPERS, Part, cited, parse, seconds

HOUSE = Path(__file__).parents[3]


def page_of(workshop: Workshop, block: str, fmi: int, *, scalar: bool = False) -> str:
    with zipfile.ZipFile(workshop.scalar_fmu(block) if scalar else workshop.fmu(block, fmi)) as archive:
        return archive.read("documentation/index.html").decode()


@pytest.mark.parametrize(
    ("fmi", "scalar", "integer", "real"),
    [(2, False, "Integer", "Real"), (3, False, "Int64", "Float64"), (3, True, "Int32", "Float64")],
)
def test_types_are_those_of_the_model_description(fmi: int, scalar: bool, integer: str, real: str, workshop: Workshop):
    page = page_of(workshop, "every_kind:EveryKind", fmi, scalar=scalar)
    assert f"<code>k</code></td><td>{integer}</td>" in page
    assert f"<code>a</code></td><td>{real}</td>" in page
    assert "<code>mood</code></td><td>Mood</td>" in page
    assert "<dt>Mood</dt><dd>0 CALM, 1 KEEN, 5 WILD</dd>" in page
    assert "<td>diag(1, 1, 1)</td>" in page
    assert ("R[1,2]" in page) is (scalar or fmi == 2)


def test_the_clock_is_named_where_there_is_one(workshop: Workshop):
    pages = [page_of(workshop, "sampled:Sampled", fmi) for fmi in (2, 3)]
    assert ["sample_clock" in page for page in pages] == [False, True]
    assert all("Sampled with a period of 1/30 s" in page for page in pages)


def test_the_variables_of_the_environment_are_those_that_the_runtime_reads(workshop: Workshop):
    runtime = "".join(file.read_text() for file in (HOUSE / "fmus" / "runtime").glob("*.c"))
    read = set(re.findall(r'"(FMU_[A-Z_]+)"', runtime))
    assert read == set(re.findall(r"<dt><code>(FMU_\w+)</code></dt>", page_of(workshop, "scalars:Scalars", 3)))


def test_times_are_decimal_where_that_is_exact():
    assert [seconds(Fraction(t)) for t in ("2/125", "1/30", "240")] == ["0.016 s", "1/30 s", "240 s"]


DOCSTRING = dedent(
    """\
    Goes straight ahead, x = v t.

    Lines of a paragraph
    are one text.

        F = m a
        M = I w'

    What it looks at:
    - the first thing,
      at length,
    - the second.

    Raises:
        Unusable: by the constructor, for a v
            that is not positive.
        TooFar, TooFast: by `step`.
    """
)


def test_paragraphs_formulas_lists_and_errors_of_a_docstring_keep_their_order():
    parsed = parse(DOCSTRING)
    assert parsed.parts == (
        Part("paragraph", ("Goes straight ahead, x = v t.",)),
        Part("paragraph", ("Lines of a paragraph are one text.",)),
        Part("formula", ("F = m a\nM = I w'",)),
        Part("paragraph", ("What it looks at:",)),
        Part("list", ("the first thing, at length,", "the second.")),
    )
    assert parsed.errors == (
        ("Unusable", "by the constructor, for a v that is not positive."),
        ("TooFar, TooFast", "by `step`."),
    )
    assert parse("") == parse("\n\n")
    assert parse("").parts == ()


def test_papers_are_called_as_where_their_numbers_are():
    content = [
        " ".join(file.read_text().replace("\n# ", " ").split()) for file in HOUSE.glob("scenarios/robots/*/paper.toml")
    ]
    for key, paper in PAPERS.items():
        assert any(f"# {paper} [{key}]." in text for text in content), key


def test_every_paper_that_a_block_cites_is_known():
    sources = [file.read_text() for folder in ("plants", "controllers") for file in (HOUSE / folder).rglob("*.py")]
    dated = {key for source in sources for key in re.findall(r"\[([A-Z][a-z]+\d{4}\w?)\]", source)}
    after = {key for source in sources for key in re.findall(r"(?:after|of|see) \[([A-Z]\w+)\]", source)}
    assert dated | after == set(PAPERS) == set(cited("\n".join(sources)))
