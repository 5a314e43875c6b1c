"""What numba has to know of `Packed`: an attribute is a view without an owner, made on the spot from the table.

There is nothing whose references could be counted: the memory belongs to the caller. Importing this imports numba.

Source:
    numba, "Low-level extension API".
"""

from __future__ import annotations

from hashlib import sha256

from numba import typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array

from wholebody.jit.packed import TABLE_ROW, Packed

__all__ = ["PackedType", "typeof"]

_KINDS = {"f": types.float64, "i": types.int64}
_MEMORY = types.float64[::1]


class PackedType(types.Type):
    """The type of a `Packed` with these fields, whatever their lengths."""

    def __init__(self, fields: tuple[tuple[str, str, int], ...]) -> None:
        self.fields = fields
        self.index = {name: k for k, (name, _, _) in enumerate(fields)}
        super().__init__(name=f"Packed({sha256(repr(fields).encode()).hexdigest()[:12]})")

    @property
    def key(self) -> tuple:
        """Types of equal fields are equal."""
        return self.fields

    def field(self, name: str) -> types.Type | None:
        """Numba's type of a field; None if there is none of that name."""
        if name not in self.index:
            return None
        _, kind, ndim = self.fields[self.index[name]]
        return types.Array(_KINDS[kind], ndim, "C") if ndim else _KINDS[kind]


@typeof_impl.register(Packed)
def _typeof(packed, context):
    return PackedType(packed.fields)


@register_model(PackedType)
class _Model(models.StructModel):
    """A pointer to the memory."""

    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, [("memory", types.CPointer(types.int64))])


@unbox(PackedType)
def _unbox(kind, packed, c):
    array = c.pyapi.object_getattr_string(packed, "memory")
    memory = c.context.make_array(_MEMORY)(c.context, c.builder, c.unbox(_MEMORY, array).value)
    c.pyapi.decref(array)
    native = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    native.memory = c.builder.bitcast(memory.data, native.memory.type)
    return NativeValue(native._getvalue())


@infer_getattr
class _Fields(AttributeTemplate):
    key = PackedType

    def generic_resolve(self, kind, name):
        return kind.field(name)


def _place(context, builder, kind, value, name):
    """Pointer to a field, and its lengths."""
    memory = cgutils.create_struct_proxy(kind)(context, builder, value).memory
    at, ndim = TABLE_ROW * kind.index[name], kind.fields[kind.index[name]][2]
    start, *lengths = (builder.load(cgutils.gep_inbounds(builder, memory, at + i)) for i in range(1 + ndim))
    element = context.get_data_type(_KINDS[kind.fields[kind.index[name]][1]])
    pointer = builder.bitcast(builder.gep(memory, [start]), element.as_pointer())
    return pointer, lengths


@lower_getattr_generic(PackedType)
def _get(context, builder, kind, value, name):
    pointer, lengths = _place(context, builder, kind, value, name)
    if not lengths:
        return builder.load(pointer)
    size = context.get_constant(types.intp, 8)
    strides, stride = [], size
    for length in reversed(lengths):
        strides.insert(0, stride)
        stride = builder.mul(stride, length)
    view = context.make_array(kind.field(name))(context, builder)
    populate_array(view, data=pointer, shape=lengths, strides=strides, itemsize=size, meminfo=None)
    return view._getvalue()


@lower_setattr_generic(PackedType)
def _set(context, builder, signature, arguments, name):
    kind, given = signature.args
    pointer, _ = _place(context, builder, kind, arguments[0], name)
    builder.store(context.cast(builder, arguments[1], given, kind.field(name)), pointer)
