"""Faster loading of compiled code that numba kept on disk: what only another compilation needs is left out.

These functions replace private parts of numba. Where a version has other parts, code loads as numba does it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core.runtime import rtsys  # type: ignore[attr-defined]


def speed_up_loading(kept: Any) -> None:
    """Let a cache of numba load compiled code without what only compilations need, which takes half of the time.

    A compilation loads the registries of types and functions itself, and gets the intermediate code of a kernel that
    it calls when it links it.
    """
    load, rebuild = getattr(kept, "_load_overload", None), getattr(getattr(kept, "_impl", None), "rebuild", None)
    guard = getattr(kept, "_guard_against_spurious_io_errors", None)
    if load is None or rebuild is None or guard is None:
        return

    def load_overload(signature: Any, context: Any) -> Any:
        rtsys.initialize(context)  # kernels allocate arrays by it
        with guard():
            return load(signature, context)

    def rebuild_with_machine_code(context: Any, data: Any) -> Any:
        defined = getattr(getattr(context.codegen(), "_engine", None), "_defined_symbols", None)
        match data:
            case ((str(name), "object", (bytes(machine_code), bytes(bitcode))), described, *rest) if (
                defined is not None
            ):
                defined.add(described.llvm_cpython_wrapper_name)  # else numba learns it from the bitcode
                result = rebuild(context, ((name, "object", (machine_code, _empty_bitcode())), described, *rest))
                _parse_when_linked(result.library, bitcode)
                return result
        return rebuild(context, data)

    kept.load_overload = load_overload
    kept._impl.rebuild = rebuild_with_machine_code


def _parse_when_linked(library: Any, bitcode: bytes) -> None:
    """Give a library its intermediate code when another one links it."""

    @cache
    def module_for_linking() -> Any:
        return llvm.parse_bitcode(bitcode)

    library._shared_module = None
    library._get_module_for_linking = module_for_linking


@cache
def _empty_bitcode() -> bytes:
    """Return the bitcode of a module without functions."""
    return bytes(llvm.parse_assembly("").as_bitcode())
