//===- WarpSpecials.td - Names with rules of their own -------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What the kernel language has besides builtins whose overloads say it all.
// The front end expands these names; here is what users read about them.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SPECIALS_TD
#define WARP_SPECIALS_TD

include "WarpBuiltinBase.td"

//===----------------------------------------------------------------------===//
// Construction
//===----------------------------------------------------------------------===//

class Warp_Construction<string name, list<string> overloads, string summaryOf>
    : Warp_Special<name, "Construction", overloads, summaryOf>;

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
    ["(*rows: Any) -> Any"], "matrix of the given rows">;
def Warp_MatrixFromColsName : Warp_Construction<"matrix_from_cols",
    ["(*columns: Any) -> Any"], "matrix of the given columns">;
def Warp_IdentityName : Warp_Construction<"identity",
    ["(n: int, dtype: Any) -> Any"], "identity matrix of n rows">;
def Warp_QuaternionName : Warp_Construction<"quaternion",
    ["(x: float, y: float, z: float, w: float) -> Any",
     "(imaginary: Any, real: float) -> Any", "(*, dtype: Any = ...) -> Any"],
    "quaternion x i + y j + z k + w; zero without operands">;
def Warp_QuatIdentityName : Warp_Construction<"quat_identity",
    ["(dtype: Any = float) -> Any"], "rotation by nothing">;
def Warp_TransformationName : Warp_Construction<"transformation",
    ["(p: Any, q: Any) -> Any",
     "(*components: float, dtype: Any = ...) -> Any"],
    "rigid transform that rotates by q, then translates by p">;
def Warp_TransformIdentityName : Warp_Construction<"transform_identity",
    ["(dtype: Any = float) -> Any"], "transform that does nothing">;
def Warp_CastName : Warp_Construction<"cast", ["(a: Any, dtype: Any) -> Any"],
    "bits of `a` taken as another type of the same size">;

//===----------------------------------------------------------------------===//
// Atomics
//===----------------------------------------------------------------------===//

class Warp_Atomic<string name, string summaryOf, string operands = "value: Any">
    : Warp_Special<name, "Atomics", [
        "(arr: array, i: int, " # operands # ") -> Any",
        "(arr: array, i: int, j: int, " # operands # ") -> Any",
        "(arr: array, i: int, j: int, k: int, " # operands # ") -> Any",
        "(arr: array, i: int, j: int, k: int, l: int, " # operands #
            ") -> Any"], summaryOf>;

def Warp_AtomicAddName : Warp_Atomic<"atomic_add",
    "adds to an element in one step and returns its old value; `a[i] += v` is "
    "the same">;
def Warp_AtomicSubName : Warp_Atomic<"atomic_sub",
    "subtracts from an element in one step and returns its old value">;
def Warp_AtomicMinName : Warp_Atomic<"atomic_min",
    "lowers an element to at most `value` and returns its old value">;
def Warp_AtomicMaxName : Warp_Atomic<"atomic_max",
    "raises an element to at least `value` and returns its old value">;
def Warp_AtomicAndName : Warp_Atomic<"atomic_and",
    "bitwise and with an integer element; returns its old value">;
def Warp_AtomicOrName : Warp_Atomic<"atomic_or",
    "bitwise or with an integer element; returns its old value">;
def Warp_AtomicXorName : Warp_Atomic<"atomic_xor",
    "bitwise exclusive or with an integer element; returns its old value">;
def Warp_AtomicExchName : Warp_Atomic<"atomic_exch",
    "replaces an element and returns its old value">;
def Warp_AtomicCasName : Warp_Atomic<"atomic_cas",
    "replaces an element if it equals `compare`; returns its old value",
    "compare: Any, value: Any">;

//===----------------------------------------------------------------------===//
// Threads and output
//===----------------------------------------------------------------------===//

class Warp_ThreadName<string name, list<string> overloads, string summaryOf>
    : Warp_Special<name, "Threads and output", overloads, summaryOf>;

def Warp_TidName : Warp_ThreadName<"tid", ["() -> Any"],
    "indices of the thread within the launch: one, or as many as are unpacked, "
    "up to four">;
def Warp_PrintfName : Warp_ThreadName<"printf",
    ["(fmt: str, *args: Any) -> None"],
    "formatted output as C has it, of up to 32 numbers">;
def Warp_PrintName : Warp_ThreadName<"print", ["(value: Any) -> None"],
    "prints one value and ends the line">;
def Warp_ExpectEqName : Warp_ThreadName<"expect_eq",
    ["(a: Any, b: Any) -> None"],
    "prints both values if they differ, numbers or composites of one type">;
def Warp_ExpectNeqName : Warp_ThreadName<"expect_neq",
    ["(a: Any, b: Any) -> None"], "prints both values if they are equal">;
def Warp_ExpectNearName : Warp_ThreadName<"expect_near",
    ["(a: Any, b: Any, tolerance: float = 1e-6) -> None"],
    "prints both values unless all components differ by at most `tolerance`; "
    "NaN is near to nothing">;
def Warp_LenName : Warp_ThreadName<"len", ["(a: Any) -> int"],
    "length of a vector, number of rows of a matrix, first extent of an array">;
def Warp_LowerBoundName : Warp_Special<"lower_bound", "Arrays",
    ["(arr: array, value: Any) -> int",
     "(arr: array, begin: int, end: int, value: Any) -> int"],
    "index of the first element of a sorted array that is not less than "
    "`value`, or of the last one if all are">;
class Warp_RandomName<string name, list<string> overloads, string summaryOf>
    : Warp_Special<name, "Random numbers", overloads, summaryOf>;
def Warp_PoissonName : Warp_RandomName<"poisson",
    ["(state: Any, lam: float) -> Any"],
    "random unsigned integer of the Poisson distribution of mean lam">;
def Warp_SampleCdfName : Warp_RandomName<"sample_cdf",
    ["(state: Any, cdf: array) -> int"],
    "random index, by a sorted array of cumulative probabilities">;
def Warp_StaticName : Warp_ThreadName<"static", ["(value: Any) -> Any"],
    "value that Python computes when the kernel is compiled">;

#endif // WARP_SPECIALS_TD
