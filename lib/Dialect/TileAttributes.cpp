//===- TileAttributes.cpp - Layouts of tiles ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/TileAttributes.h"

#include "WarpDialect/TileTypes.h"

#include "mlir/IR/Diagnostics.h"
#include "llvm/ADT/STLExtras.h"

using namespace mlir;
using warp::TileLayoutAttr;
using warp::TileStorage;

using EmitError = function_ref<InFlightDiagnostic()>;

//===----------------------------------------------------------------------===//
// Layouts
//===----------------------------------------------------------------------===//

LogicalResult TileLayoutAttr::verify(EmitError emitError, TileStorage storage,
                                     int64_t pitch, bool swizzled,
                                     int64_t stages, int64_t tensorMap,
                                     bool barriers, int64_t mergedAxis,
                                     int64_t mergedExtent) {
  bool isPacked = pitch == 0 && !swizzled && stages == 1 && tensorMap == 0;
  if (storage != TileStorage::memory && !isPacked)
    return emitError()
           << "(C1) expects a tile in memory for a pitch, a "
              "swizzle, stages or a tensor map, but its storage is '"
           << stringifyTileStorage(storage) << "'";
  if (pitch < 0 || tensorMap < 0 || stages < 1)
    return emitError() << "(C2) expects a pitch and an offset of 0 or more and "
                          "a stage, but got "
                       << pitch << ", " << tensorMap << " and " << stages;
  if (barriers && tensorMap == 0)
    return emitError() << "(C3) expects barriers with a tensor map only";
  if (mergedExtent < 0 || mergedAxis < 0 || mergedAxis > 1)
    return emitError() << "(C4) expects merged steps along axis 0 or 1, of a "
                          "positive extent";
  return success();
}

TileLayoutAttr TileLayoutAttr::getPacked(MLIRContext *context) {
  return get(context, TileStorage::memory, 0, false, 1, 0, false, 0, 0);
}

TileLayoutAttr TileLayoutAttr::withStorage(TileStorage storage) const {
  return get(getContext(), storage, getPitch(), getSwizzled(), getStages(),
             getTensorMap(), getBarriers(), getMergedAxis(), getMergedExtent());
}

TileLayoutAttr TileLayoutAttr::withPitch(int64_t pitch) const {
  return get(getContext(), getStorage(), pitch, getSwizzled(), getStages(),
             getTensorMap(), getBarriers(), getMergedAxis(), getMergedExtent());
}

TileLayoutAttr TileLayoutAttr::withSwizzle(bool swizzled) const {
  return get(getContext(), getStorage(), getPitch(), swizzled, getStages(),
             getTensorMap(), getBarriers(), getMergedAxis(), getMergedExtent());
}

TileLayoutAttr TileLayoutAttr::withStages(int64_t stages) const {
  return get(getContext(), getStorage(), getPitch(), getSwizzled(), stages,
             getTensorMap(), getBarriers(), getMergedAxis(), getMergedExtent());
}

TileLayoutAttr TileLayoutAttr::withTensorMap(int64_t map, bool barriers) const {
  return get(getContext(), getStorage(), getPitch(), getSwizzled(), getStages(),
             map, barriers, getMergedAxis(), getMergedExtent());
}

TileLayoutAttr TileLayoutAttr::withMerged(int64_t axis, int64_t extent) const {
  return get(getContext(), getStorage(), getPitch(), getSwizzled(), getStages(),
             getTensorMap(), getBarriers(), axis, extent);
}

//===----------------------------------------------------------------------===//
// Functions
//===----------------------------------------------------------------------===//

LogicalResult warp::TileFunctionAttr::verify(EmitError emitError,
                                             StringRef name,
                                             StringRef accumulators,
                                             int64_t slots) {
  if (name.empty())
    return emitError() << "(C1) expects a name";
  if (slots < 0 || (slots > 0) == accumulators.empty())
    return emitError() << "(C2) expects slots and a layout of accumulators, or "
                          "neither";
  return success();
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

LogicalResult warp::verifyTileAttribute(Operation *op,
                                        NamedAttribute attribute) {
  bool isLayout = attribute.getName() == attr::layout;
  if (isLayout ? !isa<TileLayoutAttr>(attribute.getValue())
               : !isa<TileFunctionAttr>(attribute.getValue()))
    return op->emitOpError()
           << "expects '#warp." << (isLayout ? "tile_layout" : "tile_function")
           << "' for '" << attribute.getName().getValue() << "'";
  if (!isLayout)
    return success();
  auto tiles =
      llvm::make_filter_range(op->getResultTypes(), llvm::IsaPred<TileType>);
  if (tiles.empty())
    return op->emitOpError("has a layout, but gives no tile");
  bool isReplicated = cast<TileLayoutAttr>(attribute.getValue()).getStorage() ==
                      TileStorage::replicated;
  if (isReplicated && llvm::any_of(tiles, [](mlir::Type type) {
        return cast<TileType>(type).getNumElements() != 1;
      }))
    return op->emitOpError("is replicated, but its tile has more than one "
                           "element");
  return success();
}
