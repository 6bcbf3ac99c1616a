//===- WarpOps.h - Operations of the warp dialect ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_WARPOPS_H
#define WARPDIALECT_WARPOPS_H

#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpAttributes.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Bytecode/BytecodeOpInterface.h"
#include "mlir/IR/OpDefinition.h"
#include "mlir/IR/OpImplementation.h"
#include "mlir/Interfaces/InferTypeOpInterface.h"
#include "mlir/IR/SymbolTable.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"


namespace warp {

/// Trait of the operations that thread IR may hold.
template <typename ConcreteType>
class ThreadPhase
    : public mlir::OpTrait::TraitBase<ConcreteType, ThreadPhase> {};

/// The effect of an access on an element: an update reads it and writes it.
enum class AccessEffect { Read, Write, Update };

} // namespace warp

#include "WarpDialect/WarpInterfaces.h.inc"

#define GET_OP_CLASSES
#include "WarpDialect/WarpOps.h.inc"

#endif // WARPDIALECT_WARPOPS_H
