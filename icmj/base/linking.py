"""numba's internals, used to link compiled functions as intermediate code and to load compiled code from the disk.

numba optimises every function when it is defined, makes machine code of it, and does both again in each function that
calls it. Here the first is left out: what is linked into an entry point is optimised there, once, with everything else.
A third of the time to compile goes with it, and what comes out is no slower. numba is imported here first, without the
settings of a working folder.

This is one of two modules that use what a library does not promise to keep (the other is
:mod:`icmj.engine.native.memory`): without it the first run on a machine compiles for twice as long. numba's version is
therefore fixed in ``pyproject.toml``, and what is linked is compared with plain Python in the tests.
"""

# ruff: noqa: E402, what follows numba's own import must stand behind it

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def _without_yaml() -> Iterator[None]:
    """Within the block PyYAML is not found.

    numba takes settings from ``.numba_config.yaml`` in the working folder, among them the folder of its cache, whose
    files run code, and does so only where it finds PyYAML as it is imported. Otherwise it warns of the file.
    """
    before = {name: sys.modules[name] for name in ["yaml"] if name in sys.modules}
    sys.modules["yaml"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules["yaml"]
        sys.modules.update(before)


warnings.filterwarnings("ignore", "A Numba config file is found", UserWarning, r"numba\.core\.config")
with _without_yaml():
    import numba as numba
from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import environment, event
from numba.core.caching import FunctionCache
from numba.core.ccallback import CFunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.runtime import rtsys
from numba.core.sigutils import normalize_signature
from numba.core.typed_passes import NativeLowering
from numba.core.typing.templates import AttributeTemplate as AttributeTemplate


class _Intermediate(JITCodeLibrary):
    """A code library that is linked into its callers and optimised there."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _IntermediateLowering(NativeLowering):
    """numba's lowering without a function address: callers find the function by name in the library that they link.

    It stays a function there unless it says otherwise: copies by the optimiser's own choice double what it has to
    compile.
    """

    _name = "intermediate_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _Intermediate(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        result = state["cr"]
        found = result.fndesc
        if not state.flags.forceinline:
            state.library.get_function(found.llvm_func_name).add_function_attribute("noinline")
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


class _Disk(FunctionCache):
    """Disk cache whose code is loaded without initialising numba's compiler, which takes 0.1 s in every process."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors(), _modules_of_numba_left_alone():
            try:
                return self._load_overload(sig, target_context)
            except (AttributeError, ImportError):  # of another version: types are named in it that are gone
                self._cache_file.flush()
        return None  # what numba's own makes of an error that it swallows


@contextmanager
def _modules_of_numba_left_alone() -> Iterator[None]:
    """Load code from the disk without the modules of numba that the functions in it were written in.

    A function that is linked keeps the name of its module, whose globals code that runs in Python would look into. What
    is compiled here does not; importing the modules that implement arrays takes as long as loading the code.
    """

    def rebuild(module: str, consts: Any, name: str) -> Any:
        if not module.startswith("numba."):
            return original(module, consts, name)
        if (known := environment.lookup_environment(name)) is not None:
            return known
        made = environment.Environment({"__name__": module})
        made.consts[:] = consts
        made.env_name = name
        environment.Environment._memo[name] = made
        return made

    with global_compiler_lock:  # held by whoever loads already: no other thread meets the function in between
        original = environment._rebuild_env
        environment._rebuild_env = rebuild
        try:
            yield
        finally:
            environment._rebuild_env = original


def load_from_disk(made: Any) -> Any:
    """A dispatcher or C function whose code is taken from the disk where it is there."""
    if type(made._cache) is FunctionCache:
        made._cache.__class__ = _Disk
    return made


def c_function(signature: str, cache: bool = False, **options: Any) -> Any:
    """The same as ``numba.cfunc``, with :func:`load_from_disk`."""

    def make(function: Any) -> Any:
        made = CFunc(function, normalize_signature(signature), {}, options)
        if cache:
            made.enable_caching()
        load_from_disk(made).compile()
        return made

    return make


class _Listener(event.Listener):
    def __init__(self, begin: Callable[[], None], end: Callable[[], None]) -> None:
        self._begin, self._end = begin, end

    def on_start(self, what: Any) -> None:
        self._begin()

    def on_end(self, what: Any) -> None:
        self._end()


def listen(begin: Callable[[], None], end: Callable[[], None]) -> None:
    """Call these whenever numba begins and ends to compile because the disk cache has no matching code."""
    event.register("numba:compile", _Listener(begin, end))
