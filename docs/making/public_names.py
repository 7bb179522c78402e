"""The reference of the Python API: every name of `planfly.__all__`, from its docstring."""

import inspect

import planfly

# Functions as a script calls them; a name that is not here comes after them.
_ORDER = (
    *("plan", "fly", "plan_then_fly", "check", "read_log", "figures", "report", "compare", "export", "campaign"),
    *("winds", "scenarios", "aircraft", "optimise"),
)
_TITLES = {"function": "Functions", "class": "What they give", "error": "Errors"}


def kind_of(name: str) -> str:
    """function, class or error; "" for what is neither."""
    value = getattr(planfly, name)
    if not inspect.isclass(value):
        return "function" if callable(value) else ""
    return "error" if issubclass(value, BaseException) else "class"


def public_names() -> str:
    """A section a kind, an entry a name."""
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
