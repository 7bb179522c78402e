"""The largest wind from each direction in which a mission flies."""

from pathlib import Path

from planfly.campaigns.campaign_base import open_campaign
from planfly.campaigns.campaign_result import winds_line
from planfly.campaigns.dispersions import default_dispersions, read_dispersions
from planfly.campaigns.find_winds import (
    ASKED,
    USUAL_WIND_FLIGHTS,
    WindsFound,
    WindsGoal,
    asked_flights,
    find_winds,
    open_winds_store,
)
from planfly.campaigns.report import campaign_folder, write_winds
from planfly.campaigns.tables import WINDS_DATABASE
from planfly.campaigns.worker_pool import Workers, in_own_process


def winds(
    target: str | Path,
    *,
    prove: float = 0.99,
    directions: int = 16,
    most: float = 20.0,
    flights: int | None = None,
    confidence: float = 0.95,
    spread: str | Path | None = None,
    seed: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> WindsFound:
    """The largest wind from each direction in which a mission flies with a probability, by flights put where they tell.

    target: an embedded scenario's name, a scenario's TOML file, or a plan.json, .waypoints or .plan file.
    prove: the probability.  directions: 4 to 72.  most: wind to look up to, m/s.  flights: at most, of all
    directions; None takes 5,000, or those that a search which is resumed was to have.
    confidence: of each interval.  spread, seed, workers, scheduler: as of `planfly.campaign`.
    out: a folder for ``winds.html``, ``winds.png``, ``winds.json`` and the flights; None keeps none.
    resume: go on with the search that is there.  overwrite: replace it.

    A script that calls it does so under ``if __name__ == "__main__":``, for workers import it.
    Raises ValueError for numbers that are none, and a `planfly.PlanflyError` for bad input.

    >>> winds("paper-07", directions=3)
    Traceback (most recent call last):
    ...
    ValueError: directions: 3: 4 to 72 is expected
    """
    for name, value, low, high in (
        ("prove", prove, 0.5, 0.9999999), ("confidence", confidence, 0.5, 0.9999999), ("directions", directions, 4, 72),
        ("most", most, 1.0, 40.0), ("flights", USUAL_WIND_FLIGHTS if flights is None else flights, 1, 10_000_000),
    ):  # fmt: skip
        if not low <= value <= high:
            raise ValueError(f"{name}: {value:g}: {low:g} to {high:g} is expected")
    chosen = default_dispersions() if spread is None else read_dispersions(Path(spread))
    with campaign_folder(out, WINDS_DATABASE, resume=resume, overwrite=overwrite) as asked:
        folder = asked.folder
        goal = WindsGoal(prove, confidence, directions, most, asked_flights(flights, folder, resume=resume))
        base = asked.open(
            lambda plan: in_own_process(open_campaign, str(target), chosen.without(ASKED), planned=plan, seed=seed)
        )
        with open_winds_store(base, goal, folder, resume=resume) as store:
            found = find_winds(base, goal, Workers(workers, scheduler), store)
        if out is not None:
            line = winds_line(str(target), goal, {"seed": base.seed, "spread": spread})
            write_winds(folder, base, found, line)
    return found
