"""Native addresses in compiled code: casting them to arrays, and calling the function at one."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def pointer_to(item: Any) -> Any:
    """An intrinsic that casts an integer address to a pointer to ``item``."""

    @intrinsic
    def pointer(typing_context: Any, address: Any) -> tuple[Any, Callable[..., Any]]:
        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(item)(types.int64), codegen

    return pointer


float_pointer = pointer_to(types.float64)
address_pointer = pointer_to(types.int64)


@intrinsic
def call_address(
    typing_context: Any, address: Any, first: Any, second: Any, third: Any, fourth: Any
) -> tuple[Any, Callable[..., Any]]:
    """Call the C function void(int64, int64, int64, int64) at an address."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [word] * 4)
        pointer = builder.inttoptr(arguments[0], function.as_pointer())
        builder.call(pointer, arguments[1:])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 5), codegen
