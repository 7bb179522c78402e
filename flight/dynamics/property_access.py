"""JSBSim's properties by name, bound to functions that read and set them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from aircraft.jsbsim_model import CommandProperty
from world.errors import FlightError

Getter = Callable[[], float]
Setter = Callable[[float], object]


class PropertyAccess:
    """The properties of one JSBSim instance with a model.

    manager: the instance's property manager.  model_file: named in errors.
    """

    def __init__(self, manager: Any, model_file: Path) -> None:
        self._manager, self._model_file = manager, model_file

    def _node(self, name: str) -> Any:
        # A node that is asked for is made, so that it is looked for first.
        node = self._manager.get_node(name) if self._manager.hasNode(name) else None
        if node is None:
            raise FlightError(
                f"{self._model_file}: property {name} is needed and not defined", file=self._model_file, field=name
            )
        return node

    def getter(self, name: str) -> Getter:
        """Bind a property to read; "" reads as zero.  Raises FlightError for one that is not defined."""
        if not name:
            return _nothing
        getter: Getter = self._node(name).get_double_value
        return getter

    def setter(self, name: str) -> Setter:
        """Bind a property to set.  Raises FlightError for one that is not defined."""
        setter: Setter = self._node(name).set_double_value
        return setter

    def command_setter(self, command: CommandProperty) -> Setter:
        """Bind a command to set in rad, or of the throttle, where its property may count otherwise."""
        setter, above, below = self.setter(command.name), command.above, command.below
        if above == below == 1.0:
            return setter
        return lambda value: setter(value * (above if value > 0.0 else below))

    def set(self, name: str, value: float) -> None:
        """Set a property once."""
        self.setter(name)(value)

    def set_optional(self, name: str, value: float, usual: float) -> None:
        """Set a property that a model need not have while its value is the usual one."""
        if value != usual or self._manager.hasNode(name):
            self.set(name, value)


def _nothing() -> float:
    """Zero, the reading of an aircraft without this quantity."""
    return 0.0
