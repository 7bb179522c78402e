"""The Python API reference: every name of `planfly.__all__`, from its docstring."""

import inspect

import planfly

# Functions in the order in which a script calls them; other names follow.
_ORDER = (
    *("plan", "fly", "plan_then_fly", "check", "read_log", "figures", "report", "compare", "export", "campaign"),
    *("winds", "scenarios", "aircraft", "optimise"),
)
_TITLES = {"function": "Functions", "class": "Classes", "error": "Errors"}


def kind_of(name: str) -> str:
    """function, class or error; "" for anything else."""
    value = getattr(planfly, name)
    if not inspect.isclass(value):
        return "function" if callable(value) else ""
    return "error" if issubclass(value, BaseException) else "class"


def public_names() -> str:
    """One section per kind, one entry per name."""
    parts = []
    for kind, title in _TITLES.items():
        names = [name for name in dict.fromkeys((*_ORDER, *planfly.__all__)) if kind_of(name) == kind]
        entries = "\n\n".join(_entry(kind, name) for name in names)
        parts.append(f"## {title}\n\n```{{eval-rst}}\n{entries}\n```")
    return "\n\n".join(parts)


def _entry(kind: str, name: str) -> str:
    if kind == "function":
        return f".. autofunction:: planfly.{name}"
    if kind == "error":
        return f".. autoexception:: planfly.{name}\n   :no-members:"
    return f".. autoclass:: planfly.{name}()\n   :members:\n   :no-undoc-members:"
