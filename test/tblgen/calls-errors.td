// Errors in the signature or the call of a record are reported at the record.

// RUN: not warp-tblgen -gen-python-calls -DTYPE %s 2>&1 | FileCheck %s --check-prefix=TYPE
// RUN: not warp-tblgen -gen-python-calls -DEARLIER %s 2>&1 | FileCheck %s --check-prefix=EARLIER
// RUN: not warp-tblgen -gen-python-calls -DTWICE %s 2>&1 | FileCheck %s --check-prefix=TWICE
// RUN: not warp-tblgen -gen-python-calls -DDEFAULT %s 2>&1 | FileCheck %s --check-prefix=DEFAULT
// RUN: not warp-tblgen -gen-python-calls -DRESULT %s 2>&1 | FileCheck %s --check-prefix=RESULT
// RUN: not warp-tblgen -gen-python-calls -DNAME %s 2>&1 | FileCheck %s --check-prefix=NAME
// RUN: not warp-tblgen -gen-python-calls -DCOUNT %s 2>&1 | FileCheck %s --check-prefix=COUNT
// RUN: not warp-tblgen -gen-python-calls -DCONDITION %s 2>&1 | FileCheck %s --check-prefix=CONDITION

include "WarpBuiltinBase.td"

class Warp_Try<list<string> overloads, list<string> calls>
    : Warp_Special<"try", "Group", overloads, "tries", calls>;

#ifdef TYPE
// TYPE: calls-errors.td:[[#@LINE+1]]:5: error: overload of 'try' expects a type of parameters, not 'tiel' at column 5 of '(a: tiel<A>) -> A'
def Warp_TryName : Warp_Try<["(a: tiel<A>) -> A"], ["a"]>;
#endif

#ifdef EARLIER
// EARLIER: error: overload of 'try' expects an earlier parameter, not 'b'
def Warp_TryName : Warp_Try<["(a: tile<A>, i: axis<b>) -> A"], ["a"]>;
#endif

#ifdef TWICE
// TWICE: error: overload of 'try' expects another name than 'a'
def Warp_TryName : Warp_Try<["(a: Any, a: Any) -> Any"], ["a"]>;
#endif

#ifdef DEFAULT
// DEFAULT: error: overload of 'try' expects a default value, as the parameter before has one, at column 20
def Warp_TryName : Warp_Try<["(a: Any = 1, b: Any) -> Any"], ["a"]>;
#endif

#ifdef RESULT
// RESULT: error: overload of 'try' expects a result
def Warp_TryName : Warp_Try<["(a: Any) ->"], ["a"]>;
#endif

#ifdef NAME
// NAME: error: a call of 'try' uses 'c', which is no parameter of '(a: Any) -> Any'
def Warp_TryName : Warp_Try<["(a: Any) -> Any"], ["make('try', a, c)"]>;
#endif

#ifdef COUNT
// COUNT: error: 'try' has 2 calls for 3 overloads
def Warp_TryName : Warp_Try<["() -> Any", "(a: Any) -> Any",
                             "(a: Any, b: Any) -> Any"], ["f()", "g()"]>;
#endif

#ifdef CONDITION
// CONDITION: error: no overload of 'try' has all parameters of the requirement 'b > 0'
def Warp_TryName : Warp_Try<["(a: Any) -> Any"], ["a"]> {
  let requirements = [Require<"b > 0", "is negative">];
}
#endif
