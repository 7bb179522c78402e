"""A process that leads a campaign or a search of slow made flights, and says each that is written: to be killed.

``python -m tests.planfly.campaigns.slow_client campaign|winds FOLDER FLIGHTS`` makes it, or goes on with it.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planfly.campaigns.dispersions import default_dispersions
from planfly.campaigns.find_winds import SEARCHED_QUANTITIES, WindsGoal, find_winds, open_winds_store
from planfly.campaigns.fly_campaign import fly_campaign, open_store
from planfly.campaigns.statistics.decision import Goal
from planfly.campaigns.tables import LockedTable
from planfly.campaigns.worker_pool import Workers
from tests.planfly.campaigns.made_campaigns import short_base, slow_flight


def winds_goal(flights: int) -> WindsGoal:
    """Of three directions, none of which is known before its flights are used up."""
    return WindsGoal(0.9999, 0.95, 4, 20.0, flights)


def say_what_is_written(table: LockedTable) -> None:
    """Print each flight's number once it is in the table."""
    insert = table.insert

    def said(values: Mapping[str, Any]) -> None:
        insert(values)
        print(values["flight"], flush=True)

    table.insert = said  # type: ignore[method-assign]  # Of this one table.


def lead(kind: str, folder: Path, flights: int) -> None:
    """Make it or go on with it, to its end."""
    if kind == "campaign":
        base, goal = short_base(folder), Goal(None, False, flights)
        with open_store(base, goal, folder, resume=(folder / "campaign.sqlite").exists()) as store:
            say_what_is_written(store)
            fly_campaign(base, goal, Workers(2), store, fly=slow_flight)
    else:
        base, asked = short_base(folder, default_dispersions().without(SEARCHED_QUANTITIES)), winds_goal(flights)
        with open_winds_store(base, asked, folder, resume=(folder / "winds.sqlite").exists()) as table:
            say_what_is_written(table)
            find_winds(base, asked, Workers(2), table, fly=slow_flight)


if __name__ == "__main__":
    lead(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
