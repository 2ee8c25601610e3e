"""What an output depends on is read by what identifies a value: reference and type, whatever names it has."""

from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim import decay
from support.cosim.native_units import Edited, native_fmu

from handover.cosim.exceptions import InitializationError
from handover.cosim.fmu.file.description import FmuDescription, describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

REAL_ALIAS = (
    "</ModelVariables>",
    '<ScalarVariable name="z" valueReference="2" causality="output" variability="continuous"><Real/></ScalarVariable>'
    "</ModelVariables>",
)
"""Another name of the gain's output; its variables are u, y, a, b, so it is the fifth."""


REAL_ALIAS_OF_Y2 = (REAL_ALIAS[0], REAL_ALIAS[1].replace('valueReference="2"', 'valueReference="4"'))


def ring(file: Path, a: float, port: str = "y") -> System:
    """Return two units y = a u + 1, each of which feeds the other."""
    s = System()
    first, second = (s.add(name, file, a=a, b=1.0) for name in ("first", "second"))
    s.connect(getattr(first.y, port), second.u.u)
    s.connect(getattr(second.y, port), first.u.u)
    return s


def assert_is_solved(system: System, a: float) -> None:
    """y = a y + 1 at every communication point, whatever the algorithm."""
    for algorithm in (Algorithm.GAUSS_SEIDEL, Algorithm.JACOBI):
        with Master(system, MasterOptions(algorithm=algorithm)) as master:
            master.run(Fraction(1))
            assert float(master.signals["first.y"]) == pytest.approx(1 / (1 - a), rel=1e-7)


def everything_of(d: FmuDescription) -> tuple[object, ...]:
    return d.feedthrough, d.presumed_feedthrough, d.initial_feedthrough, d.presumed_initial_feedthrough


@pytest.mark.parametrize("fmi", [2, 3])
def test_variables_of_several_types_may_have_one_value_reference_in_fmi_2(fmi: int):
    file = native_fmu("mixed_gain", fmi)
    d = describe_fmu(file)
    references = {p.references for p in (*d.inputs.values(), *d.outputs.values())}
    assert len(references) == (2 if fmi == 2 else 6)
    assert d.feedthrough == d.initial_feedthrough == {"y": ("u",), "n": ("m",), "is": ("was",)}
    assert_is_solved(ring(file, 3.0), 3.0)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_loop_without_a_solution_is_refused_whatever_types_share_its_references(fmi: int):
    with pytest.raises(InitializationError, match=r"algebraic loop: first\.y -> second\.u"):
        Master(ring(native_fmu("mixed_gain", fmi), 1.0)).__enter__()


@pytest.mark.parametrize(
    ("listed", "initially"),
    [
        ('<Unknown index="5" dependencies="1"/>', '<Unknown index="5" dependencies="1"/>'),
        ('<Unknown index="5" dependencies=""/>', ""),
        ("", ""),
    ],
)
def test_aliases_have_the_dependencies_of_each_other(edited: Edited, listed: str, initially: str):
    lists = ("</Outputs>", f"{listed}</Outputs>"), ("</InitialUnknowns>", f"{initially}</InitialUnknowns>")
    file = edited("gain", 2, REAL_ALIAS, *lists)
    both = {"y": ("u",), "z": ("u",)}
    assert everything_of(describe_fmu(file)) == (both, {}, both, {})
    for port in ("y", "z"):
        assert_is_solved(ring(file, 0.5, port), 0.5)


def test_an_alias_without_dependencies_lets_all_inputs_be_presumed(edited: Edited):
    file = edited("two_gains", 2, REAL_ALIAS_OF_Y2, ("</Outputs>", '<Unknown index="7"/></Outputs>'))
    d = describe_fmu(file)
    assert d.feedthrough == {"y1": ("u1",), "y2": ("u2",), "z": ("u2",)}
    assert d.presumed_feedthrough == {"y2": ("u1", "u2"), "z": ("u1", "u2")}


def test_an_output_that_is_an_alias_of_an_input_depends_on_it(edited: Edited):
    alias = (REAL_ALIAS[0], REAL_ALIAS[1].replace('valueReference="2"', 'valueReference="1"'))
    file = edited("gain", 2, alias, ("</Outputs>", '<Unknown index="5" dependencies=""/></Outputs>'))
    assert describe_fmu(file).feedthrough == {"y": ("u",), "z": ("u",)}


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_output_that_is_not_listed_depends_on_all_inputs(edited: Edited, fmi: int):
    entry = '<Unknown index="2" dependencies="1" />' if fmi == 2 else '<Output valueReference="2" dependencies="1" />'
    file = edited("mixed_gain", fmi, (entry, ""))
    d = describe_fmu(file)
    others = {"n": ("m",), "is": ("was",)}
    assert (d.feedthrough, d.presumed_feedthrough) == (others, {"y": ("m", "u", "was")})
    assert d.initial_feedthrough == {**others, "y": ("u",)}  # which is listed
    assert d.presumed_initial_feedthrough == {}
    assert_is_solved(ring(file, 0.5), 0.5)


def test_a_local_integer_beside_a_real_input_is_not_it(tmp_path: Path):
    """Also where a fault elsewhere lets the description be read in its reduced form."""
    integer = '<ScalarVariable name="i" valueReference="1" causality="local" variability="discrete"><Integer/>'
    broken = '<ScalarVariable name="s" valueReference="9" causality="local"><Real derivative="99"/></ScalarVariable>'
    description = decay.edited(
        ("</ModelVariables>", f"{integer}</ScalarVariable>{broken}</ModelVariables>"),
        ('<Unknown index="3" dependencies=""/>', '<Unknown index="3" dependencies="5"/>'),
    )
    d = describe_fmu(decay.pack(tmp_path / "a.fmu", b"", description))
    assert d.untouched_fault
    assert everything_of(d) == ({}, {}, {}, {})
