import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handover.controllers.vsl.default_model import DEFAULT_MODEL
from handover.controllers.vsl.fit import fit_cubic, rounded
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import (
    Cubic,
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
        (put(2, "version"), "its version is 2; this program reads version 1"),
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
    deep: Any = 1.0
    for _ in range(500):
        deep = [deep]
    changed = content()
    put(deep, "forward", "mean")(changed)
    with pytest.raises(InvalidModel, match=r"forward\.mean must be made of finite numbers"):
        parse_model(json.dumps(changed), "x.json")


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "[" * 100000, '{"format": 1}'])
def test_other_text_is_refused(text: str):
    with pytest.raises(InvalidModel):
        parse_model(text, "x.json")


def test_files_that_cannot_be_read_are_refused(tmp_path: Path):
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    for name in ("none.json", "binary", "."):
        with pytest.raises(InvalidModel, match="cannot be read"):
            read_model(tmp_path / name)
