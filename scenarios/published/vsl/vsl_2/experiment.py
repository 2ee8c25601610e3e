"""Experiment 2 of [Gandarias2020], sec. V-B and figs. 6 and 7: a curve by rigid kinematics and by what was learned."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from handover.controllers.vsl.hybrid_kinematics import Learned
from handover.controllers.vsl.model_text import InvalidModel, read_model
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.vsl.vsl_2.claims import claims_of
from handover.scenarios.published.vsl.vsl_2.figures import draw_figures
from handover.scenarios.published.vsl.vsl_2.runs import (
    CASES,
    CUBIC,
    FEEDBACK,
    MODEL_BASED,
    OTHERS,
    PUBLISHED,
    REPETITIONS,
    RIGID,
    RIGIDS,
    SHIPPED,
    TRAINED,
    Vsl2Runs,
)
from handover.scenarios.published.vsl.vsl_2.tables import tables_of
from handover.scenarios.vsl.path_experiments import VslHybrid

_SEED = 2021
"""Of the campaign; nothing was learned from its runs."""


class Vsl2(PublishedExperiment):
    """The curve with 25 g at 1.5 bar and with 75 g at 0.5 bar, five times each, by rigid kinematics and by corrections.

    Corrections are those of cubic polynomials, the default, of a small network and of a beam of four fitted numbers,
    which ship, and of the paper's network if `take_model` was given the file of one. Polynomials are tried with
    feedback, too, by the tracker or by an IMU a link. Besides, the arm of rigid links goes by rigid kinematics, with
    joints as stiff as assumed and stiffer. Corrections are tried on the arm that they were learned from, and on others.
    The quick plan has each case once by rigid kinematics and by polynomials, on the arm that was learned from and on
    another, and on two rigid arms.

    The beam has the law of bending and the masses of the arm that it is tried on (an inverse crime): its errors are the
    least that such a correction could reach, and say nothing of one on a real arm.
    """

    name: ClassVar[str] = "vsl-2"
    title: ClassVar[str] = "the same by rigid kinematics and by learned corrections ([Gandarias2020] figs. 6, 7)"
    scenario: ClassVar[str] = VslHybrid.name

    def __init__(self) -> None:
        self._network: Path | None = None

    def take_model(self, file: Path) -> None:
        """Let the paper's network be tried, too, from the file of a trained one.

        Raises:
            InvalidModel: it is none, or of another kind.
        """
        model = read_model(file)
        if model.kind is not Learned.PUBLISHED:
            kind = model.kind.name.lower()
            remedy = "handover vsl-train --learned published"
            raise InvalidModel(str(file), f"it is a {kind} model, and not the paper's network", remedy)
        self._network = file

    def plan(self, quick: bool) -> CampaignPlan:
        """Return cases x methods, and cases x corrections x other arms, five times each; if quick, a few once."""
        network = () if self._network is None else (PUBLISHED,)
        given = {"model": str(self._network)}
        if quick:
            methods, rigid, arms = (MODEL_BASED, CUBIC, *network), (RIGID, RIGIDS[-1]), OTHERS[:1]
        else:
            methods, rigid, arms = (MODEL_BASED, *SHIPPED, *network, *FEEDBACK), RIGIDS, OTHERS
        tried = [(method, arm) for arm in (TRAINED, *arms) for method in methods] + [
            (method, TRAINED) for method in rigid
        ]
        return CampaignPlan(
            scenario=self.scenario,
            points=[
                {**case.parameters, **method.parameters, **arm.parameters, **(given if method is PUBLISHED else {})}
                for method, arm in tried
                for case in CASES
            ],
            repetitions=1 if quick else REPETITIONS,
            seed=_SEED,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge what sec. V-C says of figs. 6 and 7, and beyond it stiffer rigid arms and arms not learned from."""
        return claims_of(Vsl2Runs(table))

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return errors by method, the rigid arm's by its joints, those on other arms, and those of estimates."""
        return tables_of(Vsl2Runs(table))

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw estimates, compensated paths and errors, like figs. 6 and 7, and errors by joints and by arm."""
        return draw_figures(Vsl2Runs(table), runs, folder)
