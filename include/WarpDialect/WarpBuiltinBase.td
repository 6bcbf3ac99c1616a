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

/// The derivative of a builtin. `kind` is a `DerivativeKind` of
/// Registry.h, `text` its name in the documentation.
class Derivative<string kindOf, string textOf> {
  string kind = kindOf;
  string text = textOf;
}
/// Has one almost everywhere: that of the scalars it is expanded into.
def Smooth : Derivative<"Function", "differentiable">;

/// Has one by formulas: for each overload, or for all of them at once, one per
/// operand. A formula gives the cotangent of its operand from the cotangent
/// `g` of the result, in which it is linear. It has the operands, `result`,
/// numbers, + - * /, comparisons, `and`, `or`, `not`, builtins by their Python
/// names, and the names that `given` defines. Where the condition behind its
/// `unless` holds it stands for zero, by the policy for singular points. Where
/// the condition behind `requires` does not hold, the launch fails with the
/// message behind the colon. An empty formula is a derivative of zero; an
/// overload without formulas is expanded into scalars.
///
/// Tangents, for each overload or all at once, are
///   `partials`      the sum of the formulas with the tangent of each operand
///                   for `g`,
///   `substitution`  the sum of the builtin itself with each operand replaced
///                   by its tangent, or
///   a formula of the operands, `result` and the tangents `da` of each operand
///   `a`.
class Formulas<list<list<string>> adjointsOf, list<string> tangentsOf,
               list<string> givenOf = []>
    : Derivative<"Function", "differentiable"> {
  list<list<string>> adjoints = adjointsOf;
  list<string> tangents = tangentsOf;
  /// `name = formula`, which later ones and the adjoints can use.
  list<string> given = givenOf;
}
/// The derivative by each operand is its own transpose, as that of a function
/// of scalars is.
class Partials<list<string> formulas, list<string> given = []>
    : Formulas<[formulas], ["partials"], given>;
/// Has one by the C++ functions `pullback<Operation>` and
/// `pushforward<Operation>`.
def RuleByFunction : Derivative<"Function", "differentiable">;

/// Linear in each operand.
class Multilinear<list<list<string>> formulas>
    : Formulas<formulas, ["substitution"]>;

/// Zero wherever it exists.
def PiecewiseConstant : Derivative<"Zero", "zero almost everywhere">;
/// Has none; an active use is an error.
def NotDifferentiable : Derivative<"None", "not differentiable">;

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
  /// The domain on which derivatives are checked against finite differences: an interval per
  /// operand of the first overload, or one for all, for each component.
  list<string> smoothDomain = domain;

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

/// A condition on the arguments of a call. The message, which follows the name
/// of the builtin, has expressions in braces; it is a `TypeError`'s where
/// `isType` is set. Applies to the overloads that have all names in it.
class Require<string conditionOf, string messageOf, string hintOf = "",
              string alsoOf = ""> {
  string condition = conditionOf;
  string message = messageOf;
  /// The fix, and how NVIDIA Warp says that the condition is false.
  string hint = hintOf;
  string also = alsoOf;
  bit isType = 0;
}
class RequireType<string condition, string message, string hint = "",
                  string also = ""> : Require<condition, message, hint, also> {
  let isType = 1;
}

/// A name under `warp` that the front end expands.
///
/// With a call, which is a Python expression of the parameters, the front end
/// binds arguments by the overload: `name: type = default`, `*name: type` for
/// the rest, `*` before parameters that are given by name. Types are
///   Any                        whatever it is bound to, unchanged
///   value, int                 a value of any type, of any integer type
///   bool, i32, u32, f32, ...   a value of that type; numbers convert
///   tile<F, [M, K]>            a tile of two dimensions; M and K stand for one
///                              extent throughout, as F does for one type by
///                              the rules above (H is any float, too)
///   tile<F, D>, tile<F>        a tile of any shape; D stands for its shape
///   array<k, A>, array         an array of k dimensions, or any array
///   shape, dtype               extents, an element type
///   const, const<int>          a number known when the kernel is compiled
///   condition                  a value of type bool, or True
///   'lower'|'upper'            one of these strings
///   offsets<a>, axis<a>        an index per dimension of the parameter a, one
///                              of its dimensions; `*i: index<a>` is the former
///   stack                      a stack of a block
/// A parameter marked `inout` takes the value that the call gives it, behind
/// the result if there is one.
///
/// In expressions, names that are neither parameters nor letters belong to the
/// call (python/warp/_src/frontend/binder.py): `make('fft', a)` makes
/// `warp.tile_fft`, `builtin('add', a, b)` calls a builtin, and `output`,
/// `tiles`, ... are parts of the front end, for calls that take more than an
/// expression.
///
/// Without a call, the front end has a method `builtin_<name>`, and the
/// overloads are Python signatures.
class Warp_Special<string name, string groupOf, list<string> overloadsOf,
                   string summaryOf, list<string> callsOf = []> {
  string pythonName = name;
  string group = groupOf;
  list<string> overloads = overloadsOf;
  string summary = summaryOf;
  /// One for each overload, or one for all.
  list<string> calls = callsOf;
  list<Require> requirements = [];
}

/// A function under `warp` that is written in the kernel language. `module` of
/// warp._src is imported when the name is first asked for, and has the function
/// in its `FUNCTIONS`.
class Warp_LibraryFunction<string name, list<string> overloadsOf,
                           string summaryOf> {
  string pythonName = name;
  string module = ?;
  string group = ?;
  /// The HandleKind of the first parameter, if that is called `id`.
  string handle = "";
  list<string> overloads = overloadsOf;
  string summary = summaryOf;
}

#endif // WARP_BUILTIN_BASE_TD
