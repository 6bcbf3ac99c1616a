// Formulas become functions that build operations, and text for users.

// RUN: warp-tblgen -gen-derivatives %s | FileCheck %s
// RUN: warp-tblgen -gen-docs %s | FileCheck %s --check-prefix=DOCS

include "WarpBuiltinBase.td"

class Warp_Test<string name, list<string> overloads>
    : Warp_Builtin<name, "Test", overloads, "tests"> {
  let smoothDomain = ["[0, 1]"];
}

// Signs keep their precedence; the condition is evaluated before the value.
// CHECK-LABEL: static Expr adjoint_root_0(Formula &f, unsigned operand) {
// CHECK: case 0: {
// CHECK-NEXT: Expr g = f.cotangent();
// CHECK-NEXT: Expr result = f.result();
// CHECK: f.unless([&] { return (x <= f.number(0)); },
// CHECK-NEXT: [&] { return (g / (f.number(2) * result)); }, true);
def Warp_RootOp : Warp_Test<"root", ["(x: F) -> F"]> {
  let derivative = Partials<["g / (2 * result) unless x <= 0"]>;
}

// Overloads without formulas are left out, definitions come where they are
// used, an empty formula is a derivative of zero.
// CHECK-NOT: adjoint_scale_1
// CHECK-LABEL: static Expr adjoint_scale_0
// CHECK: case 0: {
// CHECK: Expr h = f.call("root", {b});
// CHECK: return (-g * h);
// CHECK-NOT: case 1
// CHECK-LABEL: static Expr tangent_scale_0(Formula &f) {
// CHECK: Expr da = f.tangent(0);
def Warp_ScaleOp : Warp_Test<"scale",
    ["(a: F, b: F) -> F", "(a: quat<F>, b: F) -> quat<F>"]> {
  let derivative =
      Formulas<[["-g * h", ""], []], ["-da * b", ""], ["h = root(b)"]>;
}

// A product needs a guard only against an infinite factor; a requirement is
// asserted.
// CHECK-LABEL: static Expr adjoint_twist_0
// CHECK: if (!f.mayBeInfinite(b))
// CHECK-NEXT: return (g * b);
// CHECK-NEXT: return f.unless([&] { return (g == f.number(0)); },
// CHECK-NEXT: [&] { return (g * b); }, false);

// CHECK: ruleTable[] = {
// CHECK-NEXT: {"warp.root", 0, adjoint_root_0, nullptr, false, true, true},
// CHECK-NEXT: {"warp.scale", 0, adjoint_scale_0, tangent_scale_0, false, false, false},
// CHECK-NEXT: {"warp.twist", 0, adjoint_twist_0, nullptr, true, false, false},
def Warp_TwistOp : Warp_Test<"twist", ["(a: F, b: F) -> F"]> {
  let derivative = Multilinear<[["g * b unless g == 0", "a * g"]]>;
}

// DOCS: tests. Adjoint: `x` += `g / (2 * result) unless x <= 0`.
// DOCS: tests. Adjoints:
// DOCS-NEXT: - `(a: F, b: F) -> F`: `a` += `-g * h`
// DOCS-NEXT: - `(a: quat<F>, b: F) -> quat<F>`: by expansion
// DOCS: where `h = root(b)`
