"""What a campaign's folder says of it, checked as it is read: it may be another version's, or damaged."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, cast

from handover.cosim.exceptions import one_line
from handover.scenarios.campaign.campaign_folder import CampaignFolder
from handover.scenarios.campaign.campaign_results import CampaignResults
from handover.scenarios.campaign.campaign_table import CampaignTable
from handover.scenarios.published.claim import Claim
from handover.scenarios.run_folder import BadRunFolder

_FORMS: Mapping[str, type] = {"scenario": str, "points": list, "fixed": dict, "repetitions": int, "seed": int}
_COLUMNS = ("run", "point", "repetition", "seed", "status", "success", "reason", "cpu_seconds", "wall_seconds")


def read_results(folder: CampaignFolder) -> CampaignResults:
    """Read a campaign's plan and its table.

    Raises:
        BadRunFolder: it is not the folder of a campaign, or one of the files is damaged.
    """
    told = folder.read()
    faults = [f"{n!r} is {told.get(n)!r:.40}" for n, form in _FORMS.items() if not isinstance(told.get(n), form)]
    if not faults and not all(isinstance(p, dict) for p in told["points"]):
        faults = ["its points are not mappings of parameters to values"]
    if faults:
        raise BadRunFolder(folder.path, f"its campaign.json is damaged: {'; '.join(faults)}")
    table = CampaignTable.read(folder.table)
    missing = [name for name in _COLUMNS if name not in table.table.column_names]
    if missing:
        raise BadRunFolder(folder.path, f"its {folder.table.name} is damaged: it has no column {', '.join(missing)}")
    return CampaignResults(told, table)


def read_claims(folder: CampaignFolder) -> Sequence[Claim]:
    """Read what became of a paper's claims; none if the campaign is of none, or not that far.

    Raises:
        BadRunFolder: the file is damaged.
    """
    file = folder.path / "claims.json"
    if not file.exists():
        return ()
    try:
        return [Claim.from_data(entry) for entry in cast(list[Mapping[str, Any]], json.loads(file.read_bytes()))]
    except (KeyError, TypeError, ValueError) as e:
        fault = f"its {file.name} is damaged: {one_line(e)}; the same `handover paper` call writes it anew"
        raise BadRunFolder(folder.path, fault) from e
