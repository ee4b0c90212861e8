"""How functions that only compiled ones call are compiled: no further than their callers, who take them in, need them.

Without it a first command compiles half as long again, for code that never runs.
"""

from __future__ import annotations

from typing import Any, cast

from numba.core import codegen, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass  # pyright: ignore
from numba.core.datamodel import models
from numba.core.typed_passes import IRLegalization


class _Intermediate(codegen.JITCodeLibrary):  # pyright: ignore[reportUntypedBaseClass]
    """Code that other compiled functions take into their own, who optimise it and turn it into machine code.

    As the compiler has it, each function would be optimised and made machine code with all that it calls, and once more
    in each of its callers, whose copy is the one that runs.
    """

    def _optimize_final_module(self) -> None:
        """Left to those who take it in."""

    def _finalize_final_module(self) -> None:
        """The machine code is no more than the places where the functions' environments are kept."""
        self._finalized = True
        code = cast("Any", self._get_module_for_linking())  # pyright: ignore
        kept: list[str] = [place.name for place in code.global_variables if place.name.startswith("_ZN08NumbaEnv")]
        places = "".join(f'\n@"{name}" = common global i8* null' for name in kept)
        empty = str(self._codegen._create_empty_module(self.name))  # pyright: ignore
        self._final_module: Any = cast("Any", codegen).ll.parse_assembly(empty + places)
        self._final_module.name = self.name  # pyright: ignore
        super()._finalize_final_module()  # pyright: ignore


@register_pass(mutates_CFG=False, analysis_only=True)  # pyright: ignore
class _ForOthers(LoweringPass):  # pyright: ignore[reportUntypedBaseClass]
    """What follows goes into `_Intermediate`."""

    _name = "for_others"

    def __init__(self) -> None:
        LoweringPass.__init__(self)  # pyright: ignore

    def run_pass(self, state: Any) -> Any:  # noqa: ANN401 - the compiler's own
        state.library = _Intermediate(state.targetctx.codegen(), state.func_id.func_qualname)  # pyright: ignore
        state.library.enable_object_caching()
        return False


class CompilerForOthers(CompilerBase):  # pyright: ignore[reportUntypedBaseClass]
    """The compiler's usual way, with one pass more."""

    def define_pipelines(self) -> list[Any]:  # noqa: D102 - the compiler's own
        passes: Any = DefaultPassBuilder.define_nopython_pipeline(self.state)  # pyright: ignore
        passes.add_pass_after(_ForOthers, IRLegalization)
        passes.finalize()
        return [passes]


class Callee(types.Dispatcher):  # pyright: ignore[reportUntypedBaseClass]
    """Type of what compiled functions call: one function for all numbers of a type, where 0 is a type of its own."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:  # noqa: ANN401, D102 - the compiler's own
        plain = {name: types.unliteral(of) for name, of in kws.items()}  # pyright: ignore
        return super().get_call_type(context, [types.unliteral(of) for of in args], plain)  # pyright: ignore


models.register_default(Callee)(models.OpaqueModel)  # pyright: ignore
