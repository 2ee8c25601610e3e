"""Stepping from Python: what is set acts, what is saved comes back, and the evaluation follows as in a run."""

import shutil
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.kept_runs import kept_run
from support.wording import Wording

import handover
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.time_series import TimeSeries
from handover.scenarios.runs.execution.file_experiment import UntilStop


def gain(fmu: Path) -> handover.System:
    s = handover.System()
    s.add("gain", fmu, a=2.0)
    return s


@pytest.mark.parametrize(("fmi", "isolate"), [(2, ()), (3, ()), (3, ("gain",))])
def test_a_free_input_acts_in_the_steps_that_follow(fmi: int, isolate: tuple[str, ...]):
    with handover.open(gain(native_fmu("gain", fmi)), isolate=isolate) as s:
        assert s.inputs == ("gain.u",)
        s["gain.u"] = 3.0
        assert s["gain.u"] == 3.0
        s.step(0.1)
        assert s["gain.y"] == 6.0
        s["gain.u"] = -1.0
        assert s["gain.y"] == 6.0
        s.step(0.1)
        assert s["gain.y"] == -2.0
        assert s["gain.a"] == 2.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_tunable_parameter_may_change(fmi: int):
    fmu = native_fmu("tuned_gain", fmi)
    assert handover.describe(fmu).parameters["a"].tunable
    with handover.open(gain(fmu)) as s:
        s["gain.u"] = 1.0
        s.step(0.1)
        s["gain.a"] = 5.0
        assert s["gain.a"] == 5.0
        s.step(0.1)
        assert s["gain.y"] == 5.0


def test_units_of_a_session_that_is_closed_are_not_called():
    """A call of a unit that is freed would end the program."""
    with handover.open(gain(native_fmu("tuned_gain", 3))) as s:
        s.step(0.1)
        state = s.save()
    for call in (s.save, partial(s.restore, state), partial(s.__getitem__, "gain.a"), partial(s.step, 0.1)):
        with pytest.raises(RuntimeError, match="the units are freed"):
            call()
    with pytest.raises(RuntimeError, match="the units are freed"):
        s["gain.a"] = 2.0


def test_what_cannot_be_set_or_read_is_refused(wording: Wording):
    s = handover.open("ir_grasp")
    calls: list[Callable[[], object]] = [
        *(partial(s.__setitem__, name, 1.0) for name in ("scene.p_WH_cmd", "reflex.damping", "scene.p_WH", "sene.yaw")),
        lambda: s["scene.p_WHH"],
        lambda: s[3],  # type: ignore
        lambda: s.step(0),
        lambda: s.step(None),  # type: ignore
        lambda: s.restore(3),  # type: ignore
    ]
    with s:
        for call in calls:
            with pytest.raises((handover.InvalidInput, KeyError)) as e:
                call()
            wording.check(e.value)
    with handover.open("flyer_impedance") as s, pytest.raises(handover.InvalidInput) as e:
        s["thrusters.f_pose"] = 1.0
    wording.check(e.value)


def test_durations_add_up_exactly():
    with handover.open(gain(native_fmu("gain"))) as s:
        assert [s.step(0.1) for _ in range(10)][-1] == 1.0
        assert s.outcome.reason == "ran to 1 s"  # without a stop time
        assert s.step(0.05) == 1.1  # the first communication point at or after it
        assert s.step(0.05) == 1.1


def test_a_scenario_that_is_stepped_ends_as_its_run():
    run = handover.Run(kept_run("run", "ir_grasp", "--seed", "3", "-p", "strategy=blind", "--no-report"))
    with handover.open("ir_grasp", seed=3, strategy="blind") as s:
        seen: list[np.ndarray[tuple[int], np.dtype[np.float64]]] = []
        while not s.over and s.time < s.stop:
            s.step(0.3)
            seen.append(s["scene.p_WH"])
        rows = [round(0.3 * (k + 1) / 0.015) for k in range(len(seen) - 1)]
        assert np.array_equal(seen[:-1], run.signals["scene.p_WH"][rows])
        assert s.time == run.signals.time[-1]
        assert s.text("reflex.phase") == "DONE"
        outcome = s.outcome
        assert (outcome.success, outcome.reason) == (run.success, run.reason)
        assert outcome.metrics["displacement"].value == run.metrics["displacement"]
        assert s.outcome == outcome


def test_the_whole_state_is_saved_and_restored():
    with handover.open("flyer_impedance", seed=2) as s:
        s["thrusters.f_pose"] = [0.5, 0.0, 0.0]
        s.step(0.7)
        state = s.save()
        s["thrusters.f_pose"] = [0.0, 0.0, 0.0]
        rest = [s.step(0.25) for _ in range(4)]
        p_free = s["navigation.p_WB_meas"]
        s.restore(state)
        assert s["thrusters.f_pose"].tolist() == [0.5, 0.0, 0.0]
        s.step(1)
        p_pushed, outcome = s["navigation.p_WB_meas"], s.outcome
        assert not np.array_equal(p_free, p_pushed)
        with handover.open("flyer_impedance", seed=5) as other:
            for again in (s, other):
                again.restore(state)
                assert again.time == pytest.approx(0.704)
                again["thrusters.f_pose"] = [0.0, 0.0, 0.0]
                assert [again.step(0.25) for _ in range(4)] == rest
                assert np.array_equal(again["navigation.p_WB_meas"], p_free)
                again.restore(state)
                again.step(1)
                assert np.array_equal(again["navigation.p_WB_meas"], p_pushed)
                assert again.outcome == outcome


@pytest.mark.parametrize(
    ("subject", "before", "after", "named"),
    [
        ("flyer_impedance", {"force": 3.0}, {}, ["force", "push.force"]),
        ("ir_grasp", {"seed": 1}, {"seed": 2}, ["scene.p_WO_0"]),
        (native_fmu("mass"), {"m": 2.0}, {}, ["mass.m"]),
    ],
)
def test_a_state_of_a_session_with_other_parameters_is_refused(
    subject: str | Path, before: dict[str, Any], after: dict[str, Any], named: list[str]
):
    with handover.open(subject, **before) as s:
        state = s.save()
    with handover.open(subject, **after) as s, pytest.raises(handover.InvalidInput) as refused:
        s.restore(state)
    assert all(f"{name} was " in str(refused.value) for name in named)


def test_a_state_of_other_wiring_or_of_another_fmu_is_refused():
    def chain(fed: str, fmi: int = 3) -> handover.System:
        s = handover.System()
        a, b, last = (s.add(name, native_fmu("gain", fmi if name == "a" else 3)) for name in ("a", "b", "last"))
        s.connect({"a": a, "b": b}[fed].y.y, last.u.u)
        return s

    with handover.open(chain("a")) as s:
        state = s.save()
        s.restore(state)
    followed = chain("a")
    followed.follow(followed.units["a"].u.u, TimeSeries([0.0], [[3.0]], linear=False))
    for other, named in (
        (chain("b"), "last.u was a.y and is b.y"),
        (chain("a", 2), "the FMU of a was "),
        (followed, "what feeds a.u was as usual and is values over time"),
    ):
        with handover.open(other) as s, pytest.raises(handover.InvalidInput) as refused:
            s.restore(state)
        assert named in str(refused.value)


def test_what_a_run_warns_of_and_strict_refuses_is_so_in_a_session(caplog: pytest.LogCaptureFixture):
    system = gain(native_fmu("gain"))
    system.tolerate("something is odd")
    with handover.open(system):
        assert "something is odd" in caplog.messages
    with pytest.raises(handover.InvalidInput, match="something is odd"):
        handover.open(system, options=handover.MasterOptions(strict=True))


@pytest.mark.parametrize("name", ["stop", "inputs", "out"])
def test_arguments_of_runs_alone_are_reported_as_such(name: str):
    with pytest.raises(handover.InvalidInput) as refused:
        handover.open(native_fmu("gain"), **dict[str, Any]({name: 1}))
    assert f"; {name}: a session " in str(refused.value)
    assert "is meant as" not in str(refused.value)


def test_what_the_evaluation_sees_of_a_vacant_place_is_restored_too():
    with handover.environment("flyer_impedance", "impedance") as agent:
        agent.reset(seed=1)
        session = agent.session
        assert session is not None
        state, metrics = session.save(), set(session.outcome.metrics)
        session["impedance.pole_radius"] = 0.5
        session.step(0.1)
        session.restore(state)
        assert set(session.outcome.metrics) == metrics


def test_a_state_of_another_system_and_a_unit_without_states_are_refused_and_a_system_is_not_changed():
    with handover.open(handover.unit("Push"), step=0.1) as a:
        state = a.save()
    system = gain(native_fmu("gain"))
    with handover.open(system) as b, pytest.raises(handover.InvalidInput, match="a checkpoint of the units"):
        b.restore(state)
    assert not system.followed
    unable = gain(native_fmu("gain", 2, canGetAndSetFMUstate=False))
    with handover.open(unable) as s, pytest.raises(handover.InvalidInput, match="canGetAndSetFMUstate"):
        s.save()


def test_it_begins_at_the_start_that_is_given(tmp_path: Path):
    fmu = shutil.copyfile(native_fmu("clerk"), tmp_path / "clerk.fmu")
    with handover.open(fmu, start=-2, step=0.25) as s:
        assert (s.time, s["clerk.start"], s["clerk.stop"]) == (-2.0, -2.0, -1.0)  # no stop time is defined
        assert s.step(0.25) == s["clerk.now"] == -1.75
        saved = s.save()
        s.step(1)
        s.restore(saved)
        assert s.step(0.25) == s["clerk.now"] == -1.5
    with pytest.raises(handover.InvalidInput, match="a scenario begins at 0 s"):
        handover.open("ir_grasp", start=1)


@pytest.mark.parametrize(("start", "before"), [(-1, ()), (0, ()), (0, (1,)), (1, (1,))])
def test_a_restored_evaluation_sees_each_point_once(start: int, before: Sequence[int], monkeypatch: pytest.MonkeyPatch):
    seen: list[float] = []
    monkeypatch.setattr(UntilStop, "__call__", lambda _self, t, _signals: seen.append(t))  # type: ignore
    with handover.open(gain(native_fmu("gain")), start=start) as s:
        for duration in before:
            s.step(duration)
        saved, until_then = s.save(), len(seen)
        s.step(1)
        rest = seen[until_then:]
        seen.clear()
        s.restore(saved)
        s.step(1)
        assert seen == rest
    assert rest[-1] == start + len(before) + 1
    assert (rest[0] == start) == (not before)


def test_an_ssp_and_an_fmu_are_stepped(tmp_path: Path):
    fmu = shutil.copyfile(native_fmu("gain"), tmp_path / "gain.fmu")
    with handover.open(fmu, a=3, u=2) as s:
        s.step(0.1)
        assert s["gain.y"] == 6.0
    write_ssp(gain(fmu), tmp_path / "gain.ssp", "gain", Fraction(1))
    with handover.open(tmp_path / "gain.ssp", step=0.1) as s:
        s["gain.u"] = 2.0
        s.step(0.1)
        assert s["gain.y"] == 4.0
