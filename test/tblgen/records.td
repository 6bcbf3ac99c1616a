// One record of each kind, through every back end.

// RUN: warp-tblgen -gen-builtin-table %s | FileCheck %s --check-prefix=TABLE
// RUN: warp-tblgen -gen-lowerings %s | FileCheck %s --check-prefix=LOWER
// RUN: warp-tblgen -gen-python-table %s | FileCheck %s --check-prefix=PYTHON
// RUN: warp-tblgen -gen-pyi %s | FileCheck %s --check-prefix=STUBS
// RUN: warp-tblgen -gen-docs %s | FileCheck %s --check-prefix=DOCS

include "WarpBuiltinBase.td"

def Warp_ZipOp : Warp_Builtin<"zip", "Pairs",
    ["(a: S, b: S = 2) -> S", "(v: inout vec<3,F>, q: quat<F>) -> (bool, i32)"],
    "puts \"both\" together", Elementwise<"arith::AddFOp", "arith::AddIOp">> {
  let symbol = "~~";
  let domain = ["[0, 1]", "[2, 3]"];
  let derivative = PiecewiseConstant;
}
def Warp_ApplyOp : Warp_Builtin<"apply", "Functions",
    ["(m: mat<r,c,F>, v: vec<c,F>) -> ()"], "applies"> {
  let smoothDomain = ["[-1, 1]", "[2, 3]"];
}
def Warp_TellName : Warp_Special<"tell", "Functions",
    ["(text: str, *args: Any) -> None"], "tells">;
let module = "places", group = "Functions" in
def : Warp_LibraryFunction<"within", ["(a: float) -> bool"], "looks">;

// The table is sorted by name.
// TABLE-LABEL: builtinTable[] = {
// TABLE-NEXT: {"apply", "", "warp.apply", "Functions",
// TABLE: {"tell", "", "", "Functions",
// TABLE: warp::DerivativeKind::None, true},
// TABLE: {"zip", "~~", "warp.zip", "Pairs",
// TABLE-NEXT: "puts \"both\" together",
// TABLE-NEXT: overloadsOf_zip, warp::DerivativeKind::Zero, false},

// C++ knows nothing of library functions.
// TABLE-NOT: within

// LOWER: WARP_BY_FUNCTION(Apply)
// LOWER: WARP_ELEMENTWISE(ZipOp, ::mlir::arith::AddFOp, ::mlir::arith::AddIOp, ::mlir::arith::AddIOp)

// PYTHON-LABEL: LIBRARY = {
// PYTHON-NEXT: "within": "warp._src.places",
// PYTHON-LABEL: BUILTINS = {
// PYTHON-NOT: "within"
// PYTHON: "tell": (
// PYTHON-NEXT: "Functions",
// PYTHON-NEXT: "tells",
// PYTHON: "(text: str, *args: Any) -> None",
// PYTHON: "(a: S, b: S = 2) -> S",
// PYTHON-NEXT: "(v: inout vec<3, F>, q: quat<F>) -> (bool, int32)",
// PYTHON-LABEL: DERIVATIVES = {
// PYTHON-NEXT: "apply": "differentiable",
// PYTHON-LABEL: DOMAINS = {
// PYTHON-NEXT: "zip": (
// PYTHON-NEXT: "[0, 1]",
// PYTHON-LABEL: SMOOTH_DOMAINS = {
// PYTHON-NEXT: "apply": (
// PYTHON-NEXT: "[-1, 1]",
// PYTHON-LABEL: OPERATORS = {
// PYTHON-NEXT: "zip": "~~",

// STUBS-LABEL: vec3: TypeAlias
// STUBS: def apply(m: _Mat[_r, _c, _F], v: _Vec[_c, _F]) -> None:
// STUBS-NEXT: "applies"
// STUBS: def tell(text: str, *args: Any) -> None:
// STUBS: def within(a: float) -> builtins.bool:
// STUBS: @typing.overload
// STUBS-NEXT: def zip(a: _S, b: _S = ...) -> _S:
// STUBS: @typing.overload
// STUBS-NEXT: def zip(v: _Vec[Literal[3], _F], q: _Quat[_F]) -> tuple[builtins.bool, int]: ...

// Groups come in the order of their first record.
// DOCS: - [Pairs](#pairs): `zip`
// DOCS-NEXT: - [Functions](#functions): `apply`, `tell`, `within`
// DOCS-LABEL: ## Pairs
// DOCS: ### zip `~~`
// DOCS: puts "both" together. Derivative: zero almost everywhere.
// DOCS: zip(v: inout vec<3, F>, q: quat<F>) -> (bool, int32)
// DOCS-LABEL: ## Functions
