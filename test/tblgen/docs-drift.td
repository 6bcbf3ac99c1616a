// The committed reference is what the records say; to update it, copy
// build/generated/builtins.md to docs/.

// RUN: warp-tblgen -gen-docs %S/../../include/WarpDialect/WarpOps.td -o %t
// RUN: diff %S/../../docs/builtins.md %t
