import base64
import contextlib
import functools
import json
import operator
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.wording import Wording

from handover.controllers.vsl.fit import fit_adapted, fit_cubic, fit_friction
from handover.controllers.vsl.hybrid_kinematics import shipped_file
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import (
    Cubic,
    ForwardInput,
    Learned,
    VslModel,
    hull_directions,
    inputs_of,
    rotate_about_z,
)
from handover.controllers.vsl.model_text import InvalidModel, model_text, parse_model, read_model
from handover.cosim.blocks.ports import Floats

RNG = np.random.default_rng(5)
X = RNG.uniform([-1.0, 0.0, 5e4], [2.0, 0.1, 2e5], (200, 3))


def cubic_values(x: Floats) -> Floats:
    a, b, c = x[:, 0], x[:, 1] * 10.0, x[:, 2] / 1e5
    return np.column_stack([1.0 + a - 2.0 * b * c + a**3 - a * b * c, c**3 + b**2 * a, np.full(len(x), 0.3)])


@functools.cache
def fitted() -> Cubic:
    return fit_cubic(X[:150], cubic_values(X[:150]), X[150:], cubic_values(X[150:])).cubic


@functools.cache
def model() -> VslModel:
    x = np.random.default_rng(1).normal(size=(300, 7))
    y = np.column_stack([x[:, 0] * x[:, 3], x[:, 1] ** 3, x[:, 2] - x[:, 6]])
    fit = fit_cubic(x[:200], y[:200], x[200:], y[200:])
    return VslModel(fit.cubic, fit.cubic, VslKinematics(0.15, 0.225, 0.225, Elbow.UP), {"seed": 1})


KINDS = ["cubic", "small", "physics", "friction"]
SHIPPED = [(shipped_file(kind)).read_text() for kind in KINDS]


def slopes(f: Callable[[Floats], Floats], at: Floats, step: float) -> Floats:
    """Return df/dx by central differences, a column an input."""
    return np.transpose([(f(at + h) - f(at - h)) / (2.0 * step) for h in step * np.eye(len(at))])


def adapted() -> VslModel:
    """Return a model adapted to an arm whose residuals are nine tenths of what they were, and a little off."""
    m, x = model(), np.random.default_rng(4).normal(size=(60, 7))
    inverse, forward = (fit_adapted(r, x, 0.9 * r.predict(x) + 0.01) for r in (m.inverse, m.forward))
    return VslModel(inverse, forward, m.kinematics, {"seed": 2})


def test_ridge_recovers_a_cubic():
    inside = X[:150].min(0) + 0.02 * np.ptp(X[:150], axis=0), X[:150].max(0) - 0.02 * np.ptp(X[:150], axis=0)
    fresh = RNG.uniform(*inside, (50, 3))
    np.testing.assert_allclose(fitted().predict(fresh), cubic_values(fresh), atol=1e-7)
    np.testing.assert_allclose(fitted().predict(fresh[0]), cubic_values(fresh[:1])[0], atol=1e-7)


def test_the_penalty_is_per_point_and_chosen_on_the_validation_points():
    x, y = X[:40], cubic_values(X[:40]) + np.random.default_rng(0).normal(0.0, 0.3, (40, 3))
    once, twice = (fit_cubic(np.tile(x, (n, 1)), np.tile(y, (n, 1)), X[40:], cubic_values(X[40:])) for n in (1, 2))
    assert once.penalty == twice.penalty > 1e-10
    assert once.validation_rms < 0.5
    np.testing.assert_allclose(twice.cubic.predict(X), once.cubic.predict(X), atol=1e-6)


def test_hull_holds_its_points_and_touches_them():
    z = (X[:150] - fitted().mean) / fitted().scale
    directions = hull_directions(3)
    assert directions.shape == (18, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(np.max(z @ np.transpose(directions), axis=0), fitted().hull, atol=1e-8)
    assert not any(fitted().outside(x) for x in X[:150])


def test_points_beyond_an_axis_or_a_corner_are_outside():
    for x in ([2.1, 0.05, 1e5], [0.5, 0.05, 4e4], [0.5, np.nan, 1e5]):
        assert fitted().outside(np.array(x))
    x = RNG.normal(size=(300, 2))
    x = x[np.sum(x**2, axis=1) < 1.0]
    disc = fit_cubic(x, x, x, x).cubic
    corner = disc.mean + 0.9 * disc.scale * disc.hull[[0, 2]]
    assert disc.outside(corner)
    assert not disc.outside(0.7 * corner)


def test_beyond_the_sides_the_polynomial_stays_what_it_is_there():
    cubic = fitted()
    edge = cubic.mean + cubic.scale * cubic.hull[0:6:2]
    np.testing.assert_array_equal(cubic.predict(edge + 10.0 * cubic.scale), cubic.predict(edge + cubic.scale))
    np.testing.assert_allclose(cubic.predict(edge + cubic.scale), cubic.predict(edge), atol=1e-6)
    assert np.all(cubic.jacobian(edge + 10.0 * cubic.scale) == 0.0)
    np.testing.assert_allclose(cubic.jacobian(X[:5])[3], cubic.jacobian(X[3]), rtol=1e-9)


def test_the_forward_residual_turns_with_joint_1():
    m, p, i = model(), np.array([0.1, 0.2]), np.array([9.0, 0.3, 0.4])
    q = np.array([0.6, 0.5, -1.0])
    residual = m.forward.predict(np.array([0.6, 0.5, -1.0, 0.1, 0.2, 0.3, 0.4]))
    np.testing.assert_allclose(m.tip(q, p, i), m.kinematics.forward(q) + rotate_about_z(residual, 0.6), atol=1e-15)
    np.testing.assert_allclose(rotate_about_z(np.array([1.0, 0.0, 2.0]), np.pi / 2), [0.0, 1.0, 2.0], atol=1e-15)


@pytest.mark.parametrize("text", SHIPPED, ids=KINDS)
def test_the_corrected_jacobian_is_the_derivative_of_the_tip(text: str):
    m = parse_model(text, "that ships")
    q, p, i = np.array([0.4, 0.6, -1.2]), np.array([0.9e5, 1.2e5]), np.array([0.0, 0.7, 0.15])
    np.testing.assert_allclose(m.tip_jacobian(q, p, i), slopes(lambda q: m.tip(q, p, i), q, 1e-4), atol=2e-6)
    assert np.max(np.abs(m.tip_jacobian(q, p, i) - m.kinematics.jacobian(q))) > 0.005


def test_a_published_model_gives_angles_and_position_themselves():
    cubic, m = read_model(shipped_file("cubic")).forward, model()
    assert isinstance(cubic, Cubic)
    by_X = Cubic(np.array([0.3, 0.0, 0.15, *cubic.mean[3:]]), cubic.scale, cubic.hull, cubic.powers, cubic.coefficients)
    q, p, i = np.array([0.3, 0.6, -1.2]), np.array([0.9e5, 1.2e5]), np.array([0.0, 0.7, 0.15])
    for kind in (Learned.CUBIC, Learned.PUBLISHED):
        made = VslModel(m.inverse, by_X, m.kinematics, {}, kind, ForwardInput.X)
        slope = slopes(lambda q, made=made: made.tip(q, p, i), q, 1e-5)
        np.testing.assert_allclose(made.tip_jacobian(q, p, i), slope, atol=1e-7)
    np.testing.assert_array_equal(made.command(q, p, i), m.inverse.predict(inputs_of(q, p, i)))
    np.testing.assert_array_equal(made.tip(q, p, i), by_X.predict(inputs_of(m.kinematics.forward(q), p, i)))


def test_few_points_are_enough_to_adapt():
    m, fresh = adapted(), np.random.default_rng(9).normal(size=(100, 7))
    for now, was in ((m.inverse, model().inverse), (m.forward, model().forward)):
        expected = 0.9 * was.predict(fresh) + 0.01
        error = np.sqrt(np.mean((now.predict(fresh) - expected) ** 2))
        assert error < 0.05 * np.sqrt(np.mean((was.predict(fresh) - expected) ** 2))


def test_friction_in_the_currents_is_found():
    rng = np.random.default_rng(3)
    clean = rng.uniform(-1.0, 1.0, (600, 4))
    directions = rng.choice([-1.0, 1.0], (600, 2))
    y = np.column_stack([clean[:, 2] + clean[:, 0] * clean[:, 3], clean[:, 3] - 0.5 * clean[:, 2] ** 2, clean[:, 1]])
    measured: Floats = np.array(clean)
    measured[:, 2:] += directions * [0.3, 0.2]

    def inputs_at(c: Floats) -> Floats:
        return np.column_stack([measured[:, :2], measured[:, 2:] - c * directions])

    assert fit_friction(inputs_at, directions, y) == pytest.approx((0.3, 0.2), rel=0.02)


@pytest.mark.parametrize("text", SHIPPED, ids=KINDS)
def test_what_ships_is_what_would_be_written(text: str):
    assert model_text(parse_model(text, "that ships")) == text


def test_text_and_model_are_the_same(tmp_path: Path):
    x = np.linspace(-1.0, 1.0, 7)
    for made in (model(), adapted()):
        (tmp_path / "m.json").write_text(model_text(made))
        back = read_model(tmp_path / "m.json")
        assert model_text(back) == model_text(made)
        assert back.kinematics == made.kinematics
        for which in ("inverse", "forward"):
            np.testing.assert_array_equal(getattr(back, which).predict(x), getattr(made, which).predict(x))


@settings(max_examples=60)
@given(text=st.sampled_from(SHIPPED), data=st.data())
def test_a_damaged_model_is_refused(text: str, data: st.DataObject):
    """Whatever a letter or digit of it becomes, and wherever the file is cut."""
    if data.draw(st.booleans()):
        damaged = text[: data.draw(st.integers(0, len(text) - 3))]
    else:
        at = data.draw(st.integers(0, len(text) - 1).filter(lambda k: text[k].isalnum()))
        other = data.draw(st.sampled_from("abcXYZ123").filter(lambda c: c != text[at]))
        damaged = text[:at] + other + text[at + 1 :]
        assume(not _same_numbers(damaged, text))
    with pytest.raises(InvalidModel):
        parse_model(damaged, "x.json")


def _same_numbers(damaged: str, text: str) -> bool:
    """Whether a digit was changed beyond what a float keeps."""
    with contextlib.suppress(ValueError):
        return json.loads(damaged) == json.loads(text)
    return False


def weights_of(numbers: int) -> list[str]:
    return [base64.b64encode(np.full(numbers, np.nan, "<f4").tobytes()).decode()]


CUT: Any = object()
WITHOUT = {
    "own": ("inverse", "forward hull", "links L_2", "provenance", "kind", "friction", "sha256"),
    "physics": ("inverse beam",),
    "friction": ("nominal",),
}
FAULTS: list[tuple[str, str, Any]] = [
    ("own", "version", 1),
    ("own", "links L_2", 0.2251),
    ("own", "format", "other"),
    ("own", "links", None),
    ("own", "links elbow", "LEFT"),
    ("own", "links L_3", -1.0),
    ("own", "inverse mean", [1.0] * 6),
    ("own", "inverse coefficients", [1.0] * 7),
    ("own", "inverse coefficients", [[1.0], [1.0, 2.0]]),
    ("own", "forward scale", [0.0] * 7),
    ("own", "forward mean", [float("nan")] * 7),
    ("own", "forward scale", [float("inf")] * 7),
    ("own", "forward mean", [10**400] * 7),
    ("own", "forward mean", [True] * 7),
    ("own", "forward mean", "0"),
    ("own", "forward mean", json.loads("[" * 500 + "1.0" + "]" * 500)),
    ("own", "inverse powers", [[4] + [0] * 119] * 7),
    ("own", "inverse powers", [[0.5] * 120] * 7),
    ("own", "inverse powers", []),
    ("own", "inverse hull", [-1.0] * 98),
    ("own", "inverse inputs", ["q"]),
    ("cubic", "kind", "other"),
    ("cubic", "kind", "small"),
    ("small", "inverse neurons", [32, 33]),
    ("small", "kind", "published"),
    ("small", "inverse activation", "relu"),
    ("small", "forward precision", "float16"),
    ("small", "forward weights", "abc"),
    ("small", "forward weights", ["ab!d"]),
    ("small", "forward weights", ["abcd"]),
    ("small", "forward weights", weights_of(1411)),
    ("small", "forward weights", weights_of(1410)),
    ("physics", "forward beam EI_0", -1.0),
    ("physics", "forward beam cap", 0.2),
    ("friction", "friction", [0.1]),
]


def test_what_is_no_model_is_refused(wording: Wording):
    texts = {"own": model_text(model()), **dict(zip(KINDS, SHIPPED, strict=True))}
    without = [(kind, place, CUT) for kind, places in WITHOUT.items() for place in places]
    for kind, place, value in without + FAULTS:
        changed = json.loads(texts[kind])
        *way, last = place.split()
        at = functools.reduce(operator.getitem, way, changed)
        if value is CUT:
            del at[last]
        else:
            at[last] = value
        with pytest.raises(InvalidModel) as caught:
            parse_model(json.dumps(changed), "x.json")
        wording.check(caught.value)


def test_other_texts_and_files_are_refused(tmp_path: Path):
    for text in ("", "{", "[]", "null", "[" * 100000, '{"format": 1}'):
        with pytest.raises(InvalidModel):
            parse_model(text, "x.json")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    for name in ("none.json", "binary", "."):
        with pytest.raises(InvalidModel):
            read_model(tmp_path / name)
