//===- WarpBuiltinBase.td - The record of a builtin ----------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One record per builtin is the only place that knows it. From the record come
// the operation, the front end's overload table, the Python stubs, the
// reference page, the lowering to scalars and the values it is tested on.
//
// Overloads are written as Python would: `(a: vec<n,F>, b: vec<n,F>) -> F`.
//   S, T      any number            F, G   any float       I, J   any integer
//   A, B      any value             bool, i32, u32, f64, ...   that scalar
//   vec<n,S>  mat<r,c,S>  quat<F>  transform<F>  array<k,A>   composites;
//             extents are letters or numbers
// A letter stands for one type or extent throughout an overload. A parameter
// marked `inout` is also a result, appended after the others; the caller's
// variable takes its value. A default is written `name: F = 0.0`.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_BUILTIN_BASE_TD
#define WARP_BUILTIN_BASE_TD

include "mlir/Interfaces/SideEffectInterfaces.td"
include "WarpInterfaces.td"
include "WarpTypes.td"

/// How warp-lower-composites expands a builtin into scalar operations.
class Lowering;

/// Per component, with these operations for floats, signed and unsigned
/// integers. A scalar operand beside a composite is used for every component.
class Elementwise<string floatOp, string signedOp = "", string unsignedOp = "">
    : Lowering {
  string onFloat = floatOp;
  string onSigned = signedOp;
  string onUnsigned = !if(!empty(unsignedOp), signedOp, unsignedOp);
}

/// By the C++ function `lower<Operation>`, such as `lowerCross` for CrossOp.
def ByFunction : Lowering;

/// What a derivative of the builtin is.
class Derivative<string textOf> { string text = textOf; }
/// Has one almost everywhere.
def Smooth : Derivative<"differentiable">;
/// Zero wherever it exists.
def PiecewiseConstant : Derivative<"zero almost everywhere">;
/// Has none; an active use is an error.
def NotDifferentiable : Derivative<"not differentiable">;

class Warp_Builtin<string mnemonic, string groupOf, list<string> overloadsOf,
                   string summaryOf, Lowering loweringOf = ByFunction,
                   list<Trait> traits = [Pure]>
    : Op<Warp_Dialect, mnemonic,
         traits # [Warp_BuiltinOpInterface]> {
  /// Name under `warp`; operators are named after their method, without bars.
  string pythonName = mnemonic;
  /// The sign of an operator.
  string symbol = "";
  string group = groupOf;
  list<string> overloads = overloadsOf;
  Lowering lowering = loweringOf;
  Derivative derivative = Smooth;
  /// One interval per operand, on which values are checked against a
  /// reference; empty where a test of its own covers the builtin.
  list<string> domain = [];

  let summary = summaryOf;
  let description = "(C1) the operands match an overload. "
                    "(C2) the results are those of the overload.";
  let arguments = (ins Variadic<AnyType>:$args);
  let results = (outs Variadic<AnyType>:$results);
  let assemblyFormat =
      "`(` $args `)` attr-dict `:` functional-type($args, $results)";
  let hasVerifier = 1;
  let extraClassDeclaration = [{
    static const ::warp::BuiltinSpec &getSpec();
  }];
  let extraClassDefinition = [{
    const ::warp::BuiltinSpec &$cppClass::getSpec() {
      static const auto &spec = *::warp::lookupBuiltinOp(getOperationName());
      return spec;
    }
    ::llvm::LogicalResult $cppClass::verify() {
      return ::warp::verifyBuiltin(getOperation(), getSpec());
    }
  }];
}

/// A name under `warp` that the front end expands by rules of its own. The
/// overloads are Python signatures, for documentation and stubs.
class Warp_Special<string name, string groupOf, list<string> overloadsOf,
                   string summaryOf> {
  string pythonName = name;
  string group = groupOf;
  list<string> overloads = overloadsOf;
  string summary = summaryOf;
}

#endif // WARP_BUILTIN_BASE_TD
