"""The runs of the experiment `vsl-2`, by load and pressure, by how the tip is commanded, and by arm."""

import enum
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handover.controllers.vsl.hybrid_kinematics import Imu, Learned, Method
from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.parameters import Link
from handover.scenarios.campaign.plan import is_number
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.published.vsl.vsl_1.runs import format_load, has_completed_path
from handover.scenarios.vsl.parameters import BAR, HybridParameters

_PUBLISHED, _BEYOND = (paper_values("vsl", group) for group in ("published", "beyond"))

REPETITIONS: int = _BEYOND["repetitions"]


@dataclass(frozen=True)
class Case:
    """A load, kg, and a pressure, Pa."""

    load: float
    pressure: float

    @property
    def label(self) -> str:
        """Both in words."""
        return f"{format_load(self.load)}, {self.pressure / BAR:g} bar"

    @property
    def parameters(self) -> dict[str, str]:
        """The scenario's parameters of it, as texts."""
        return {"load": f"{self.load:g}", "pressure": f"{self.pressure:g}"}


CASES = tuple(Case(load, pressure) for load, pressure in _PUBLISHED["experiment_2"])
"""Left and right of fig. 6; of fig. 7, which names neither, assumed to be the same."""


@dataclass(frozen=True)
class ControlMethod:
    """How the tip is brought along the path.

    Attributes:
        label: what it is called.
        parameters: the scenario's parameters that make it, as texts.
    """

    label: str
    parameters: Mapping[str, str] = field(hash=False)

    @property
    def is_learned(self) -> bool:
        """Whether it corrects what it commands by what it was taught."""
        return "learned" in self.parameters


def _learned(label: str, learned: Learned) -> ControlMethod:
    return ControlMethod(label, {"learned": learned.name.lower()})


MODEL_BASED = ControlMethod("model-based", {"kinematics.method": Method.ESTIMATE.name.lower()})
"""By rigid kinematics, while the hybrid forward model estimates the tip: figs. 6 and 7."""

CUBIC = _learned("cubic polynomials", Learned.CUBIC)
SMALL = _learned("small network", Learned.SMALL)
PUBLISHED = _learned("the paper's network", Learned.PUBLISHED)
PHYSICS = _learned("beam", Learned.PHYSICS)
SHIPPED = (CUBIC, SMALL, PHYSICS)
LEARNED = (CUBIC, SMALL, PUBLISHED, PHYSICS)

TRACKER = ControlMethod("polynomials and tracker", {**CUBIC.parameters, "closed_loop": "true"})
IMU = ControlMethod("polynomials and IMUs", {**CUBIC.parameters, "imu": Imu.FEEDBACK.name.lower()})
FEEDBACK = (TRACKER, IMU)
"""Beyond the paper's open loop, of its future work: with feedback by a tracker of 30 Hz, or by an IMU a link."""

JOINT_FACTORS: tuple[float, ...] = tuple(_BEYOND["joint_factors"])
"""How many times as stiff as assumed the joints of the rigid arm are."""


def rigid(factor: float) -> ControlMethod:
    """Return the arm of rigid links by rigid kinematics, whose joints are `factor` times as stiff as assumed."""
    label = "rigid arm" if factor == 1.0 else f"rigid arm, joints x {factor:g}"
    method = {"kinematics.method": Method.MODEL_BASED.name.lower()}
    return ControlMethod(label, {"links": Link.RIGID.name.lower(), **method, "joint_factor": f"{factor:g}"})


RIGID = rigid(1.0)
RIGIDS = tuple(rigid(factor) for factor in JOINT_FACTORS)


@dataclass(frozen=True)
class Arm:
    """An arm on which the methods are tried.

    Attributes:
        label: what it is like.
        parameters: by which it differs from the one that was learned from, as texts.
    """

    label: str
    parameters: Mapping[str, str] = field(hash=False)


TRAINED = Arm("trained", {})
SCATTER: float = _BEYOND["scatter"]
"""Standard deviation by which each link, gear and joint of another arm differs, as a share."""


def _others() -> Iterator[Arm]:
    factor, friction, arms = (_BEYOND[name] for name in ("factor", "friction_factor", "arms"))
    yield Arm(f"links {100 * (factor - 1):.0f} % stiffer", {"EI_factor": f"{factor:g}"})
    yield Arm(f"links {100 * (factor - 1):.0f} % heavier", {"mass_factor": f"{factor:g}"})
    yield Arm(f"friction x {friction:g}", {"friction_factor": f"{friction:g}"})
    for n in range(1, arms + 1):
        yield Arm(f"arm {n} of its kind", {"arm_scatter": f"{SCATTER:g}", "arm_seed": str(n)})


OTHERS = tuple(_others())
"""Arms that nothing was learned from: with one thing otherwise, and some whose links scatter."""


class Vsl2Runs:
    """Our results by case, method and arm. Runs that did not complete the path do not count."""

    def __init__(self, table: CampaignTable) -> None:
        rows = table.rows
        self._done: dict[_Key, list[dict[str, Any]]] = {}
        for row in rows:
            if has_completed_path(row):
                self._done.setdefault(_key_of(row), []).append(row)
        self.not_done = sum(not has_completed_path(row) for row in rows)
        """Number of runs that do not count: a unit failed, a worker was lost, or the path was not completed."""

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arms that nothing was learned from, as far as any run is on them."""
        return tuple(
            arm for arm in OTHERS if any(self.rows(CASES[0], method, arm) for method in (MODEL_BASED, *LEARNED))
        )

    @property
    def learned(self) -> tuple[ControlMethod, ...]:
        """The methods that any run goes that were taught."""
        return tuple(method for method in LEARNED if any(self.rows(case, method) for case in CASES))

    @property
    def feedback(self) -> tuple[ControlMethod, ...]:
        """The methods with feedback that any run goes."""
        return tuple(method for method in FEEDBACK if self.rows(CASES[0], method))

    @property
    def rigid(self) -> tuple[tuple[float, ControlMethod], ...]:
        """Rigid arms that any run is on, with how many times as stiff their joints are."""
        return tuple(
            (f, method) for f, method in zip(JOINT_FACTORS, RIGIDS, strict=True) if self.rows(CASES[0], method)
        )

    @property
    def methods(self) -> tuple[ControlMethod, ...]:
        """All methods that any run goes on the arm that was learned from, or on the rigid one."""
        return (
            *((MODEL_BASED,) if self.rows(CASES[0], MODEL_BASED) else ()),
            *self.learned,
            *self.feedback,
            *(w for _, w in self.rigid),
        )

    @property
    def hybrid(self) -> ControlMethod:
        """The method that the paper's claims are judged by: its own network if there is one, else the default."""
        return PUBLISHED if PUBLISHED in self.learned else CUBIC

    def names(self, case: Case, method: ControlMethod, arm: Arm = TRAINED) -> list[str]:
        """Return the folders' names of runs."""
        return [row["run"] for row in self.rows(case, method, arm)]

    def metric(self, name: str, case: Case, method: ControlMethod, arm: Arm = TRAINED) -> Floats:
        """Return a metric of runs, shape (runs,)."""
        return np.array([row[name] for row in self.rows(case, method, arm)], dtype=np.float64)

    def rows(self, case: Case, method: ControlMethod, arm: Arm = TRAINED) -> list[dict[str, Any]]:
        """Return the rows of runs that completed the path."""
        return self._done.get(_key_of({**case.parameters, **method.parameters, **arm.parameters}), [])


_Key = tuple[str | float, ...]
"""The values of all parameters in `_DEFAULTS`."""


def _key_of(given: Mapping[str, Any]) -> _Key:
    """Return the key of a run by its parameters, as a table has them or as texts; what is not given is the default."""
    values = ((given.get(name), default) for name, default in _DEFAULTS.items())
    return tuple(default if value in (None, "") else _plain(value) for value, default in values)


def _plain(value: Any) -> str | float:
    """Return a number, also one that is a text, as such, and a name in lower case."""
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if value in ("true", "false"):
        return float(value == "true")
    return float(value) if not isinstance(value, str) or is_number(value) else value


_VARIED = {name for arm in OTHERS for name in arm.parameters} | {
    "load",
    "pressure",
    "links",
    "learned",
    "closed_loop",
    "imu",
    "joint_factor",
}
_DEFAULTS: dict[str, str | float] = {
    **{name: _plain(value) for name, value in vars(HybridParameters()).items() if name in _VARIED},
    "kinematics.method": Method.HYBRID.name.lower(),
}
"""What a run has where its point does not say otherwise."""
