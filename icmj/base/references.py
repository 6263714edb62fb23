"""A named tuple of arrays handed on by its address, in compiled code.

numba passes a named tuple as all its numbers, seven for each vector: the data of a run are more than a thousand, copied
at every call and wherever a function is written into another, and the compiler looks at each copy. A reference is one
address, and what is read of it is what is used.
"""

from __future__ import annotations

from typing import Any

from icmj.base.process import INTERPRETED

# numba rewrites signatures of intrinsics, which type checkers cannot see
# mypy: disable-error-code="call-arg, no-untyped-def, no-redef"

if INTERPRETED:

    def refer(whole):
        """The named tuple itself; compiled code hands on its address."""
        return whole

else:
    from icmj.base.linking import AttributeTemplate  # numba is imported there first

    # isort: split
    from llvmlite import ir  # type: ignore[import-untyped]
    from numba import types
    from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model

    class Reference(types.Type):
        """Type of the address of a named tuple, which does not change while it is referred to; its arrays may."""

        def __init__(self, whole: types.NamedTuple) -> None:
            self.whole = whole
            super().__init__(name=f"Reference({whole})")

    register_model(Reference)(models.OpaqueModel)

    @infer_getattr
    class _Fields(AttributeTemplate):
        key = Reference

        def generic_resolve(self, reference: Reference, name: str) -> Any:  # type: ignore[override]
            if name in reference.whole.fields:
                field = reference.whole[reference.whole.fields.index(name)]
                return Reference(field) if isinstance(field, types.NamedTuple) else field
            return None

    @lower_getattr_generic(Reference)
    def _read(context: Any, builder: Any, reference: Reference, address: Any, name: str) -> Any:
        place = reference.whole.fields.index(name)
        whole = builder.bitcast(address, context.get_value_type(reference.whole).as_pointer())
        zero, at = (ir.Constant(ir.IntType(32), each) for each in (0, place))
        field = builder.gep(whole, [zero, at], inbounds=True)
        if isinstance(reference.whole[place], types.NamedTuple):
            return builder.bitcast(field, address.type)
        value = builder.load(field)
        if context.enable_nrt:
            context.nrt.incref(builder, reference.whole[place], value)
        return value

    @intrinsic
    def refer(typing_context: Any, whole: Any) -> Any:
        """The address of a named tuple; valid while the function runs that asked for it."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            with builder.goto_entry_block():
                place = builder.alloca(arguments[0].type)
            builder.store(arguments[0], place)
            return builder.bitcast(place, ir.IntType(8).as_pointer())

        return Reference(whole)(whole), codegen
