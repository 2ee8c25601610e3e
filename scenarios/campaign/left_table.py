"""Completes the table that a campaign has left: a kill may come between a run's end and its row."""

import contextlib
from collections.abc import Mapping
from typing import Any

from handover.scenarios.bad_call import BadCall
from handover.scenarios.campaign.campaign_folder import CampaignFolder
from handover.scenarios.campaign.campaign_table import CampaignTable
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.plan_check import checked_plan
from handover.scenarios.campaign.run_row import RunRow, row_of
from handover.scenarios.campaign.table_writer import TableWriter
from handover.scenarios.experiment.parameters import BadParameter
from handover.scenarios.results.run_folder import BadRunFolder, check_place, versions

_OF_PLAN = ("scenario", "points", "fixed", "repetitions", "seed", "paired", "scenes", "experiment")
"""What `campaign.json` tells of a plan, as far as the table follows from it."""


def complete_table(folder: CampaignFolder) -> None:
    """Give the table of a campaign a row for each run that is done; a table that is damaged is made anew.

    It stays as it is if a command carries the campaign out now, if another version has left it, if the folder cannot be
    written to, or if `campaign.json` is damaged.

    Raises:
        BadRunFolder: there is no `campaign.json`, or it cannot be read.
        RecordNotWritten: there is no room.
    """
    plan = _plan_of(folder.read())
    if plan is None:
        return
    with contextlib.ExitStack() as held:
        try:
            check_place(folder.path)
            held.enter_context(folder.held())
        except BadRunFolder:  # who is at work on it keeps its table
            return
        _complete(folder, plan)


def _plan_of(told: Mapping[str, Any]) -> CampaignPlan | None:
    """Return the plan that a campaign's file tells, None if it cannot be known."""
    if told.get("versions") != versions():
        return None
    try:
        return checked_plan(CampaignPlan(**{name: told[name] for name in _OF_PLAN}))
    except (BadCall, BadParameter, LookupError, TypeError, ValueError, AttributeError):  # told by who reads on
        return None


def _complete(folder: CampaignFolder, plan: CampaignPlan) -> None:
    try:
        known = {row.get("run"): row for row in CampaignTable.read(folder.table).rows}
    except BadRunFolder:
        known = {}
    writer = TableWriter(plan, folder.table)
    for run in plan.runs():
        there = known.get(run.name, {})
        row = row_of(run, folder.runs / run.name)
        if row is None and there.get("status") == "lost":
            row = RunRow(run=run, status="lost", success=None, reason=str(there.get("reason")))
        writer.keep([] if row is None else [row])
    if {row.run.name: row.status for row in writer.rows} != {name: row.get("status") for name, row in known.items()}:
        writer.write()
