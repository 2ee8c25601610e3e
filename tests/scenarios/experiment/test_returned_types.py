"""What a scenario's author returns in a wrong type is refused, with the type that is right and an example."""

import re
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from click.testing import CliRunner

from handover.scenarios import catalog
from handover.scenarios.catalog import InvalidScenario, named_scenario
from handover.scenarios.cli.command import main
from handover.scenarios.experiment import experiment, replay, time_plot
from handover.scenarios.experiment.experiment import Evaluator, Experiment, Metric, Outcome
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.replay import Line, Replay
from handover.scenarios.experiment.returned_types import Expected, WrongArguments, WrongType
from handover.scenarios.experiment.time_plot import Curve, Level, TimeFigure, TimePlot
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

CURVE = Curve(label="x", values=np.zeros(3))
PLOT = TimePlot(title="x", quantity="x", unit="", curves=[CURVE])
FIGURE = TimeFigure(name="x", caption="", plots=[PLOT])


def giving(value: Any) -> Any:
    def give(*_: Any) -> Any:
        return value

    return give


def scenario(**returned: Any) -> Any:
    """Return a scenario, or an evaluator, whose methods return what is given."""
    methods = {name: giving(value) for name, value in returned.items()}
    return type("Wrong", (Experiment,), methods | dict.fromkeys({"build", "stop_time", "evaluator"} - {*methods}))()


def evaluator(**returned: Any) -> Any:
    methods = {name: giving(value) for name, value in returned.items()}
    others = dict.fromkeys({"__call__", "over", "outcome"} - {*methods})
    if "over" in methods:
        methods["over"] = property(methods["over"])
    return type("Wrong", (Evaluator,), methods | others)()


@pytest.mark.parametrize(
    ("method", "value", "right", "example"),
    [
        ("time_figures", None, "list or tuple of TimeFigure", "[TimeFigure("),
        ("time_figures", [PLOT], "list or tuple of TimeFigure", "[TimeFigure("),
        ("time_figures", {"x": FIGURE}, "list or tuple of TimeFigure", "[TimeFigure("),
        ("time_figures", [FIGURE, FIGURE], "each with a name of its own", "[TimeFigure("),
        ("replay", [Replay()], "a Replay or None", "Replay("),
        ("draw", None, "list or tuple of Figure", "[Figure("),
        ("published", None, "list or tuple of PublishedValue", "[PublishedValue("),
        ("pushes", None, "list or tuple of Pushable", "[Pushable("),
        ("cycle", "controller", "list or tuple of str", '("controller",)'),
        ("stop_time", float("inf"), "a number of seconds", "Fraction(5)"),
        ("step_in_parallel", 0.01, "a Fraction", "Fraction(1, 500)"),
        ("build", None, "a System", "System()"),
        ("evaluator", Evaluator, "an Evaluator", "Evaluator"),
        ("parameter_files", None, "names to Path", "{"),
        ("led_hand", True, "a LedHand or None", "LedHand("),
    ],
)
def test_a_scenarios_method_names_the_type_that_is_right(method: str, value: Any, right: str, example: str):
    with pytest.raises(WrongType) as raised:
        getattr(scenario(**{method: value}), method)(*[None] * 4)
    reported = str(raised.value)
    assert reported.startswith("Wrong.")
    assert f"({Path(__file__).name}, line " in reported
    assert right in reported.partition("; expected ")[2].partition(", such as ")[0]
    assert example in reported.partition(", such as ")[2]


@pytest.mark.parametrize("method", ["build", "replay"])
def test_a_method_that_takes_other_arguments_is_refused_as_its_class_is_made(method: str):
    def take(self: Any) -> None: ...

    with pytest.raises(WrongArguments) as raised:
        type("Wrong", (Experiment,), {method: take})
    assert f"({Path(__file__).name}, line " in str(raised.value)


def test_an_evaluators_types_are_checked_too_and_that_its_end_is_no_method_before_the_run():
    metres = Outcome(success=True, reason="", metrics={"far": Metric(0.5, "metres")})
    for method, value in (("outcome", True), ("outcome", metres), ("over", None), ("pictures", None)):
        judge = evaluator(**{method: value})
        with pytest.raises(WrongType, match=r"^Wrong\..*; expected .*, such as "):
            _ = judge.over if method == "over" else getattr(judge, method)()
    called: Any = type("Forgetful", (Evaluator,), dict.fromkeys(("__call__", "over", "outcome"), giving(False)))
    with pytest.raises(WrongType, match=r"^Forgetful.over is a method; expected a property, such as @property"):
        scenario(evaluator=called()).bound_evaluator(None)


WRONG = cast(Any, None)


@pytest.mark.parametrize(
    "make",
    [
        lambda: TimeFigure(name="x", caption="", plots=cast(Any, PLOT)),
        lambda: TimeFigure(name="x/y", caption="", plots=[PLOT]),
        lambda: Level(label="x", value=cast(Any, "5 mm")),
        lambda: TimePlot(title="x", quantity="x", unit="", curves=[cast(Any, np.zeros(3))]),
        lambda: TimePlot(title="x", quantity="x", unit="", curves=[CURVE], levels=[cast(Any, 0.5)]),
        lambda: Curve(label="x", values=np.zeros((3, 2))),
        lambda: Curve(label="x", values=WRONG),
        lambda: Line(label="x", colour="#000000", points=np.zeros((3, 3))),
        lambda: Replay(lines=cast(Any, np.zeros((3, 2, 3)))),
        lambda: Metric(cast(Any, "0.5")),
        lambda: Metric(cast(Any, np.zeros(2))),
        lambda: Outcome(success=WRONG, reason=""),
        lambda: Line(label="x", colour="bleu", points=np.zeros((1, 3, 3))),
        lambda: Line(label="x", colour="#000000", points=np.zeros((1, 3, 3)), opacity=cast(Any, "half")),
        lambda: TimePlot(title=cast(Any, 3), quantity="x", unit="", curves=[CURVE]),
        lambda: TimePlot(title="x", quantity="x", unit="", curves=[CURVE], limits=cast(Any, 3)),
        lambda: Curve(label="x", values=np.zeros(3), stroke=cast(Any, "thick")),
        lambda: Replay(eye=cast(Any, (1.0, 1.0))),
        lambda: Pushable(labels=cast(Any, "arm"), unit="arm", force="f", point=None, greatest=5.0),
        lambda: Outcome(success=True, reason="", metrics=cast(Any, {"x": 0.5})),
    ],
)
def test_what_they_return_is_checked_where_it_is_made(make: Any):
    faults = ToleratedFaults()
    with faults.tolerated("not drawn"):
        make()
    (line,) = faults.lines
    assert re.search(r"^not drawn: .*; expected .*, such as .*\(test_returned_types.py, line \d+\)$", line)


def test_the_examples_are_of_the_types_that_they_stand_for():
    record = {"arm.p_WG": np.zeros((3, 3)), "robot.p_WB": np.zeros((3, 3)), "robot.q_WB": np.zeros((3, 4))}
    known = {name: value for module in (experiment, replay, time_plot, catalog) for name, value in vars(module).items()}
    known |= {"np": np, "p": np.zeros(3), "record": record, "points": np.zeros((3, 2, 3))}
    expected: list[Any] = []
    for value in known.values():
        expected += cast(dict[str, Any], value).values() if type(value) is dict else [value]
    tried = 0
    for each in (e for e in expected if isinstance(e, Expected) and "..." not in e.example):
        try:
            code = compile(each.example, "example", "eval")
        except SyntaxError:  # in words
            continue
        if not {"self", "phases_of"} & {*code.co_names}:
            assert each.fits(eval(code, known)), each.example
            tried += 1
    assert tried > 15


SCENE = """
from fractions import Fraction

from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Experiment


class Scene(Experiment):
    units = {{"push": "Push"}}
    {attribute}

    def build(self, parameters, seed, fmu):
        s = System()
        s.add("push", fmu("push"))
        return s

    def stop_time(self, parameters):
        return Fraction(1)

    def evaluator(self, parameters):
        return self
"""


def test_a_run_is_refused_in_one_line_before_it_begins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "judged_by_itself.py").write_text(SCENE.format(attribute=""))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    done = CliRunner().invoke(main, ["run", "judged_by_itself:Scene", "--out", "out"])
    assert done.exit_code == 2, done.output
    (line,) = done.output.splitlines()
    assert "Scene.evaluator (judged_by_itself.py, line " in line
    assert "returned a Scene; expected an Evaluator" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("attribute", ['headline = "distance"', 'places = ["push"]', 'unit_files = ("push.model")'])
def test_a_text_where_names_are_right_is_refused(attribute: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    name = f"wrong_{attribute.split()[0]}"
    (tmp_path / f"{name}.py").write_text(SCENE.format(attribute=attribute))
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InvalidScenario, match=r"its '\w+' is .*; expected .*, such as "):
        named_scenario(f"{name}:Scene")


def test_right_types_are_taken():
    right = scenario(time_figures=(FIGURE,), stop_time=0.5, step_in_parallel=Fraction(1, 500), cycle=())
    assert right.time_figures(None, None) == (FIGURE,)
    assert right.stop_time(None) == 0.5
    assert evaluator(over=np.bool_(True)).over
    assert Metric(cast(Any, np.float32(0.5))).value == 0.5
