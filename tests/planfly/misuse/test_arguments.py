"""Every argument of every function that `import planfly` shows, with values of another kind or shape.

Each is refused by a `planfly.PlanflyError` of one line before anything is planned or flown.
"""

import inspect
import math
from collections.abc import Iterator
from typing import Any, get_args

import numpy as np
import pytest

import planfly
from logs.recording.example_log import example_log
from tests.planfly.test_public_names import VERBS

_PLACES = (36.27, -84.15), (36.33, -84.35)
# The arguments that a call needs.
CALLS: dict[str, tuple[Any, ...]] = {
    **dict.fromkeys(("plan", "plan_then_fly", "run", "make_scenario"), ("tight",)),
    **dict.fromkeys(("battery", "campaign", "check", "fly", "ground_risk", "judge", "link", "returns"), ("p.json",)),
    **dict.fromkeys(("serve", "winds", "window", "open_studio"), ("p.json",)),
    "survey": ("m.waypoints",),
    "campaign_flight": ("p.json", 0, "campaign"),
    "export": ("m.waypoints", "m.plan"),
    "fly_by_each": ("p.json", ["planfly"]),
    "replan": ("tight", "p.json", 3),
    "plan_front": ("tight", 4),
    **dict.fromkeys(("figures", "report", "replay", "timeline", "play_to_foxglove"), (example_log(),)),
    "play_to_stations": (example_log(), "127.0.0.1:14550"),
    "movie": (example_log(), "a.mp4"),
    "import_log": ("no.ulg",),
    "predict": ("no.ulg",),
    "refly": ("no.ulg",),
    "identify_aircraft": (["no.ulg"], "out"),
    "new_aircraft": ("out",),
    "new_scenario": ("out", *_PLACES),
    "terrain": ("a.tif",),
    "optimise": ([0.0], [1.0]),
    **dict.fromkeys(("aircraft", "describe_aircraft"), ("aerosonde",)),
    **dict.fromkeys(("compare", "compare_campaigns", "recover"), ("a", "b")),
    **dict.fromkeys(("guess_columns", "instruments", "read_log"), ("a",)),
    "what_blocks": (None,),
    "what_may_fail": (None,),
    "foxglove_layout": (),
    "scenarios": (),
    "paper_tables": (),
    "progress": (print,),
}
# Keywords that a call needs.
KEYWORDS: dict[str, dict[str, Any]] = {
    "window": {"earliest": "2026-05-01T06:00Z"},
    "identify_aircraft": {"mass": 2.0, "span": 2.0},
    "predict": {"aircraft": "aerosonde"},
}
# Calls whose files are read before the options of a flight are, so that the missing file is named.
FILE_FIRST = ("campaign_flight", "import_log", "predict")
NAN = math.nan


def wrong_values(annotation: Any) -> tuple[Any, ...]:
    """Values that no argument of this annotation may have; () for an annotation that says too little."""
    members = get_args(annotation) or (annotation,)
    text = str(annotation)
    if "array_like" in text:
        return (7, "west", [(0.0, 0.0, 100.0)], [("a", 0.0, 100.0, 0.0)], [(NAN, 0.0, 1.0, 1.0)])
    if "tuple[float" in text or "Sequence[float]" in text:
        return (5, "ab", (1.0,), (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (NAN, 1.0))
    if bool in members:
        return ()
    if int in members and float not in members:
        return (NAN, 2.5, "x", [1], math.inf)
    if float in members:
        return (NAN, "x", [1.0, 2.0])
    if "Literal" in text:
        return ("zz", ["a"])
    if "Path" in text or str in members or "Callable" in text or "Sequence" in text or annotation is planfly.Plan:
        return (5,)
    return ()


def wrong_arguments(name: str) -> Iterator[tuple[int, str, Any]]:
    """Each parameter of a function, by position and keyword, with each of its wrong values."""
    for position, (keyword, parameter) in enumerate(inspect.signature(getattr(planfly, name)).parameters.items()):
        if parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            yield from ((position, keyword, value) for value in wrong_values(parameter.annotation))


@pytest.fixture(scope="module", autouse=True)
def _mission_and_plan(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("arguments"))
        planfly.export(planfly.plan("tight", seed=1, out="p.json"), "m.waypoints")
        # Nothing of this is to be reached.
        for heavy in ("planfly.api.flying.fly_and_judge", "planfly.api.returning.fly_and_judge"):
            patch.setattr(heavy, _reached)
        yield


def _reached(*_: object, **__: object) -> None:
    raise AssertionError("a flight was begun")


@pytest.mark.parametrize("name", sorted(CALLS))
def test_a_wrong_argument_is_refused_in_a_line_that_names_it(name: str) -> None:
    function, keywords = getattr(planfly, name), KEYWORDS.get(name, {})
    for position, keyword, value in wrong_arguments(name):
        arguments = list(CALLS[name])
        if position < len(arguments):
            arguments[position] = value
            changed = keywords
        else:
            changed = keywords | {keyword: value}
        with pytest.raises(planfly.PlanflyError) as refused:
            function(*arguments, **changed)
        assert "\n" not in str(refused.value), (keyword, value)
        assert name in FILE_FIRST or keyword in str(refused.value), (keyword, value)


def test_every_function_is_called_with_many_values() -> None:
    assert CALLS.keys() == VERBS
    assert sum(len(list(wrong_arguments(name))) for name in CALLS) > 600


@pytest.mark.parametrize("seed", [2.0, np.int64(2), np.float32(2.0)])
def test_a_whole_number_of_another_type_is_this_integer(seed: Any) -> None:
    plan = planfly.plan("hard-07", seed=seed)
    assert type(plan.seed) is int
    assert plan == planfly.plan("hard-07", seed=2)
    assert planfly.replan("hard-07", plan, 4.0, seed=seed).flown_legs == 4  # type: ignore[arg-type]
    points = [planfly.optimise([0.0], [1.0], population=4.0, seed=one).ask() for one in (seed, 2)]  # type: ignore[arg-type]
    assert points[0].tolist() == points[1].tolist()
