"""Compiled functions that other compiled functions call, and nobody else, kept as intermediate code.

numba optimises every function when it is defined, makes machine code of it, and does both again in each function that
calls it. Here the first is left out: what is linked into an entry point is optimised there, once, with everything else.
A third of the time to compile goes with it, and what comes out is no slower.
"""

from __future__ import annotations

from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class _Intermediate(JITCodeLibrary):
    """Code to be linked into others' and optimised there."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _IntermediateLowering(NativeLowering):
    """As numba's own, without an address: callers find the function by its name in the library they link."""

    _name = "intermediate_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _Intermediate(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        result = state["cr"]
        found = result.fndesc
        address = _dynfunc.make_function(found.lookup_module(), found.qualname, "", 0, result.env, (state.library,))
        state.targetctx.insert_user_function(address, found, [state.library])
        state["cr"] = result._replace(cfunc=address)
        return True


class Linked(CompilerBase):
    """numba's compiler for functions that only compiled code calls; as ``pipeline_class``.

    What is so compiled must not raise with arguments of run time: they would need the function's own environment, which
    only an entry point has. Called from Python it crashes.
    """

    def define_pipelines(self) -> list[PassManager]:
        """numba's own passes with another lowering."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_IntermediateLowering if each is NativeLowering else each, why) for each, why in passes.passes
        ]
        passes.finalize()
        return [passes]
