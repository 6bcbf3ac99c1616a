//===- LoweringFunctions.h - Declarations of all lowerings ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One declaration per builtin whose record says `ByFunction`.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LOWERINGS_LOWERINGFUNCTIONS_H
#define WARP_TRANSFORMS_LOWERINGS_LOWERINGFUNCTIONS_H

#include "Lowerings.h"

namespace warp::lowering {

#define WARP_BY_FUNCTION(Name)                                                 \
  Scalars lower##Name(Emitter &emitter, Operands args);
#include "WarpDialect/Lowerings.inc"

} // namespace warp::lowering

#endif // WARP_TRANSFORMS_LOWERINGS_LOWERINGFUNCTIONS_H
