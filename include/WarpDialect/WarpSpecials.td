//===- WarpSpecials.td - Names with rules of their own -------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The kernel language besides builtins that are operations: signatures, and the
// calls that the front end expands; names without a call have a method there.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SPECIALS_TD
#define WARP_SPECIALS_TD

include "WarpBuiltinBase.td"

//===----------------------------------------------------------------------===//
// Construction
//===----------------------------------------------------------------------===//

class Warp_Construction<string name, list<string> overloads, string summaryOf,
                        list<string> calls = []>
    : Warp_Special<name, "Construction", overloads, summaryOf, calls>;

def Warp_VectorName : Warp_Construction<"vector",
    ["(*components: Any, length: int = ..., dtype: Any = ...) -> Any"],
    "vector of the given components, of a shorter vector and more components, "
    "or of `length` times one number">;
def Warp_MatrixName : Warp_Construction<"matrix",
    ["(*components: Any, shape: tuple[int, int] = ..., dtype: Any = ...) -> "
     "Any"],
    "matrix of the given components in row-major order, or with one number in "
    "every component">;
def Warp_MatrixFromRowsName : Warp_Construction<"matrix_from_rows",
    ["(*rows: value) -> Any"], "matrix of the given rows",
    ["constructors.from_rows(node, rows)"]>;
def Warp_MatrixFromColsName : Warp_Construction<"matrix_from_cols",
    ["(*columns: value) -> Any"], "matrix of the given columns",
    ["builtin('transpose', constructors.from_rows(node, columns))"]>;
def Warp_IdentityName : Warp_Construction<"identity",
    ["(n: const<int>, dtype: dtype) -> Any"], "identity matrix of n rows",
    ["constructors.identity(node, n, dtype)"]>;
def Warp_QuaternionName : Warp_Construction<"quaternion",
    ["(x: float, y: float, z: float, w: float) -> Any",
     "(imaginary: Any, real: float) -> Any", "(*, dtype: Any = ...) -> Any"],
    "quaternion x i + y j + z k + w; zero without operands">;
def Warp_QuatIdentityName : Warp_Construction<"quat_identity",
    ["(dtype: dtype = float) -> Any"], "rotation by nothing",
    ["constructors.of_family(node, 'quat', dtype, [0, 0, 0, 1])"]>;
def Warp_TransformationName : Warp_Construction<"transformation",
    ["(p: Any, q: Any) -> Any",
     "(*components: float, dtype: Any = ...) -> Any"],
    "rigid transform that rotates by q, then translates by p">;
def Warp_TransformIdentityName : Warp_Construction<"transform_identity",
    ["(dtype: dtype = float) -> Any"], "transform that does nothing",
    ["constructors.of_family(node, 'transform', dtype, "
     "[0, 0, 0, 0, 0, 0, 1])"]>;
def Warp_CastName : Warp_Construction<"cast",
    ["(a: value, dtype: dtype) -> Any"],
    "bits of `a` taken as another type of the same size",
    ["builder.bitcast(a, dtype)"]>;

//===----------------------------------------------------------------------===//
// Atomics
//===----------------------------------------------------------------------===//

class Warp_AtomicUpdate<string name, string summaryOf, string operands,
                        string before, string behind>
    : Warp_Special<name, "Atomics", [
        "(arr: array, i: int, " # operands # ") -> Any",
        "(arr: array, i: int, j: int, " # operands # ") -> Any",
        "(arr: array, i: int, j: int, k: int, " # operands # ") -> Any",
        "(arr: array, i: int, j: int, k: int, l: int, " # operands #
            ") -> Any"], summaryOf, [
        before # "[i]" # behind, before # "[i, j]" # behind,
        before # "[i, j, k]" # behind, before # "[i, j, k, l]" # behind]>;
class Warp_Atomic<string name, string kind, string summaryOf>
    : Warp_AtomicUpdate<name, summaryOf, "value: value",
    "calls.atomic(node, '" # kind # "', arr, ", ", value)">;

def Warp_AtomicAddName : Warp_Atomic<"atomic_add", "add",
    "adds to an element in one step and returns its old value; `a[i] += v` is "
    "the same">;
def Warp_AtomicSubName : Warp_Atomic<"atomic_sub", "sub",
    "subtracts from an element in one step and returns its old value">;
def Warp_AtomicMinName : Warp_Atomic<"atomic_min", "min",
    "lowers an element to at most `value` and returns its old value">;
def Warp_AtomicMaxName : Warp_Atomic<"atomic_max", "max",
    "raises an element to at least `value` and returns its old value">;
def Warp_AtomicAndName : Warp_Atomic<"atomic_and", "and",
    "bitwise and with an integer element; returns its old value">;
def Warp_AtomicOrName : Warp_Atomic<"atomic_or", "or",
    "bitwise or with an integer element; returns its old value">;
def Warp_AtomicXorName : Warp_Atomic<"atomic_xor", "xor",
    "bitwise exclusive or with an integer element; returns its old value">;
def Warp_AtomicExchName : Warp_Atomic<"atomic_exch", "exch",
    "replaces an element and returns its old value">;
def Warp_AtomicCasName : Warp_AtomicUpdate<"atomic_cas",
    "replaces an element if it equals `compare`; returns its old value",
    "compare: value, value: value", "calls.atomic_cas(node, arr, ",
    ", compare, value)">;

//===----------------------------------------------------------------------===//
// Threads and output
//===----------------------------------------------------------------------===//

class Warp_ThreadName<string name, list<string> overloads, string summaryOf,
                      list<string> calls = []>
    : Warp_Special<name, "Threads and output", overloads, summaryOf, calls>;

def Warp_TidName : Warp_ThreadName<"tid", ["() -> Any"],
    "indices of the thread within the launch: one, or as many as are unpacked, "
    "up to four", ["calls.tid(1, node)[0]"]>;
def Warp_PrintfName : Warp_ThreadName<"printf",
    ["(fmt: str, *args: Any) -> None"],
    "formatted output as C has it, of up to 32 numbers">;
def Warp_PrintName : Warp_ThreadName<"print", ["(value: Any) -> None"],
    "prints one value and ends the line">;
def Warp_ExpectEqName : Warp_ThreadName<"expect_eq",
    ["(a: Any, b: Any) -> None"],
    "prints both values if they differ, numbers or composites of one type",
    ["output.expect(node, 'expect_eq', 'ne', a, b)"]>;
def Warp_ExpectNeqName : Warp_ThreadName<"expect_neq",
    ["(a: Any, b: Any) -> None"], "prints both values if they are equal",
    ["output.expect(node, 'expect_neq', 'eq', a, b)"]>;
def Warp_ExpectNearName : Warp_ThreadName<"expect_near",
    ["(a: Any, b: Any, tolerance: Any = 1e-6) -> None"],
    "prints both values unless all components differ by at most `tolerance`; "
    "NaN is near to nothing",
    ["output.expect_near(node, a, b, tolerance)"]>;
def Warp_LenName : Warp_ThreadName<"len", ["(a: Any) -> int"],
    "length of a vector, number of rows of a matrix, first extent of an array">;
def Warp_LowerBoundName : Warp_Special<"lower_bound", "Arrays",
    ["(arr: array, value: Any) -> i32",
     "(arr: array, begin: int, end: int, value: Any) -> i32"],
    "index of the first element of a sorted array that is not less than "
    "`value`, or of the last one if all are",
    ["calls.lower_bound(node, arr, value)",
     "calls.lower_bound(node, arr, value, begin, end)"]>;
class Warp_RandomName<string name, list<string> overloads, string summaryOf,
                      list<string> calls = []>
    : Warp_Special<name, "Random numbers", overloads, summaryOf, calls>;
def Warp_PoissonName : Warp_RandomName<"poisson",
    ["(state: inout Any, lam: Any) -> Any"],
    "random unsigned integer of the Poisson distribution of mean lam",
    ["calls.poisson(node, state, lam)"]>;
def Warp_SampleCdfName : Warp_RandomName<"sample_cdf",
    ["(state: inout value, cdf: array) -> i32"],
    "random index, by a sorted array of cumulative probabilities",
    ["calls.sample_cdf(node, state, cdf)"]>;
def Warp_StaticName : Warp_ThreadName<"static", ["(value: Any) -> Any"],
    "value that Python computes when the kernel is compiled">;

#endif // WARP_SPECIALS_TD
