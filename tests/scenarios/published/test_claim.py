"""Claims go to JSON and back, and are formatted in words."""

import json
from dataclasses import replace

import pytest

from handover.scenarios.published.published_experiment import Claim, ComparisonTable, Verdict, verdict_counts

CLAIM = Claim(
    claim="It holds.",
    published="11/15",
    measured="79/80",
    interval=(0.93, 1.0),
    verdict=Verdict.NOT_REPRODUCED,
    reason="By this rule.",
    where="table I",
)


@pytest.mark.parametrize(
    "claim", [CLAIM, Claim(claim="a", published="", measured="", verdict=Verdict.REPRODUCED, reason="")]
)
def test_a_claim_comes_back_from_json_as_it_was(claim: Claim):
    assert Claim.from_data(json.loads(json.dumps(claim.as_data()))) == claim


def test_verdicts_are_written_in_words():
    assert CLAIM.as_data()["verdict"] == "not reproduced"


def test_a_claim_beyond_the_paper_holds_or_not_and_is_counted_apart():
    claims = [replace(CLAIM, verdict=v, beyond=b) for b in (True, False) for v in (*reversed(Verdict), CLAIM.verdict)]
    assert [claims[k].as_data()["verdict"] for k in (0, 4)] == ["too few runs", "not comparable"]
    assert [Claim.from_data(claim.as_data()) for claim in claims] == claims
    assert [(n, words) for n, _, words in verdict_counts(claims, beyond=True)] == [
        (1, "holds"),
        (2, "does not hold"),
        (1, "too few runs"),
    ]
    assert [words for _, _, words in verdict_counts(claims, beyond=False)] == [v.value for v in Verdict]


@pytest.mark.parametrize("change", [{"verdict": "perhaps"}, {"interval": [0.5]}, {"colour": "red"}])
def test_a_claim_of_another_form_is_refused(change: dict[str, object]):
    with pytest.raises((KeyError, TypeError, ValueError, IndexError)):
        Claim.from_data({**CLAIM.as_data(), **change})


def test_a_row_of_another_length_than_the_header_is_refused():
    with pytest.raises(ValueError, match="has 1 cells, the header 2"):
        ComparisonTable(title="t", header=["a", "b"], rows=[["1"]])


def test_a_column_that_a_quick_plan_leaves_empty_is_not_shown():
    table = ComparisonTable(title="t", header=["a", "b", "c"], rows=[["1", "", "3"], ["4", "", ""]], note="n")
    shown = table.without_empty_columns()
    assert (shown.header, shown.rows) == (["a", "c"], [["1", "3"], ["4", ""]])
    assert (shown.title, shown.note) == ("t", "n")
