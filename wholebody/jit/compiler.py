"""How numba compiles functions that only other compiled functions call: without machine code of their own.

numba makes machine code, an entry for Python and an optimised module for each function, also where it ends up inside
its caller, whose module is then optimised again with all of that in it: half of the time. Here such a function is
translated only, and what calls it from Python takes in all that it needs and is optimised once.

Source:
    numba, "Customizing the compiler" (developer manual), and `numba.core.codegen.CPUCodeLibrary.finalize`.
"""

from __future__ import annotations

from llvmlite.binding import ModuleRef, parse_assembly
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes

NEEDLESS = (InlineClosureLikes, InlineOverloads, NopythonRewrites)
"""What looks for closures, for functions to be copied into their callers, and for arithmetic on whole arrays: there is
none in what is compiled here, and looking takes a tenth of the time."""


class _InnerLibrary(JITCodeLibrary):
    """Code of one function, neither linked nor optimised nor turned into machine code."""

    def _optimize_functions(self, ll_module: ModuleRef) -> None:
        """Whoever takes it in optimises it."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalize_dynamic_globals()
        self._finalized = True

    def alone(self) -> ModuleRef:
        """Without the functions below it."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> ModuleRef:
        # Callers that know nothing of this expect to find in it all that it needs.
        whole = self.alone().clone()
        for one in _below(self):
            whole.link_in(_Part(one)._get_module_for_linking(), preserve=True)
        return whole


class _EntryLibrary(JITCodeLibrary):
    """Code of a function with that of all functions below it."""

    def finalize(self) -> None:
        self._linking_libraries = [_Part(one) for one in _below(self)]
        super().finalize()

    def serialize_using_object_code(self) -> tuple:
        """Its machine code, and which names it defines. Nobody takes the function in, so nobody needs the rest."""
        whole = self._final_module
        names = [f'define void @"{one.name}"() {{ ret void }}' for one in whole.functions if not one.is_declaration]
        names += [f'@"{one.name}" = global i8 0' for one in whole.global_variables if not one.is_declaration]
        stubs = parse_assembly("\n".join([f'target triple = "{whole.triple}"', *names]))
        return self.name, "object", (self._get_compiled_object(), stubs.as_bitcode())


class _Part:
    """A library as it is to be linked by one that has those below it too."""

    def __init__(self, library: JITCodeLibrary) -> None:
        self._library, self._reload_init = library, library._reload_init

    def _get_module_for_linking(self) -> ModuleRef:
        one = self._library
        return one.alone() if isinstance(one, _InnerLibrary) else one._get_module_for_linking()


def _below(library: JITCodeLibrary) -> dict[JITCodeLibrary, None]:
    """All libraries that one needs, itself left out, each once."""
    found: dict[JITCodeLibrary, None] = {}
    waiting = list(library._linking_libraries)
    while waiting:
        one = waiting.pop()
        if one not in found:
            found[one] = None
            waiting += one._linking_libraries
    return found


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(NativeLowering):
    _name = "inner_lowering"

    def run_pass(self, state) -> bool:
        flags, context = state.flags, state.targetctx
        flags.no_compile, flags.no_cpython_wrapper, flags.no_cfunc_wrapper = True, True, True
        state.library = _InnerLibrary(context.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        super().run_pass(state)
        # numba knows a compiled function by its entry; this one has none, so anything that is like no other will do.
        nobody = [].append
        context.insert_user_function(nobody, state["cr"].fndesc, [state.library])
        state["cr"] = state["cr"]._replace(cfunc=nobody)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _EntryLowering(NativeLowering):
    _name = "entry_lowering"

    def run_pass(self, state) -> bool:
        state.library = _EntryLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


class _Compiler(CompilerBase):
    lowering: type[NativeLowering]

    def define_pipelines(self) -> list:
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.add_pass_after(self.lowering, NativeLowering)
        manager.passes = [(one, why) for one, why in manager.passes if one not in (NativeLowering, *NEEDLESS)]
        manager.finalize()
        return [manager]


class InnerCompiler(_Compiler):
    """For functions that only compiled functions call."""

    lowering = _InnerLowering


class EntryCompiler(_Compiler):
    """For functions that Python calls."""

    lowering = _EntryLowering
