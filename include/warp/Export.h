//===- Export.h - Symbols that leave libwarp.so -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// libwarp.so is built with hidden visibility so that its LLVM never meets
// another LLVM of the same process. Public entry points carry `WARP_API`.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_EXPORT_H
#define WARP_EXPORT_H

#define WARP_API __attribute__((visibility("default")))

#endif // WARP_EXPORT_H
