// A wrong record is reported at the record.

// RUN: not warp-tblgen -gen-docs -DSUMMARY %s 2>&1 | FileCheck %s --check-prefix=SUMMARY
// RUN: not warp-tblgen -gen-docs -DGROUP %s 2>&1 | FileCheck %s --check-prefix=GROUP
// RUN: not warp-tblgen -gen-docs -DNONE %s 2>&1 | FileCheck %s --check-prefix=NONE
// RUN: not warp-tblgen -gen-docs -DSYNTAX %s 2>&1 | FileCheck %s --check-prefix=SYNTAX
// RUN: not warp-tblgen -gen-docs -DUNBOUND %s 2>&1 | FileCheck %s --check-prefix=UNBOUND
// RUN: not warp-tblgen -gen-docs -DNAMES %s 2>&1 | FileCheck %s --check-prefix=NAMES
// RUN: not warp-tblgen -gen-docs -DDEFAULTS %s 2>&1 | FileCheck %s --check-prefix=DEFAULTS
// RUN: not warp-tblgen -gen-docs -DDOMAIN %s 2>&1 | FileCheck %s --check-prefix=DOMAIN
// RUN: not warp-tblgen -gen-docs -DTWICE %s 2>&1 | FileCheck %s --check-prefix=TWICE
// RUN: not warp-tblgen -gen-docs -DUNCHECKED %s 2>&1 | FileCheck %s --check-prefix=UNCHECKED
// RUN: not warp-tblgen -gen-pyi --public-names=%t.none %s 2>&1 | FileCheck %s --check-prefix=NOFILE

include "WarpBuiltinBase.td"

class Warp_Try<list<string> overloads, string summaryOf = "tries">
    : Warp_Builtin<"try", "Group", overloads, summaryOf> {
  let smoothDomain = ["[0, 1]"];
}

#ifdef SUMMARY
// SUMMARY: records-errors.td:[[#@LINE+1]]:5: error: builtin 'try' has no summary
def Warp_TryOp : Warp_Try<["(a: S) -> S"], "">;
#endif

#ifdef GROUP
// GROUP: error: builtin 'try' has no group
def Warp_TryOp : Warp_Builtin<"try", "", ["(a: S) -> S"], "tries">;
#endif

#ifdef NONE
// NONE: error: builtin 'try' has no overloads
def Warp_TryOp : Warp_Try<[]>;
#endif

#ifdef SYNTAX
// SYNTAX: error: overload of 'try' expects an extent at column 9 of '(a: vec<S>) -> S'
def Warp_TryOp : Warp_Try<["(a: vec<S>) -> S"]>;
#endif

#ifdef UNBOUND
// UNBOUND: error: no parameter binds 'n' in overload '(a: S) -> vec<n,S>'
def Warp_TryOp : Warp_Try<["(a: S) -> vec<n,S>"]>;
#endif

#ifdef NAMES
// NAMES: error: two parameters 'a' in overload '(a: S, a: S) -> S'
def Warp_TryOp : Warp_Try<["(a: S, a: S) -> S"]>;
#endif

#ifdef DEFAULTS
// DEFAULTS: error: parameter 'b' needs a default in overload
def Warp_TryOp : Warp_Try<["(a: S = 1, b: S) -> S"]>;
#endif

#ifdef DOMAIN
// DOMAIN: error: builtin 'try' has 2 intervals for 1 parameters
def Warp_TryOp : Warp_Try<["(a: S) -> S"]> { let domain = ["[0, 1]", "[0, 1]"]; }
#endif

#ifdef TWICE
// TWICE: error: two records of builtin 'try'
def Warp_TryOp : Warp_Try<["(a: S) -> S"]>;
def Warp_TryName : Warp_Special<"try", "Group", ["() -> None"], "tries">;
#endif

#ifdef UNCHECKED
// UNCHECKED: error: builtin 'try' has a derivative, but no 'smoothDomain' on which to check it
def Warp_TryOp : Warp_Try<["(a: F) -> F"]> { let smoothDomain = []; }
#endif

// NOFILE: error: can't read '{{.*}}.none'
