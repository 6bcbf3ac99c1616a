// Text that nests deeply or stands for something large is an error, and takes
// neither the stack nor the memory.

// RUN: %python %S/Inputs/nest.py array 100000 | not warp-opt 2>&1 | FileCheck %s
// RUN: %python %S/Inputs/nest.py struct 100000 | not warp-opt 2>&1 | FileCheck %s
// CHECK: error: types nest deeper than 64 levels

// RUN: %python %S/Inputs/nest.py chain 100000 | not warp-opt 2>&1 | FileCheck %s --check-prefix=C3
// RUN: %python %S/Inputs/nest.py pairs 60 | not warp-opt 2>&1 | FileCheck %s --check-prefix=C3
// RUN: %python %S/Inputs/nest.py arrays 60 | not warp-opt 2>&1 | FileCheck %s --check-prefix=C3
// C3: error: (C3) struct 'S' has more than 65536 components or 64 levels

// Input just within the limits is read.
// RUN: %python %S/Inputs/nest.py struct 64 | warp-opt
// RUN: %python %S/Inputs/nest.py pairs 12 | warp-opt
