"""Named tuples that kernels take as one pointer.

To numba a named tuple is all of its numbers, and an array seven of them: a problem of the planner is 174, which every
call hands on, every signature names and every inlined copy repeats.  A third of the compiling was for these.  A class
marked `by_reference` lies in memory once, as its instance is first handed to a kernel, and kernels read the field that
they ask for through a pointer.

They can only read it: they neither make such a tuple nor return it.  Its arrays are borrowed from the Python tuple,
which outlives the call; they must not be returned either.
"""

import ctypes
import hashlib
from typing import Any, NamedTuple, TypeVar, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.core.typing.typeof import typeof_impl
from numba.extending import NativeValue, infer_getattr, lower_getattr_generic, models, register_model, unbox

_Class = TypeVar("_Class", bound=type[Any])
_NUMBERS: dict[Any, Any] = {
    types.float64: ctypes.c_double,
    types.int64: ctypes.c_int64,
    types.boolean: ctypes.c_uint8,
}


class Reference(types.Type):
    """Numba's type of a pointer to a named tuple's fields as they lie in memory."""

    def __init__(self, held: Any) -> None:
        """Point to this named tuple type; a short name for it keeps the names of compiled functions short."""
        self.held = held
        digest = hashlib.sha256(held.name.encode()).hexdigest()[:16]
        super().__init__(f"{held.instance_class.__name__}_{digest}")

    @property
    def key(self) -> Any:
        """What makes two of them equal."""
        return self.held


class _Layout(NamedTuple):
    """What is made of an instance once: its type, and its fields in memory."""

    reference: Reference
    memory: Any


def by_reference(cls: _Class) -> _Class:
    """Let kernels take instances of a class of `typing.NamedTuple` as one pointer, and read its fields.

    Its fields are numbers, arrays, records and named tuples of such.  Records are copied when it is first handed over.

    >>> import numba
    >>> from world.airspace.zone_kernels import zone_records
    >>> numba.typeof(zone_records([])).held.fields
    ('zones', 'edges')
    """
    members = {name: getattr(cls, name) for name in ("__doc__", "__module__", "__qualname__")}
    # The class itself has no place for the layout, which its subclass has.
    made = type(cls.__name__, (cls,), members | {"_address": property(_address), "__getstate__": lambda _: None})
    typeof_impl.register(made)(lambda value, _: _layout(value).reference)
    return cast("_Class", made)


def _layout(value: Any) -> _Layout:
    kept: dict[str, Any] = vars(value)
    if "_layout" not in kept:
        held = _held(typeof_impl.dispatch(tuple)(value, None))
        kept["_layout"] = _Layout(Reference(held), _in_memory(held, value))
    layout: _Layout = kept["_layout"]
    return layout


def _address(value: Any) -> int:
    return ctypes.addressof(_layout(value).memory)


def _held(kind: Any) -> Any:
    """A type whose named tuples stand in it by their values, as in memory."""
    if isinstance(kind, Reference):
        return kind.held
    if isinstance(kind, types.Array):
        # Whether Python may write them, which another process's copies may be, makes no kernel another one.
        return kind.copy(readonly=True)
    if _is_named(kind):
        return types.BaseTuple.from_types([_held(member) for member in kind.types], kind.instance_class)
    return kind


def _is_named(kind: Any) -> bool:
    return isinstance(kind, types.BaseNamedTuple)


def _is_tuple(kind: Any) -> bool:
    return isinstance(kind, types.BaseTuple)


def _in_memory(kind: Any, value: Any) -> Any:
    """A value of a numba type as its data lies in memory, where its address is taken."""
    if isinstance(kind, types.Array):
        # As numba's array structure: two owners, of which there is none, then these.
        words = [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
        return (ctypes.c_ssize_t * len(words))(*words)
    if isinstance(kind, types.Record):
        return (ctypes.c_uint8 * kind.size).from_buffer_copy(value.tobytes())
    if _is_tuple(kind):
        parts = [_in_memory(member, one) for member, one in zip(kind.types, value, strict=True)]
        fields = [(f"field{k}", type(part)) for k, part in enumerate(parts)]
        made: Any = type("Fields", (ctypes.Structure,), {"_fields_": fields})
        return made(*parts)
    return _NUMBERS[kind](value)


def _member(kind: Reference, name: str) -> tuple[int, Any]:
    """Number and type of a field, a marked class's again as a pointer."""
    number = kind.held.fields.index(name)
    member = kind.held.types[number]
    if _is_named(member) and hasattr(member.instance_class, "_address"):
        return number, Reference(member)
    return number, member


@register_model(Reference)
class _Pointer(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Reference) -> None:
        super().__init__(manager, kind, ir.PointerType(manager[kind.held].get_data_type()))


@infer_getattr
class _Field(AttributeTemplate):
    key = Reference

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]  # numba names no argument
        return _member(kind, name)[1] if name in kind.held.fields else None


@lower_getattr_generic(Reference)
def _read_field(context: Any, builder: Any, kind: Reference, pointer: Any, name: str) -> Any:
    number, member = _member(kind, name)
    place = cgutils.gep_inbounds(builder, pointer, 0, number)
    if isinstance(member, Reference):
        return place
    return impl_ret_borrowed(context, builder, member, context.unpack_value(builder, member, place))


@unbox(Reference)
def _take(kind: Reference, value: Any, c: Any) -> Any:
    pointer_type = c.context.get_value_type(kind)
    pointer = cgutils.alloca_once_value(c.builder, ir.Constant(pointer_type, None))
    address = c.pyapi.object_getattr_string(value, "_address")
    failed = cgutils.is_null(c.builder, address)
    with c.builder.if_then(c.builder.not_(failed)):
        c.builder.store(c.builder.bitcast(c.pyapi.long_as_voidptr(address), pointer_type), pointer)
        c.pyapi.decref(address)
    return NativeValue(c.builder.load(pointer), is_error=failed)
