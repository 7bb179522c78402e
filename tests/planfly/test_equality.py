"""Results in Python can be compared and hashed: arrays have no truth value, and mappings no hash."""

import inspect
import pickle
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
import pytest

import planfly


def _parts(hint: Any, around: tuple[Any, ...] = ()) -> Iterator[Any]:
    """Yield a type and the types it is made of, also those of a named tuple's fields."""
    yield get_origin(hint) or hint
    for part in (*get_args(hint), *(get_type_hints(hint).values() if hasattr(hint, "_fields") else ())):
        if part not in around:
            yield from _parts(part, (*around, hint))


def _add_data_classes(found: dict[type, dict[str, set[Any]]], data_class: type) -> None:
    """Add a data class and the data classes of its fields, with the types of each compared field."""
    if data_class in found:
        return
    hints = get_type_hints(data_class)
    found[data_class] = {field.name: set(_parts(hints[field.name])) for field in fields(data_class) if field.compare}
    for types in list(found[data_class].values()):
        for one in types:
            if inspect.isclass(one) and is_dataclass(one):
                _add_data_classes(found, one)


def _public_data() -> dict[type, dict[str, set[Any]]]:
    """Return the data classes of planfly's public names and of their fields, with the types of each field."""
    found: dict[type, dict[str, set[Any]]] = {}
    for name in planfly.__all__:
        one = getattr(planfly, name)
        if inspect.isclass(one) and is_dataclass(one):
            _add_data_classes(found, one)
    return found


def test_no_public_class_compares_its_arrays() -> None:
    """A generated comparison of two arrays raises, so that a class with arrays compares by identity, or has its own."""
    compared = {
        data_class.__name__
        for data_class, types in _public_data().items()
        if any(np.ndarray in one for one in types.values()) and data_class.__dataclass_params__.eq  # type: ignore[attr-defined]
    }
    assert not compared


def test_no_public_class_hashes_a_mapping() -> None:
    hashed = {
        f"{data_class.__name__}.{field.name}"
        for data_class, types in _public_data().items()
        if data_class.__dataclass_params__.eq  # type: ignore[attr-defined]
        for field in fields(data_class)
        if field.hash is not False and types.get(field.name, set()) & {dict, list, set, Mapping}
    }
    assert not hashed


@pytest.mark.parametrize("name", [name for name in planfly.__all__ if inspect.isclass(getattr(planfly, name))])
def test_every_public_class_has_a_hash(name: str) -> None:
    assert issubclass(getattr(planfly, name), Hashable)


def test_scenarios_and_plans_are_compared_and_kept_in_sets() -> None:
    """A scenario is itself; a plan is its content, whose hash is the same after it was pickled."""
    scenario, other = planfly.make_scenario("tight"), planfly.make_scenario("tight")
    assert scenario == scenario
    assert scenario != other
    assert len({scenario, other}) == 2
    path = planfly.plan(scenario, waypoints=np.array([scenario.start, scenario.destination]))
    assert len({path, pickle.loads(pickle.dumps(path))}) == 1
