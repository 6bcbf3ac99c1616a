//===- Apart.h - Compilation concurrent with others -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_APART_H
#define WARP_LIB_COMPILER_APART_H

#include <memory>

namespace warp {

class OwnContext;

/// While it lives, modules that this thread parses and compiles do not wait for
/// those of other threads. No module made before may be touched, and those made
/// meanwhile go before it.
class Apart {
public:
  Apart();
  ~Apart();

private:
  std::unique_ptr<OwnContext> context;
};

} // namespace warp

#endif // WARP_LIB_COMPILER_APART_H
