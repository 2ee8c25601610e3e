"""Docstrings as the documentation page takes them apart."""

from textwrap import dedent

from handover.fmus.contents.documentation import Part, parse

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


def test_paragraphs_formulas_and_lists_keep_their_order():
    assert parse(DOCSTRING).parts == (
        Part("paragraph", ("Goes straight ahead, x = v t.",)),
        Part("paragraph", ("Lines of a paragraph are one text.",)),
        Part("formula", ("F = m a\nM = I w'",)),
        Part("paragraph", ("What it looks at:",)),
        Part("list", ("the first thing, at length,", "the second.")),
    )


def test_errors_are_reported_by_name():
    assert parse(DOCSTRING).errors == (
        ("Unusable", "by the constructor, for a v that is not positive."),
        ("TooFar, TooFast", "by `step`."),
    )


def test_an_empty_docstring_has_no_parts():
    assert parse("") == parse("\n\n")
    assert parse("").parts == ()
