"""An extra that is not installed is named in one line, as an error that a program can take apart."""

import pickle
import sys

import pytest

from world.errors import MissingExtraError, PlanflyError
from world.extras import EXTRAS, require_extra, requires_extra


@pytest.mark.parametrize(("name", "module"), [(one.name, module) for one in EXTRAS.values() for module in one.modules])
def test_each_module_of_an_extra_is_missed(name: str, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("world.extras.find_spec", lambda asked: None if asked == module else object())
    with pytest.raises(MissingExtraError) as caught:
        require_extra(name)
    error = caught.value
    command = f"pip install 'planfly[{name}]'"
    assert str(error) == f"{EXTRAS[name].needs} the extra '{name}': {command}"
    assert (error.field, error.value, error.allowed, error.name) == ("extra", name, command, module)
    others = [one for one in EXTRAS if module not in EXTRAS[one].modules]
    for other in others:
        require_extra(other)


def test_what_hides_a_module_hides_it_from_us(monkeypatch: pytest.MonkeyPatch) -> None:
    require_extra("tables")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError):
        require_extra("tables")

    class Refusing:
        @staticmethod
        def find_spec(name: str, *_: object) -> None:
            raise ModuleNotFoundError(name)

    monkeypatch.undo()
    monkeypatch.setattr(sys, "meta_path", [Refusing, *sys.meta_path])
    monkeypatch.delitem(sys.modules, "pyulog", raising=False)
    with pytest.raises(MissingExtraError):
        require_extra("px4-logs")


def test_a_decorated_function_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = []

    @requires_extra("live", "my vehicle needs")
    def vehicle(speed: float) -> float:
        """Fly."""
        begun.append(speed)
        return 2.0 * speed

    assert (vehicle(3.0), vehicle.__doc__, begun) == (6.0, "Fly.", [3.0])
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    with pytest.raises(MissingExtraError, match=r"^my vehicle needs the extra 'live': pip install 'planfly\[live\]'$"):
        vehicle(4.0)
    assert begun == [3.0]


def test_it_is_an_import_error_and_goes_between_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(ImportError) as caught:
        require_extra("px4-logs")
    assert isinstance(caught.value, PlanflyError)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.value, again.allowed) == (str(caught.value), "px4-logs", caught.value.allowed)
