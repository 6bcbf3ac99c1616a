// A wrong record of a function or a handle is reported there.

// RUN: not warp-tblgen -gen-handle-kinds -DWORDS %s 2>&1 | FileCheck %s --check-prefix=WORDS
// RUN: not warp-tblgen -gen-handle-kinds -DNUMBERS %s 2>&1 | FileCheck %s --check-prefix=NUMBERS
// RUN: not warp-tblgen -gen-library-header -DTYPE %s 2>&1 | FileCheck %s --check-prefix=TYPE
// RUN: not warp-tblgen -gen-library-header -DRESULT %s 2>&1 | FileCheck %s --check-prefix=RESULT
// RUN: not warp-tblgen -gen-library-header -DMEMBER %s 2>&1 | FileCheck %s --check-prefix=MEMBER

include "FunctionBase.td"

#ifdef WORDS
// WORDS: functions-errors.td:[[#@LINE+1]]:5: error: the slot of 'Wide' has 36 words, more than 32
def Wide : HandleKind<1, [SlotField<"most", 28>, Array<"values", 4>]>;
#endif

#ifdef NUMBERS
// NUMBERS: error: handle kinds are numbered from 1 without gaps, but 'Late' is 2
def Late : HandleKind<2, []>;
#endif

#ifdef TYPE
// TYPE: error: no type is called 'handle<Nothing>' in the signature of 'warp_f'
def : DeviceFunction<"f", "(id: handle<Nothing>) -> i32">;
#endif

#ifdef RESULT
// RESULT: error: no result is called 'Place' in the signature of 'warp_f'
def : DeviceFunction<"f", "(i: i32) -> Place">;
#endif

#ifdef MEMBER
// MEMBER: error: no type is called 'i32[3'
def Place : ResultStruct<"sizes: i32[3">;
#endif
