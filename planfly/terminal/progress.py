"""Progress: a bar on a terminal, plain lines elsewhere; on standard error, so that results can be piped."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planfly.pipeline import Advance

_silent: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silent_progress() -> Iterator[None]:
    """Report nothing meanwhile."""
    token = _silent.set(True)
    try:
        yield
    finally:
        _silent.reset(token)


def _say_nothing(_done: float, _whole: float, _remark: str = "") -> None:
    pass


def say(line: str) -> None:
    """A line about the work, where progress is reported."""
    if not _silent.get():
        print(line, file=sys.stderr, flush=True)


@contextmanager
def progress(title: str) -> Iterator["Advance"]:
    """Report a stage of work; the caller reports how much of how much is done, and a remark."""
    if _silent.get():
        yield _say_nothing
        return
    if not sys.stderr.isatty():
        yield from _lines(title)
        return
    from tqdm import tqdm

    with tqdm(total=100, desc=title, bar_format="{desc:<22} {bar:30} {percentage:3.0f} %{postfix}", leave=True) as bar:

        def advance(done: float, whole: float, remark: str = "") -> None:
            share = 100.0 * done / whole if whole > 0 else 100.0
            bar.update(max(0.0, min(100.0, share) - bar.n))
            if remark:
                bar.set_postfix_str(remark)

        yield advance
        bar.update(100 - bar.n)


def _lines(title: str) -> Iterator["Advance"]:
    """A line when work begins and one when it is done; none for input that is refused before it begins."""
    started = time.monotonic()
    last: str | None = None

    def remember(_done: float, _whole: float, remark: str = "") -> None:
        nonlocal last
        if last is None:
            print(f"{title} ...", file=sys.stderr, flush=True)
        last = remark

    yield remember
    end = f": {last}" if last else ""
    print(f"{title}: done in {time.monotonic() - started:.1f} s{end}", file=sys.stderr, flush=True)
