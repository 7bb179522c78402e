"""A part of a campaign in a process of its own: the one that leads it stays small, whatever plans and pictures take."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from planfly.campaigns.engine.cluster import start_tracker
from planfly.pipeline import Advance
from world.interruption import deaf_children, end_children, end_when_told

Made = TypeVar("Made")


def in_own_process(work: Callable[..., Made], *args: Any, advance: Advance | None = None, **options: Any) -> Made:
    """What work(*args, advance=..., **options) returns there; all of it goes between processes by pickle.

    advance: told as work tells it.
    Raises what work raised, and OSError where the process was lost.
    """
    # Before anything else does, so that it says nothing of what the workers leave later.
    start_tracker()
    here, there = multiprocessing.get_context("spawn").Pipe(duplex=False)
    child = multiprocessing.get_context("spawn").Process(target=_work, args=(there, work, args, options), daemon=True)
    with deaf_children():
        child.start()
    there.close()
    try:
        while True:
            kind, told = here.recv()
            if kind == "done":
                made: Made = told
                return made
            if kind == "failed":
                raise told
            if advance is not None:
                advance(*told)
    except EOFError:
        raise OSError(0, "a process of the campaign was lost: killed, or out of memory", work.__name__) from None
    finally:
        here.close()
        end_children([child])


def _work(tell: Connection, work: Callable[..., Any], args: tuple[Any, ...], options: dict[str, Any]) -> None:
    end_when_told()
    try:
        tell.send(("done", work(*args, advance=lambda *told: tell.send(("told", told)), **options)))
    except Exception as error:
        tell.send(("failed", error))
