// Records with a call become the table that the front end binds arguments by.

// RUN: warp-tblgen -gen-python-calls %s | FileCheck %s
// RUN: warp-tblgen -gen-pyi %s | FileCheck %s --check-prefix=STUBS
// RUN: warp-tblgen -gen-docs %s | FileCheck %s --check-prefix=DOCS

include "WarpBuiltinBase.td"

// CHECK-LABEL: CALLS = {

// Calls and messages become functions of the parameters and letters; other
// names are fields of the call.
// CHECK-LABEL: "fold": (
// CHECK: ("a", ("tile", "F", ("N", "K", ), ), "inout", ...),
// CHECK-SAME: ("mode", ("|", "lower", "upper", ), "", 'lower'),
// CHECK-NEXT: ("F", "N", "K", ),
// CHECK: lambda call, a, mode, F, N, K: F.width >= 32,
// CHECK-NEXT: lambda call, a, mode, F, N, K: f"expects {call.bits(32)} bits, but got {F.width}",
// CHECK-NEXT: True, "cast it", "peer's words",
// CHECK: False,
// CHECK-NEXT: lambda call, a, mode, F, N, K: call.make('fold', call.tiles.cut(call.node, a), flag=mode == 'upper'),
def Warp_FoldName : Warp_Special<"fold", "Tiles",
    ["(a: inout tile<F, [N, K]>, mode: 'lower'|'upper' = 'lower') -> None"],
    "folds", ["make('fold', tiles.cut(node, a), flag=mode == 'upper')"]> {
  let requirements = [
    RequireType<"F.width >= 32", "expects {bits(32)} bits, but got {F.width}",
                "cast it", "peer's words">];
}

// A requirement belongs to the overloads that have all of its names.
// CHECK-LABEL: "take": (
// CHECK: ("items", ("index", "a", ), "*", ...),
// CHECK-SAME: ("key", "Any", "keyword", 1.0),
// CHECK-NOT: limit > 0
// CHECK: True,
// CHECK-NEXT: lambda call, a, items, key, k, A: call.one(*items),
// CHECK: ("limit", ("const", "int", ), "", ...),
// CHECK: lambda call, a, limit, k, A: limit > 0,
// CHECK: lambda call, a, limit, k, A: call.all_of(a, k),
def Warp_TakeName : Warp_Special<"take", "Arrays",
    ["(a: array<k, A>, *items: index<a>, *, key: Any = 1.0) -> i32",
     "(a: array<k, A>, limit: const<int>) -> (A, i32)"], "takes",
    ["one(*items)", "all_of(a, k)"]> {
  let requirements = [Require<"limit > 0", "expects a positive limit">];
}

// A name without a call is the front end's own.
// CHECK-NOT: "tell"
def Warp_TellName : Warp_Special<"tell", "Functions",
    ["(text: str) -> None"], "tells">;

// STUBS: def fold(a: Any, mode: str = 'lower') -> None:
// STUBS: @typing.overload
// STUBS-NEXT: def take(a: array, *items: int, key: Any = 1.0) -> int:
// STUBS: def take(a: array, limit: int) -> tuple: ...

// DOCS: fold(a: inout tile<F, [N, K]>, mode: 'lower'|'upper' = 'lower') -> None
