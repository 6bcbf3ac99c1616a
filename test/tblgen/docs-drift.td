// The committed reference is what the records say; to update it, copy
// build/generated/builtins.md to docs/.

// RUN: warp-tblgen -gen-docs %S/../../include/WarpDialect/WarpOps.td -o %t
// RUN: diff %S/../../docs/builtins.md %t

// RUN: warp-tblgen -gen-launch-docs %S/../../include/WarpDialect/Launch.td -o %t.launch
// RUN: diff %S/../../docs/launch.md %t.launch
