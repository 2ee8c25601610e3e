"""Where the points of a campaign stand along a plot's axis, and which of them share a colour."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.runs.campaign.results import CampaignResults

_MAX_COLOURS = 6
_MAX_NAMES = 10
_MAX_LABEL_LENGTH = 80
"""Letters of all names along a horizontal axis."""
_MAX_LISTED = 200
"""Points of a list that a page draws: a plot of so many is seven screens high."""
_UNEVEN = 8.0
"""Ratio of the widest to the narrowest step of positive values above which their axis is logarithmic."""


@dataclass(frozen=True, kw_only=True)
class PointLayout:
    """Points along an axis.

    Attributes:
        title: of the axis.
        places: of each of the campaign's points along it, in its coordinates.
        room: width along the axis that each has for itself.
        ticks: places and names; None where the places are numbers, which the plot labels by itself.
        groups: number of each point's colour.
        group_names: by number; one empty name if there is one group.
        listed: whether the points are a list from top to bottom instead of standing side by side.
    """

    title: str
    places: Floats
    room: float
    ticks: Sequence[tuple[float, str]] | None
    groups: Sequence[int]
    group_names: Sequence[str] = ("",)
    listed: bool = False

    @property
    def limits(self) -> tuple[float, float]:
        """Where the axis begins and ends."""
        edge = 0.75 * self.room
        return float(self.places.min()) - edge, float(self.places.max()) + edge

    @property
    def fits_a_page(self) -> bool:
        """Whether a page has room for plots of the points; of more, it has the table, which can be sorted."""
        return not self.listed or len(self.places) <= _MAX_LISTED

    def beside(self, k: int, n: int) -> Floats:
        """Return the places of n runs of a point: spread over about half its room, reproducibly.

        Multiples of the golden ratio, modulo 1, are spread evenly for any n.
        """
        spread = (np.arange(n) * (math.sqrt(5.0) - 1.0) / 2.0 + 0.5) % 1.0 - 0.5
        return self.places[k] + 0.55 * self.room * (spread if n > 1 else np.zeros(n))


def layout_of(results: CampaignResults) -> PointLayout:
    """Lay a campaign's points out.

    One varied parameter is the axis; of two, that with more values, or the only number, is the axis, and the other is
    shown by colour. Points that differ otherwise, or whose names need more room, are a list.
    """
    varied = results.independent
    if any(name not in p.values for p in results.points for name in varied):
        return list_layout(results)
    if len(varied) == 1:
        return _side_by_side(results, varied[0], None)
    if len(varied) == 2:
        across, colour = _axis_and_colour(results, varied[0], varied[1])
        if len(_texts(results, colour)) <= _MAX_COLOURS:
            return _side_by_side(results, across, colour)
    return list_layout(results)


def _axis_and_colour(results: CampaignResults, first: str, second: str) -> tuple[str, str]:
    def rank(name: str) -> tuple[bool, int]:
        return results.is_number(name), len(_texts(results, name))

    return (second, first) if rank(second) > rank(first) else (first, second)


def _texts(results: CampaignResults, parameter: str) -> list[str]:
    """Return a parameter's values, numbers in their order and others in that of the plan."""
    texts = list(dict.fromkeys(p.values[parameter] for p in results.points if parameter in p.values))
    return sorted(texts, key=float) if results.is_number(parameter) else texts


def _side_by_side(results: CampaignResults, across: str, colour: str | None) -> PointLayout:
    names = [] if colour is None else _texts(results, colour)
    if results.is_number(across):
        along, ticks, step, title = _numbers(results, across)
    else:
        texts = _texts(results, across)
        labels = [results.value_text(across, t) for t in texts]
        if len(labels) > _MAX_NAMES or sum(map(len, labels)) > _MAX_LABEL_LENGTH:
            return list_layout(results)
        along, step = {t: float(k) for k, t in enumerate(texts)}, 1.0
        ticks, title = list(enumerate(labels)), "" if results.is_boolean(across) else across.replace("_", " ")
    room = 0.8 * step / max(len(names), 1)
    groups = [0 if colour is None else names.index(p.values[colour]) for p in results.points]
    shift = [(g - (len(names) - 1) / 2) * room if names else 0.0 for g in groups]
    return PointLayout(
        title=title,
        places=np.array([along[p.values[across]] for p in results.points]) + shift,
        room=room,
        ticks=None if ticks is None else [(float(place), name) for place, name in ticks],
        groups=groups,
        group_names=("",) if colour is None else [_label(results, colour, n) for n in names],
    )


def _label(results: CampaignResults, parameter: str, text: str) -> str:
    if not results.is_number(parameter):
        return results.value_text(parameter, text)
    unit = display_unit(results.unit(parameter), [float(t) for t in _texts(results, parameter)])
    return f"{parameter.replace('_', ' ')} {unit.text(float(text))}"


def _numbers(
    results: CampaignResults, parameter: str
) -> tuple[dict[str, float], Sequence[tuple[float, str]] | None, float, str]:
    """Return places by text, ticks if the axis is logarithmic, the least distance between places, and the title."""
    texts = _texts(results, parameter)
    values = np.array([float(t) for t in texts])
    unit = display_unit(results.unit(parameter), values)
    values, title = values * unit.factor, unit.axis(parameter.replace("_", " "))
    steps = np.diff(np.unique(values))
    if values.min() > 0.0 and len(steps) and steps.max() > _UNEVEN * steps.min():
        places = np.log10(values)
        ticks = [(float(p), _tick(v)) for p, v in zip(places, values, strict=True)]
        return dict(zip(texts, places.tolist(), strict=True)), ticks, float(np.diff(np.unique(places)).min()), title
    step = float(steps.min()) if len(steps) else 1.0
    few = [(float(v), _tick(v)) for v in values] if len(steps) and steps.min() > 0.07 * np.ptp(values) else None
    return dict(zip(texts, values.tolist(), strict=True)), few, step, title


def _tick(value: float) -> str:
    """Return a number at an axis, to four digits: 33.33 of thirds of 100."""
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:g}"


def list_layout(results: CampaignResults) -> PointLayout:
    """Lay a campaign's points out as a list from top to bottom."""
    n = len(results.points)
    places = np.arange(n - 1, -1, -1, dtype=np.float64)
    labels = [results.label(p) for p in results.points]
    return PointLayout(
        title="",
        places=places,
        room=0.8,
        ticks=list(zip(places.tolist(), labels, strict=True)),
        groups=[0] * n,
        listed=True,
    )
