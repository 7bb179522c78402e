"""Compare the inputs of two campaigns, each by name.

Inputs are scenario, mission, aircraft, parameters, dispersions and seed.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

# Prefix of the hash that represents a list or a long text.
_HASH_PREFIX = "sha256:"
# Maximum number of differences that are described.
_MAX_DESCRIBED = 6


def hash_input(content: str | bytes) -> str:
    """Return the hash, with its prefix, that represents a long input in place of its content."""
    data = content.encode() if isinstance(content, str) else content
    return _HASH_PREFIX + hashlib.sha256(data).hexdigest()[:16]


def flatten_inputs(document: Mapping[str, Any]) -> dict[str, Any]:
    """Flatten a document into inputs by name: ``table.key`` for an entry of a table, a hash for a list.

    >>> flatten_inputs({"seed": 1, "wind": {"speed_mps": 5.0}})
    {'seed': 1, 'wind.speed_mps': 5.0}
    """
    inputs: dict[str, Any] = {}
    for name, value in document.items():
        if isinstance(value, Mapping):
            inputs |= {f"{name}.{key}": entry for key, entry in flatten_inputs(value).items()}
        else:
            inputs[name] = hash_input(json.dumps(value)) if isinstance(value, list | tuple) else value
    return inputs


def describe_differences(stored: Mapping[str, Any], current: Mapping[str, Any]) -> str:
    """Describe the inputs that differ, with both values if they are short; return "" if none differs.

    stored, current: inputs by name, as `flatten_inputs` returns them.

    >>> describe_differences({"seed": 1, "wind.speed_mps": 5.0}, {"seed": 1, "wind.speed_mps": 8.0, "landing": "a"})
    'wind.speed_mps 8.0 instead of 5.0, landing a (not stated before)'
    """
    texts = difference_texts(stored, current)
    more = [f"and {len(texts) - _MAX_DESCRIBED} more"] if len(texts) > _MAX_DESCRIBED else []
    return ", ".join([*texts[:_MAX_DESCRIBED], *more])


def difference_texts(stored: Mapping[str, Any], current: Mapping[str, Any]) -> list[str]:
    """Return a text for each input that differs, as in `describe_differences`.

    stored, current: inputs by name.
    """
    names = [name for name in dict.fromkeys((*stored, *current)) if stored.get(name) != current.get(name)]
    # A number that was converted between units differs by rounding: name it only if nothing else differs.
    rounded_names = {
        name
        for name in names
        if isinstance(stored.get(name), float)
        and isinstance(current.get(name), float)
        and math.isclose(stored[name], current[name], rel_tol=1e-12)
    }
    names = [name for name in names if name not in rounded_names] or names
    # Different autopilots have different parameters: state this once instead of naming each parameter.
    autopilots = [str(inputs.get("autopilot", "")).partition(" ")[0] for inputs in (stored, current)]
    texts = []
    if autopilots[0] != autopilots[1] and any(name.startswith("parameters.") for name in names):
        names = [name for name in names if not name.startswith("parameters.")]
        texts.append("parameters: each autopilot has its own")
    for name in names:
        old, new = stored.get(name), current.get(name)
        if str(old if new is None else new).startswith(_HASH_PREFIX):
            texts.append(name)
        elif new is None:
            texts.append(f"{name} not stated instead of {old}")
        else:
            texts.append(f"{name} {new} " + ("(not stated before)" if old is None else f"instead of {old}"))
    return texts
