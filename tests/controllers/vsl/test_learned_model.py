import base64
import contextlib
import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from handover.controllers.vsl import default_friction_model, default_model, default_physics_model, default_small_model
from handover.controllers.vsl.default_model import DEFAULT_MODEL
from handover.controllers.vsl.fit import fit_adapted, fit_cubic, fit_friction, rounded
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import (
    Adapted,
    Cubic,
    ForwardInput,
    Learned,
    VslModel,
    all_powers,
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


SHIPPED = [m.DEFAULT_MODEL for m in (default_model, default_small_model, default_physics_model, default_friction_model)]


def slopes(f: Callable[[Floats], Floats], at: Floats, step: float) -> Floats:
    """Return df/dx by central differences, a column an input."""
    return np.transpose([(f(at + h) - f(at - h)) / (2.0 * step) for h in step * np.eye(len(at))])


def adapted() -> VslModel:
    """Return a model adapted to an arm whose residuals are nine tenths of what they were, and a little off."""
    m, x = model(), np.random.default_rng(4).normal(size=(60, 7))
    inverse, forward = (fit_adapted(r, x, 0.9 * r.predict(x) + 0.01) for r in (m.inverse, m.forward))
    return VslModel(inverse, forward, m.kinematics, {"seed": 2})


def content() -> dict[str, Any]:
    return json.loads(model_text(model()))


def test_ridge_recovers_a_cubic():
    inside = X[:150].min(0) + 0.02 * np.ptp(X[:150], axis=0), X[:150].max(0) - 0.02 * np.ptp(X[:150], axis=0)
    fresh = RNG.uniform(*inside, (50, 3))
    np.testing.assert_allclose(fitted().predict(fresh), cubic_values(fresh), atol=1e-7)
    np.testing.assert_allclose(fitted().predict(fresh[0]), cubic_values(fresh[:1])[0], atol=1e-7)


def test_the_penalty_is_chosen_on_the_validation_points():
    noisy = cubic_values(X[:60]) + RNG.normal(0.0, 0.3, (60, 3))
    fit = fit_cubic(X[:60], noisy, X[60:], cubic_values(X[60:]))
    assert fit.penalty > 1e-10
    assert fit.validation_rms < 0.5


def test_the_penalty_is_per_point():
    x, y = X[:40], cubic_values(X[:40]) + np.random.default_rng(0).normal(0.0, 0.3, (40, 3))
    once, twice = (fit_cubic(np.tile(x, (n, 1)), np.tile(y, (n, 1)), X[40:], cubic_values(X[40:])) for n in (1, 2))
    assert once.penalty == twice.penalty > 1e-10
    np.testing.assert_allclose(twice.cubic.predict(X), once.cubic.predict(X), atol=1e-6)


def test_there_are_120_monomials_of_seven_inputs():
    powers = all_powers(7)
    assert powers.shape == (120, 7)
    assert len(np.unique(powers, axis=0)) == 120
    assert powers.sum(axis=1).max() == 3
    np.testing.assert_array_equal(powers[0], np.zeros(7))


def test_hull_holds_its_points_and_touches_them():
    z = (X[:150] - fitted().mean) / fitted().scale
    directions, hull = hull_directions(3), fitted().hull
    assert directions.shape == (18, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(np.max(z @ np.transpose(directions), axis=0), hull, atol=1e-8)
    assert not any(fitted().outside(x) for x in X[:150])


def test_points_beyond_an_axis_or_a_corner_are_outside():
    cubic = fitted()
    assert cubic.outside(np.array([2.1, 0.05, 1e5]))
    assert cubic.outside(np.array([0.5, 0.05, 4e4]))
    assert cubic.outside(np.array([0.5, np.nan, 1e5]))
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


def test_numbers_are_written_with_twelve_digits():
    np.testing.assert_array_equal(
        rounded(np.array([[1.0 / 3.0, -2e-20 / 3.0]])), [[0.333333333333, -6.66666666667e-21]]
    )


def test_the_forward_residual_turns_with_joint_1():
    m, p, i = model(), np.array([0.1, 0.2]), np.array([9.0, 0.3, 0.4])
    q = np.array([0.6, 0.5, -1.0])
    residual = m.forward.predict(np.array([0.6, 0.5, -1.0, 0.1, 0.2, 0.3, 0.4]))
    np.testing.assert_allclose(m.tip(q, p, i), m.kinematics.forward(q) + rotate_about_z(residual, 0.6), atol=1e-15)
    np.testing.assert_allclose(rotate_about_z(np.array([1.0, 0.0, 2.0]), np.pi / 2), [0.0, 1.0, 2.0], atol=1e-15)


def test_the_current_of_joint_1_is_left_out():
    q, p = np.array([0.6, 0.5, -1.0]), np.array([0.1, 0.2])
    np.testing.assert_array_equal(inputs_of(q, p, np.array([9.0, 0.3, 0.4])), [0.6, 0.5, -1.0, 0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize("text", SHIPPED)
@pytest.mark.parametrize("theta_1", [0.0, 0.4])
def test_the_corrected_jacobian_is_the_derivative_of_the_tip(text: str, theta_1: float):
    m = parse_model(text, "that ships")
    q, p, i = np.array([theta_1, 0.6, -1.2]), np.array([0.9e5, 1.2e5]), np.array([0.0, 0.7, 0.15])
    expected = slopes(lambda q: m.tip(q, p, i), q, 1e-4)
    np.testing.assert_allclose(m.tip_jacobian(q, p, i), expected, atol=2e-6)
    assert np.max(np.abs(m.tip_jacobian(q, p, i) - m.kinematics.jacobian(q))) > 0.005


def test_of_positions_the_corrected_jacobian_is_the_derivative_too():
    cubic = parse_model(DEFAULT_MODEL, "that ships").forward
    assert isinstance(cubic, Cubic)
    by_X = Cubic(np.array([0.3, 0.0, 0.15, *cubic.mean[3:]]), cubic.scale, cubic.hull, cubic.powers, cubic.coefficients)
    q, p, i = np.array([0.3, 0.6, -1.2]), np.array([0.9e5, 1.2e5]), np.array([0.0, 0.7, 0.15])
    for kind in (Learned.CUBIC, Learned.PUBLISHED):
        m = VslModel(by_X, by_X, model().kinematics, {}, kind, ForwardInput.X)
        np.testing.assert_allclose(m.tip_jacobian(q, p, i), slopes(lambda q, m=m: m.tip(q, p, i), q, 1e-5), atol=1e-7)


def test_a_published_model_gives_angles_and_position_themselves():
    m = model()
    published = VslModel(m.inverse, m.forward, m.kinematics, {}, Learned.PUBLISHED, ForwardInput.X)
    q, p, i = np.array([0.6, 0.5, -1.0]), np.array([0.1, 0.2]), np.array([9.0, 0.3, 0.4])
    np.testing.assert_array_equal(published.command(q, p, i), m.inverse.predict(inputs_of(q, p, i)))
    X = m.kinematics.forward(q)
    np.testing.assert_array_equal(published.tip(q, p, i), m.forward.predict(inputs_of(X, p, i)))


def test_a_cubics_jacobian_is_its_derivative_and_0_where_inputs_are_held():
    cubic, x = fitted(), X[:150].mean(axis=0)
    step = 1e-5 * cubic.scale
    J = np.transpose([(cubic.predict(x + h) - cubic.predict(x - h)) / (2.0 * h.sum()) for h in np.diag(step)])
    np.testing.assert_allclose(cubic.jacobian(x) * cubic.scale, J * cubic.scale, atol=1e-7)
    np.testing.assert_allclose(cubic.jacobian(X[:5])[3], cubic.jacobian(X[3]), rtol=1e-9)
    assert np.all(cubic.jacobian(x + 10.0 * cubic.scale) == 0.0)


def test_few_points_are_enough_to_adapt():
    m, fresh = adapted(), np.random.default_rng(9).normal(size=(100, 7))
    for now, was in ((m.inverse, model().inverse), (m.forward, model().forward)):
        assert isinstance(now, Adapted)
        expected = 0.9 * was.predict(fresh) + 0.01
        error = np.sqrt(np.mean((now.predict(fresh) - expected) ** 2))
        assert error < 0.05 * np.sqrt(np.mean((was.predict(fresh) - expected) ** 2))
        x = np.full(7, 0.1)
        np.testing.assert_allclose(now.jacobian(x), slopes(now.predict, x, 1e-5), atol=1e-6)


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


@pytest.mark.parametrize("text", SHIPPED)
def test_what_ships_is_what_would_be_written(text: str):
    shipped = parse_model(text, "that ships")
    assert model_text(shipped) == text
    assert max(len(line) for line in text.splitlines()) < 120
    assert len(shipped.provenance["data"]) == 64


def test_an_adapted_model_is_written_and_read():
    text = model_text(adapted())
    back = parse_model(text, "x.json")
    assert model_text(back) == text
    x = np.linspace(-1.0, 1.0, 7)
    np.testing.assert_array_equal(back.forward.predict(x), adapted().forward.predict(x))


@pytest.mark.parametrize("text", SHIPPED, ids=["cubic", "small", "physics", "friction"])
@settings(max_examples=60, deadline=None)
@given(data=st.data())
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


def test_text_and_model_are_the_same(tmp_path: Path):
    text = model_text(model())
    file = tmp_path / "m.json"
    file.write_text(text)
    back = read_model(file)
    assert model_text(back) == text
    assert max(len(line) for line in text.splitlines()) < 120
    x = np.linspace(-1.0, 1.0, 7)
    np.testing.assert_array_equal(back.inverse.predict(x), model().inverse.predict(x))
    assert back.kinematics == model().kinematics


def test_the_model_that_ships_is_one():
    shipped = parse_model(DEFAULT_MODEL, "that ships")
    assert shipped.kinematics == VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
    assert "\n" + model_text(shipped) == "\n" + DEFAULT_MODEL
    sentence = shipped.provenance["mean_test_errors_m"]
    assert sentence["forward_hybrid"] < sentence["forward_model_based"] / 5.0
    assert sentence["inverse_hybrid"] < sentence["inverse_model_based"] / 5.0


def cut(*path: str) -> Callable[[dict[str, Any]], None]:
    def change(d: dict[str, Any]) -> None:
        for key in path[:-1]:
            d = d[key]
        del d[path[-1]]

    return change


def put(value: Any, *path: str) -> Callable[[dict[str, Any]], None]:
    def change(d: dict[str, Any]) -> None:
        for key in path[:-1]:
            d = d[key]
        d[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (cut("inverse"), "the file has no 'inverse'"),
        (cut("forward", "hull"), "forward has no 'hull'"),
        (cut("links", "L_2"), "links has no 'L_2'"),
        (cut("provenance"), "no 'provenance'"),
        (put(1, "version"), "its version is 1; this program reads version 2"),
        (cut("kind"), "the file has no 'kind'"),
        (cut("friction"), "the file has no 'friction'"),
        (cut("sha256"), "the file has no 'sha256'"),
        (put(0.2251, "links", "L_2"), "it is damaged, or was changed by hand"),
        (put("other", "format"), "its format is 'other'"),
        (put(None, "links"), "links must be an object, not NoneType"),
        (put("LEFT", "links", "elbow"), "links.elbow is 'LEFT'"),
        (put(-1.0, "links", "L_3"), "must be above 0"),
        (put([1.0] * 6, "inverse", "mean"), r"inverse.mean has the shape \[6\], not \[7\]"),
        (put([1.0] * 7, "inverse", "coefficients"), r"shape \[7\], not \[3, 120\]"),
        (put([[1.0], [1.0, 2.0]], "inverse", "coefficients"), "its rows differ in length"),
        (put([0.0] * 7, "forward", "scale"), "forward.scale must be above 0"),
        (put([float("nan")] * 7, "forward", "mean"), "forward.mean must be made of finite numbers"),
        (put([float("inf")] * 7, "forward", "scale"), "forward.scale must be made of finite numbers"),
        (put([10**400] * 7, "forward", "mean"), "forward.mean must be made of finite numbers"),
        (put([True] * 7, "forward", "mean"), "forward.mean must be made of finite numbers"),
        (put("0", "forward", "mean"), "forward.mean must be made of finite numbers"),
        (put([[4] + [0] * 119] * 7, "inverse", "powers"), "powers must be whole numbers"),
        (put([[0.5] * 120] * 7, "inverse", "powers"), "powers must be whole numbers"),
        (put([], "inverse", "powers"), r"inverse.powers has the shape \[0\], not \[7, any\]"),
        (put([-1.0] * 98, "inverse", "hull"), "inverse.hull is empty"),
        (put(["q"], "inverse", "inputs"), "inverse.inputs are"),
    ],
)
def test_what_is_no_model_is_refused(change: Callable[[dict[str, Any]], None], sentence: str):
    changed = content()
    change(changed)
    with pytest.raises(InvalidModel, match=sentence) as caught:
        parse_model(json.dumps(changed), "x.json")
    assert "model x.json" in str(caught.value)


def test_numbers_within_many_lists_are_refused():
    deep = json.loads("[" * 500 + "1.0" + "]" * 500)
    changed = content()
    put(deep, "forward", "mean")(changed)
    with pytest.raises(InvalidModel, match=r"forward\.mean must be made of finite numbers"):
        parse_model(json.dumps(changed), "x.json")


@pytest.mark.parametrize(
    ("text", "change", "sentence"),
    [
        (SHIPPED[0], put("other", "kind"), "its kind is 'other', not one of cubic, small, published, physics"),
        (SHIPPED[0], put("small", "kind"), "inverse has no 'neurons'"),
        (SHIPPED[1], put([32, 33], "inverse", "neurons"), r"neurons are \[32, 33\]; a small network has \[32, 32\]"),
        (SHIPPED[1], put("published", "kind"), "a published network has"),
        (SHIPPED[1], put("relu", "inverse", "activation"), "activation is 'relu', not 'tanh'"),
        (SHIPPED[1], put("float16", "forward", "precision"), "precision is 'float16'"),
        (SHIPPED[1], put("abc", "forward", "weights"), "weights must be a list of texts"),
        (SHIPPED[1], put(["ab!d"], "forward", "weights"), "weights is not base64"),
        (SHIPPED[1], put(["abcd"], "forward", "weights"), "weights is no whole number of 4 bytes"),
        (SHIPPED[2], cut("inverse", "beam"), "inverse has no 'beam'"),
        (SHIPPED[2], put(-1.0, "forward", "beam", "EI_0"), "forward.beam.EI_0 must be above 0"),
        (SHIPPED[2], put(0.2, "forward", "beam", "cap"), "two caps leave nothing"),
        (SHIPPED[3], cut("nominal"), "the file has no 'nominal'"),
        (SHIPPED[3], put([0.1], "friction"), r"friction has the shape \[1\], not \[2\]"),
    ],
)
def test_what_is_no_model_of_its_kind_is_refused(text: str, change: Callable[[dict[str, Any]], None], sentence: str):
    changed = json.loads(text)
    change(changed)
    with pytest.raises(InvalidModel, match=sentence):
        parse_model(json.dumps(changed), "x.json")


def test_weights_that_are_not_finite_are_refused():
    changed = json.loads(SHIPPED[1])
    data = np.full(1411, np.nan, "<f4").tobytes()
    changed["forward"]["weights"] = [base64.b64encode(data).decode()]
    with pytest.raises(InvalidModel, match="must be made of finite numbers"):
        parse_model(json.dumps(changed), "x.json")
    changed["forward"]["weights"] = [base64.b64encode(data[:-4]).decode()]
    with pytest.raises(InvalidModel, match=r"weights must be made|has 1410 numbers, not 1411"):
        parse_model(json.dumps(changed), "x.json")


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 100000, '{"format": 1}'])
def test_other_text_is_refused(text: str):
    with pytest.raises(InvalidModel):
        parse_model(text, "x.json")


def test_files_that_cannot_be_read_are_refused(tmp_path: Path):
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    for name in ("none.json", "binary", "."):
        with pytest.raises(InvalidModel, match=r"cannot be read|there is no such file"):
            read_model(tmp_path / name)
