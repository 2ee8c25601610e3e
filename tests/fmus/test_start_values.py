"""An FMU that is built with other start values than its block declares starts from them in every host."""

import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from support.fmus.fmpy_host import Digests, FmpyHost
from support.fmus.workshop import Workshop
from support.wording import Wording

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus.build import build_block, cached

BLOCK = "support.sample_units.every_kind:EveryKind"
START: dict[str, Any] = {
    "gain": 3.5,
    "p0": [4.0, 5.0, 1 / 3],
    "n": 7,
    "fast": True,
    "mood": 5,
    "label": "<other>",
    "a": -0.25,
    "k": 2,
    "mood_in": 1,
}


def outputs(fmu: Path, values: dict[str, Any]) -> list[Digests]:
    """Return the outputs at the start and after two steps, with values that are set."""
    with FmpyHost(fmu) as host:
        host.set(values)
        host.enter()
        host.leave()
        rows = [host.outputs()]
        for k in range(2):
            host.step(k / 100, 1 / 100)
            rows.append(host.outputs())
    return rows


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_starts_from_the_values_that_it_was_built_with(workshop: Workshop, tmp_path: Path, fmi: int):
    declared = workshop.fmu("every_kind:EveryKind", fmi)
    built = build_block(BLOCK, fmi, tmp_path, start=START)
    found = outputs(built, {})
    assert found == outputs(declared, START)
    assert all(a != b for a, b in zip(found, outputs(declared, {}), strict=True))
    with FmpyHost(built) as host:  # and again after a reset
        for values, is_same in (({}, True), ({}, True), ({"mood": 0}, False)):
            host.set(values)
            host.enter()
            host.leave()
            assert (host.outputs() == found[0]) is is_same
            host.fmu.reset()


def test_the_model_description_tells_them_and_the_token_is_its_own(workshop: Workshop, tmp_path: Path):
    built = build_block(BLOCK, 2, tmp_path, start=START)
    d, declared = describe_fmu(built), describe_fmu(workshop.fmu("every_kind:EveryKind", 2))
    reported = {n: p.start for n, p in {**d.parameters, **d.inputs}.items() if n in START}
    assert reported["mood"] == "5"
    assert [float(x) for x in str(reported["p0"]).split()] == START["p0"]
    assert (reported["label"], reported["fast"], reported["mood_in"]) == ("<other>", "true", "1")
    assert d.token != declared.token
    assert d.identifier == declared.identifier
    with zipfile.ZipFile(built) as archive:
        unit = json.loads(archive.read("resources/unit.json"))
        page = archive.read("documentation/index.html").decode()
    assert (unit["token"], unit["start"]) == (d.token, START)
    assert "&lt;other&gt;" in page


def test_what_a_unit_cannot_start_from_is_refused_and_nothing_is_written(tmp_path: Path, wording: Wording):
    refused = [{"moods": 5}, {"b": 1.0}, {"mood": 2}, {"gain": 11.0}, {"p0": [1.0]}, {"label": 3}]
    for start in refused:
        with pytest.raises(DeclarationError) as caught:
            build_block(BLOCK, 3, tmp_path / "out", start=start)
        wording.check(caught.value)
        assert not (tmp_path / "out").exists()


def test_units_of_the_cache_with_and_without_stand_side_by_side():
    plain, other = cached("HandAndObject", 2), cached("HandAndObject", 2, start={"motion": 2})
    assert plain != other
    assert (cached("HandAndObject", 2), cached("HandAndObject", 2, start={"motion": 2})) == (plain, other)
    assert describe_fmu(plain).parameters["motion"].start != describe_fmu(other).parameters["motion"].start == "2"
    assert cached("HandAndObject", 2, start={}) == plain
