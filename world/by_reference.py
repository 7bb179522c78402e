"""Named tuples that are passed to kernels as one pointer.

Numba passes a named tuple as all of its numbers, and an array as seven numbers. A problem of the planner consists of
174 numbers, which are repeated in every call, every signature and every inlined copy, and took a third of the compile
time. An instance of a class marked `by_reference` is laid out in memory once, when it is first passed to a kernel, and
kernels read the fields that they need through a pointer.

Kernels can only read such a tuple: they can neither make nor return it. Its arrays are borrowed from the Python tuple,
which outlives the call; kernels must not return them either.
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
    """Numba's type of a pointer to the fields of a named tuple in memory."""

    def __init__(self, tuple_type: Any) -> None:
        """Make a reference to a named tuple type.

        Its short name keeps the names of compiled functions short.
        """
        self.tuple_type = tuple_type
        digest = hashlib.sha256(tuple_type.name.encode()).hexdigest()[:16]
        super().__init__(f"{tuple_type.instance_class.__name__}_{digest}")

    @property
    def key(self) -> Any:
        """Key for numba's comparison of references."""
        return self.tuple_type


class _Layout(NamedTuple):
    """Memory layout of an instance, which is made once.

    reference: numba's type of the pointer to it.
    memory: ctypes data with its fields.
    """

    reference: Reference
    memory: Any


def by_reference(cls: _Class) -> _Class:
    """Decorate a `typing.NamedTuple` class so that kernels take its instances as one pointer.

    A kernel is a function that numba compiles. It reads the fields through the pointer. The fields must be numbers,
    arrays, records or named tuples of these. Records are copied when an instance is first passed to a kernel. Returns a
    subclass of the class.

    >>> import numba
    >>> from world.airspace.zone_kernels import zone_records
    >>> numba.typeof(zone_records([])).tuple_type.fields
    ('zones', 'edges')
    """
    members = {name: getattr(cls, name) for name in ("__doc__", "__module__", "__qualname__")}
    # A named tuple has no __dict__ to store the layout; its subclass has one.
    marked_class = type(
        cls.__name__, (cls,), members | {"_address": property(_instance_address), "__getstate__": lambda _: None}
    )
    typeof_impl.register(marked_class)(lambda value, _: _get_layout(value).reference)
    return cast("_Class", marked_class)


def _get_layout(value: Any) -> _Layout:
    """Return the memory layout of an instance; it is made at the first call and stored in the instance."""
    attributes: dict[str, Any] = vars(value)
    if "_layout" not in attributes:
        tuple_type = _replace_references(typeof_impl.dispatch(tuple)(value, None))
        attributes["_layout"] = _Layout(Reference(tuple_type), _lay_out_in_memory(tuple_type, value))
    return attributes["_layout"]


def _instance_address(value: Any) -> int:
    """Return the address of an instance's fields in memory."""
    return ctypes.addressof(_get_layout(value).memory)


def _replace_references(numba_type: Any) -> Any:
    """Return a numba type in which each reference is replaced by the named tuple type that it refers to."""
    if isinstance(numba_type, Reference):
        return numba_type.tuple_type
    if isinstance(numba_type, types.Array):
        # Writable and read-only arrays share a kernel; copies in another process may be writable.
        return numba_type.copy(readonly=True)
    if _is_named_tuple(numba_type):
        return types.BaseTuple.from_types(
            [_replace_references(member) for member in numba_type.types], numba_type.instance_class
        )
    return numba_type


def _is_named_tuple(numba_type: Any) -> bool:
    """Return True for numba's type of a named tuple."""
    return isinstance(numba_type, types.BaseNamedTuple)


def _is_tuple(numba_type: Any) -> bool:
    """Return True for numba's type of a tuple, named or not."""
    return isinstance(numba_type, types.BaseTuple)


def _lay_out_in_memory(numba_type: Any, value: Any) -> Any:
    """Lay out a value in memory as kernels expect it for its numba type; return it as ctypes data."""
    if isinstance(numba_type, types.Array):
        # Numba's array structure: two owner pointers, both null, then these fields.
        array_fields = [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
        return (ctypes.c_ssize_t * len(array_fields))(*array_fields)
    if isinstance(numba_type, types.Record):
        return (ctypes.c_uint8 * numba_type.size).from_buffer_copy(value.tobytes())
    if _is_tuple(numba_type):
        parts = [
            _lay_out_in_memory(member, member_value)
            for member, member_value in zip(numba_type.types, value, strict=True)
        ]
        fields = [(f"field{k}", type(part)) for k, part in enumerate(parts)]
        structure: Any = type("Fields", (ctypes.Structure,), {"_fields_": fields})
        return structure(*parts)
    return _NUMBERS[numba_type](value)


def _find_field(reference: Reference, name: str) -> tuple[int, Any]:
    """Return the index and the numba type of a field of the named tuple that a reference points to.

    The type is a `Reference` if the field's class is marked `by_reference`.
    """
    index = reference.tuple_type.fields.index(name)
    member = reference.tuple_type.types[index]
    if _is_named_tuple(member) and hasattr(member.instance_class, "_address"):
        return index, Reference(member)
    return index, member


@register_model(Reference)
class _Pointer(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Reference) -> None:
        super().__init__(manager, kind, ir.PointerType(manager[kind.tuple_type].get_data_type()))


@infer_getattr
class _Field(AttributeTemplate):
    key = Reference

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]  # numba names no argument
        """Return the numba type of a field; None if the named tuple has no such field.

        kind: reference to the named tuple.
        """
        return _find_field(kind, name)[1] if name in kind.tuple_type.fields else None


@lower_getattr_generic(Reference)
def _read_field(context: Any, builder: Any, reference: Reference, pointer: Any, name: str) -> Any:
    """Generate the code that reads a field of a named tuple through its pointer.

    A field whose class is marked `by_reference` is read as a pointer.
    """
    index, member = _find_field(reference, name)
    field_pointer = cgutils.gep_inbounds(builder, pointer, 0, index)
    if isinstance(member, Reference):
        return field_pointer
    return impl_ret_borrowed(context, builder, member, context.unpack_value(builder, member, field_pointer))


@unbox(Reference)
def _unbox_reference(kind: Reference, value: Any, c: Any) -> Any:
    """Generate the code that converts a Python instance to the pointer that a kernel takes.

    kind: numba's type of the pointer.
    value, c: the instance and numba's context in the generated code.
    """
    pointer_type = c.context.get_value_type(kind)
    pointer = cgutils.alloca_once_value(c.builder, ir.Constant(pointer_type, None))
    address = c.pyapi.object_getattr_string(value, "_address")
    has_failed = cgutils.is_null(c.builder, address)
    with c.builder.if_then(c.builder.not_(has_failed)):
        c.builder.store(c.builder.bitcast(c.pyapi.long_as_voidptr(address), pointer_type), pointer)
        c.pyapi.decref(address)
    return NativeValue(c.builder.load(pointer), is_error=has_failed)
