// The stubs are accepted by a type checker, and infer and reject as kernels do.

// REQUIRES: mypy
// RUN: rm -rf %t && mkdir -p %t
// RUN: cp -rL %warp_python_dir/warp %t/warp
// RUN: warp-tblgen -gen-pyi --public-names=%S/../../python/warp/__init__.py %S/../../include/WarpDialect/WarpOps.td -o %t/warp/__init__.pyi
// RUN: cp %S/Inputs/use.py %t/use.py
// RUN: cd %t && %python -m mypy --follow-imports=silent --cache-dir=%t/cache warp/__init__.pyi
// RUN: cd %t && not %python -m mypy --follow-imports=silent --cache-dir=%t/cache use.py > %t/log
// RUN: FileCheck %S/Inputs/use.py < %t/log
