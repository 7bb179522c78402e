"""The Python API reference: every name of `planfly.__all__`, from its docstring."""

import inspect

import planfly

# Functions in the order in which a script calls them; other names follow.
_ORDER = (
    *(
        "plan",
        "plan_front",
        "replan",
        "what_blocks",
        "what_may_fail",
        "fly",
        "plan_then_fly",
        "run",
        "check",
        "judge",
        "read_log",
        "figures",
        "report",
    ),
    *("compare", "export", "foxglove_layout", "timeline", "instruments", "movie", "play_to_foxglove"),
    *(
        "play_to_stations",
        "guess_columns",
        "import_log",
        "refly",
        "predict",
        "recover",
        "campaign",
        "campaign_flight",
        "winds",
        "battery",
        "ground_risk",
        "serve",
        "open_studio",
    ),
    *("scenarios", "aircraft", "describe_aircraft", "new_aircraft", "paper_tables", "optimise", "progress"),
)
_TITLES = {"function": "Functions", "class": "Classes", "error": "Errors"}


def kind_of(name: str) -> str:
    """Return "function", "class" or "error"; "" for anything else."""
    value = getattr(planfly, name)
    if not inspect.isclass(value):
        return "function" if callable(value) else ""
    return "error" if issubclass(value, BaseException) else "class"


def public_names() -> str:
    """Return one section per kind, one entry per name."""
    parts = []
    for kind, title in _TITLES.items():
        names = [name for name in dict.fromkeys((*_ORDER, *planfly.__all__)) if kind_of(name) == kind]
        entries = "\n\n".join(_entry(kind, name) for name in names)
        parts.append(f"## {title}\n\n```{{eval-rst}}\n{entries}\n```")
    return "\n\n".join(parts)


def name_tables() -> str:
    """Return one table per kind, with the first sentence of each name's docstring."""
    parts = []
    for kind, title in _TITLES.items():
        names = [name for name in dict.fromkeys((*_ORDER, *planfly.__all__)) if kind_of(name) == kind]
        rows = [f"| `planfly.{name}` | {_first_sentence(name)} |" for name in names]
        parts.append("\n".join([f"## {title}", "", "| name | what it is |", "|---|---|", *rows]))
    return "\n\n".join(parts)


def _first_sentence(name: str) -> str:
    text = inspect.getdoc(getattr(planfly, name)) or ""
    return " ".join(text.partition("\n\n")[0].split()).replace("|", "\\|")


def _entry(kind: str, name: str) -> str:
    if kind == "function":
        return f".. autofunction:: planfly.{name}"
    if kind == "error":
        return f".. autoexception:: planfly.{name}\n   :no-members:"
    return f".. autoclass:: planfly.{name}()\n   :members:\n   :no-undoc-members:"
