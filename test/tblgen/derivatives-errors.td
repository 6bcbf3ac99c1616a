// A wrong formula is reported at its record.

// RUN: not warp-tblgen -gen-derivatives -DNAME %s 2>&1 | FileCheck %s --check-prefix=NAME
// RUN: not warp-tblgen -gen-derivatives -DCALL %s 2>&1 | FileCheck %s --check-prefix=CALL
// RUN: not warp-tblgen -gen-derivatives -DSYNTAX %s 2>&1 | FileCheck %s --check-prefix=SYNTAX
// RUN: not warp-tblgen -gen-derivatives -DCOUNT %s 2>&1 | FileCheck %s --check-prefix=COUNT
// RUN: not warp-tblgen -gen-derivatives -DSPREAD %s 2>&1 | FileCheck %s --check-prefix=SPREAD

include "WarpBuiltinBase.td"

class Warp_Try<Derivative rule>
    : Warp_Builtin<"try", "Group", ["(a: F, b: F) -> F"], "tries"> {
  let derivative = rule;
  let smoothDomain = ["[0, 1]"];
}

#ifdef NAME
// NAME: derivatives-errors.td:[[#@LINE+1]]:5: error: formula 'g * c' has no operand 'c'
def Warp_TryOp : Warp_Try<Partials<["g * c", "g"]>>;
#endif

#ifdef CALL
// CALL: error: formula 'g * sine(a)' calls 'sine', which is not a builtin
def Warp_TryOp : Warp_Try<Partials<["g * sine(a)", "g"]>>;
#endif

#ifdef SYNTAX
// SYNTAX: error: expects ')' at column 7 of formula 'g * (a'
def Warp_TryOp : Warp_Try<Partials<["g * (a", "g"]>>;
#endif

#ifdef COUNT
// COUNT: error: builtin 'try' has 1 formulas for 2 parameters of '(a: F, b: F) -> F'
def Warp_TryOp : Warp_Try<Partials<["g"]>>;
#endif

#ifdef SPREAD
// SPREAD: error: builtin 'try' has adjoints for 2 of 1 overloads
def Warp_TryOp : Warp_Try<Multilinear<[["g", "g"], ["g", "g"]]>>;
#endif
