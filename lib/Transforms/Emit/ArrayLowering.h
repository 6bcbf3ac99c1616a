//===- ArrayLowering.h - Arrays as pointers, extents, strides ---*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// State of warp-lower-arrays while it rewrites an entry. `ArrayParts` is an
// array taken apart; as long as an array does not pass through control flow it
// never exists in any other form. Parts of one file each: addresses, atomics,
// output and reports.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ARRAYLOWERING_H
#define WARP_LIB_TRANSFORMS_ARRAYLOWERING_H

#include "Analysis/Ranges.h"
#include "Launch/StageElements.h"
#include "WarpDialect/WarpOps.h"
#include "warp/Launch.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Builders.h"
#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/DenseSet.h"

namespace warp {

class BlockMemoryOp;
struct Leaf;

/// An array, taken apart.
struct ArrayParts {
  mlir::Value data;
  /// i32.
  llvm::SmallVector<mlir::Value, 4> shape;
  /// i64, in bytes; empty if the array is packed.
  llvm::SmallVector<mlir::Value, 4> strides;
  /// Packed: bytes from one element to the next; otherwise 0.
  int64_t unit = 0;
  /// The alignment of element addresses, beyond the one that their scalars
  /// need.
  int64_t alignment = 1;
  /// Geometry memory of the runtime: neither its indices nor the integers
  /// of 32 bits in it are negative.
  bool isGeometry = false;
  /// Memory of which no access meets one of the other kind: that of a block on
  /// a CPU, and what the launch was given.
  enum class Owner { Unknown, Block, Caller } owner = Owner::Unknown;
  /// How messages call the array.
  llvm::StringRef name;
};

/// The address of an access.
struct Address {
  mlir::Value pointer;
  /// In a debugging launch: whether every index is within its extent.
  mlir::Value inside;
  /// The indices after wrapping.
  llvm::SmallVector<mlir::Value, 4> indices;
};

/// Offsets in the descriptor of an array.
constexpr int64_t gradOffset = offsetof(ArrayDescriptor, grad);
constexpr int64_t shapeOffset(int64_t dim) {
  return offsetof(ArrayDescriptor, shape) + sizeof(int32_t) * dim;
}
constexpr int64_t stridesOffset(int64_t dim) {
  return offsetof(ArrayDescriptor, strides) + sizeof(int32_t) * dim;
}

/// An update of lanes, and by how many elements it is beyond the first one of
/// its window.
struct WindowUpdate {
  UpdateLanesOp update;
  int64_t shift;
};
/// Updates that overlap, in order.
using LaneWindow = llvm::SmallVector<WindowUpdate, 4>;

class ArrayLowering {
public:
  explicit ArrayLowering(mlir::LLVM::LLVMFuncOp entry);

  /// Fails at a gradient that nothing leads to.
  llvm::LogicalResult run();

  /// The struct that stands for an array in control flow and in calls.
  mlir::Type getDescriptorType(int64_t rank);

private:
  // LowerArrays.cpp: one operation each.
  void lower(mlir::Operation *op);
  void convertControlFlow(mlir::Operation *op);
  void convert(mlir::Value value);

  // LowerViews.cpp: arrays, and what is asked of them.
  void lowerParameter(ParameterOp op);
  void lowerView(ViewOp op);
  void lowerComponentView(ComponentViewOp op);
  void lowerDim(DimOp op);
  void lowerStride(StrideOp op);
  void lowerPointer(PointerOp op);
  mlir::Value getBlockMemory();
  /// A place in shared memory that bytes are added to; null if an
  /// operation is something else.
  static BlockMemoryOp getPlaceBehind(mlir::Operation *op);
  void lowerArrayAt(ArrayAtOp op);
  void lowerGrad(GradOp op);

  // LowerSlices.cpp: parts of arrays by bounds, steps and arrays of indices.
  std::pair<mlir::Value, mlir::Value> selectedForwards(SliceOp op,
                                                       mlir::Value extent);
  std::pair<mlir::Value, mlir::Value> selected(SliceOp op, mlir::Value extent);
  mlir::Value clampBound(mlir::Value bound, mlir::Value low, mlir::Value high,
                         mlir::Value extent);
  void lowerSlice(SliceOp op);
  void lowerIndexDim(IndexDimOp op);

  // LowerElements.cpp: loads and stores.
  void lowerLoad(LoadComponentsOp op);
  void lowerStore(StoreComponentsOp op);
  void lowerAddress(AddressOp op);
  mlir::Value loadLeaf(mlir::Type type, mlir::Value pointer,
                       ArrayParts::Owner owner = ArrayParts::Owner::Unknown,
                       int64_t alignment = 1);
  void storeLeaf(mlir::Value value, mlir::Type type, mlir::Value pointer,
                 ArrayParts::Owner owner = ArrayParts::Owner::Unknown,
                 int64_t alignment = 1);
  template <typename Op> void setOwner(Op access, ArrayParts::Owner owner);
  mlir::Value zeroOf(mlir::Type type);

  // ArrayAddress.cpp: array values and addresses.
  ArrayParts &getParts(mlir::Value array);
  /// Type of an array value before this pass changed it.
  ArrayType arrayType(mlir::Value array);
  mlir::Type elementType(mlir::Value array) {
    return arrayType(array).getElementType();
  }
  mlir::Value pack(mlir::Value array);
  ArrayParts readDescriptor(mlir::Value base, int64_t offset, int64_t rank,
                            int64_t unit);
  mlir::Value stride(ArrayParts &parts, int64_t dim);
  mlir::Value wrapIndex(mlir::Value index, mlir::Value extent);
  mlir::Value wideIndex(mlir::Value index, int depth = 4);
  Address address(mlir::Value array, mlir::ValueRange indices);
  mlir::Value elementPointer(const ArrayParts &parts, mlir::ValueRange indices,
                             mlir::Type elementType, bool inside = true);
  mlir::Value advance(mlir::Value pointer, int64_t bytes);
  mlir::Value advance(mlir::Value pointer, mlir::Value bytes);
  /// Runs `body`, whose results have these types, if the access is inside;
  /// otherwise reports it and gives zeros.
  llvm::SmallVector<mlir::Value>
  guarded(mlir::Operation *op, mlir::Value array, const Address &address,
          mlir::TypeRange types,
          llvm::function_ref<llvm::SmallVector<mlir::Value>()> body);

  // ElementStage.cpp: accesses of warps.
  mlir::Value isWhole(mlir::Operation *access, mlir::ValueRange pointers,
                      llvm::ArrayRef<mlir::Type> elements);
  mlir::Value isWholeOfRows(mlir::Operation *access, mlir::ValueRange indices);
  mlir::Value rowBytes(mlir::Operation *access, mlir::Value array);
  using Staged = llvm::function_ref<llvm::SmallVector<mlir::Value>()>;
  using PartStaged =
      llvm::function_ref<llvm::SmallVector<mlir::Value>(const LaneGroup &)>;
  mlir::ValueRange stage(mlir::Value isWhole, mlir::TypeRange types,
                         mlir::ValueRange pointers,
                         llvm::ArrayRef<mlir::Type> elements, Staged whole,
                         PartStaged part, Staged alone);
  void lowerStaged(llvm::ArrayRef<LoadComponentsOp> group);
  void lowerStaged(StoreComponentsOp op);

  // LowerLaneAccesses.cpp, LowerLaneBytes.cpp, LowerLaneWords.cpp,
  // LowerLaneNeighbours.cpp
  struct LaneAccess;
  LaneAccess laneAccess(mlir::Value array, mlir::ValueRange indices,
                        mlir::Value mask, LaneForm form,
                        llvm::ArrayRef<bool> nonNegative);
  void lowerLanes(LoadLanesOp op);
  void lowerLanes(StoreLanesOp op);
  void lowerLanes(UpdateLanesOp op);
  llvm::SmallVector<mlir::Value> loadLanes(LoadLanesOp op);
  llvm::SmallVector<mlir::Value>
  asStored(llvm::ArrayRef<Leaf> leaves, int64_t lanes,
           llvm::SmallVector<mlir::Value> components);
  llvm::SmallVector<mlir::Value> loadUnit(const LaneAccess &access,
                                          int64_t stride);
  llvm::SmallVector<mlir::Value> loadGathered(const LaneAccess &access);
  llvm::SmallVector<mlir::Value> ifNeighbours(
      AccessOp op, mlir::Value mask, llvm::ArrayRef<bool> nonNegative,
      llvm::ArrayRef<mlir::Type> types,
      llvm::function_ref<llvm::SmallVector<mlir::Value>(const LaneAccess &)>
          together,
      llvm::function_ref<llvm::SmallVector<mlir::Value>()> apart);
  llvm::SmallVector<mlir::Value> loadNeighbours(LoadLanesOp op);
  LaneAccess runAccess(AccessOp op, mlir::Value mask,
                       llvm::ArrayRef<bool> nonNegative, int64_t count);
  llvm::SmallVector<mlir::Value> loadRun(LoadLanesOp op);
  void updateNeighbours(UpdateLanesOp op);
  void updateApart(UpdateLanesOp op);

  // LowerLaneWindows.cpp
  void findWindows();
  mlir::Value isWindow(const LaneWindow &window, mlir::Value start);
  void updateWindow(const LaneWindow &window);

  void storeUnit(const LaneAccess &access, int64_t stride,
                 llvm::ArrayRef<mlir::Value> components);
  void storeScattered(const LaneAccess &access,
                      llvm::ArrayRef<mlir::Value> components);
  llvm::SmallVector<mlir::Value> loadWords(const LaneAccess &access);
  llvm::SmallVector<mlir::Value> loadBytes(const LaneAccess &access);
  void updateWords(const LaneAccess &access, AtomicKind kind,
                   llvm::ArrayRef<mlir::Value> components);
  void updateEach(const LaneAccess &access, AtomicKind kind,
                  llvm::ArrayRef<mlir::Value> components);
  mlir::Value spill(mlir::ValueRange vectors);
  mlir::Value gatherOffsets(const ArrayParts &parts, mlir::ValueRange indices,
                            llvm::ArrayRef<bool> nonNegative, int64_t lanes);

  // LowerAtomics.cpp
  void lowerAtomic(AtomicComponentsOp op);
  void lowerAtomicCas(AtomicCasOp op);
  mlir::Value plainUpdate(AtomicKind kind, mlir::Value value, mlir::Type type,
                          mlir::Value pointer);
  mlir::Value atomicUpdate(AtomicKind kind, mlir::Value value, mlir::Type type,
                           mlir::Value pointer);

  // LowerScratch.cpp
  void lowerScratch(ScratchOp op);
  void lowerScratch(ScratchLoadOp op);
  void lowerScratch(ScratchStoreOp op);
  mlir::Value slot(mlir::Value scratch, mlir::Value index);
  mlir::Value laneSlots(mlir::Value scratch, mlir::Value index);

  // LowerTables.cpp
  std::string tableName();
  void makeTables(llvm::ArrayRef<mlir::Operation *> operations);
  void lowerTable(TableGetOp op);

  // LowerOutput.cpp
  void lowerPrintf(PrintfOp op);
  void lowerAssert(AssertOp op);
  void lowerCheckIndex(CheckIndexOp op);
  void report(mlir::Location at, CheckKind kind, llvm::StringRef what,
              mlir::ValueRange indices, mlir::ValueRange shape);
  mlir::LLVM::LLVMFuncOp getReportFunction();
  mlir::Value formatString(llvm::StringRef text);
  mlir::LLVM::LLVMFuncOp declare(llvm::StringRef name,
                                 mlir::TypeRange arguments, bool isVariadic);
  int64_t siteNumber(mlir::Location at, llvm::StringRef what);

  mlir::Value constant(mlir::Type type, int64_t value);
  mlir::Value widen(mlir::Value value, mlir::Type type);

  mlir::LLVM::LLVMFuncOp entry;
  mlir::ModuleOp module;
  mlir::OpBuilder b;
  mlir::Location loc;
  mlir::Type i8, i32, i64, pointer, dataPointer;
  const TargetInfo &target;
  bool gpu, index32, debug;
  /// A function that the entry calls.
  bool isKept;
  bool exclusive;
  llvm::DenseMap<mlir::Value, ArrayParts> known;
  /// The place in the parameter block of an array's descriptor.
  llvm::DenseMap<mlir::Value, std::pair<mlir::Value, int64_t>> descriptors;
  bool malformed = false;
  llvm::DenseMap<mlir::Value, ArrayType> packedTypes;
  /// Pointer to shared memory, once something is there.
  mlir::Value blockMemory;
  /// The scope of accesses there.
  mlir::ArrayAttr blockScope;
  /// Pointers to the memory of `warp.scratch` operations.
  llvm::DenseMap<mlir::Value, mlir::Value> scratches;
  /// Global variables that hold tables.
  llvm::DenseMap<mlir::Attribute, mlir::LLVM::GlobalOp> tables;
  StagedAccesses staged;
  /// Windows, under the last of their updates; the others have an empty one.
  llvm::DenseMap<mlir::Operation *, LaneWindow> windows;
  /// Arrays of what the runtime keeps of geometry.
  llvm::DenseSet<mlir::Operation *> geometry;
  /// For blocks with staged accesses: true if all threads of the warp are
  /// present.
  llvm::DenseMap<mlir::Block *, mlir::Value> wholeWarps;
  llvm::SmallVector<mlir::Operation *> dead;
  /// Address of the error record, i64, in a debugging launch.
  mlir::Value errorRecord;
  llvm::SmallVector<mlir::Attribute> sites;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ARRAYLOWERING_H
