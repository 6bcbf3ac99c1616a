//===- FlattenStructs.cpp - Scalar replacement of structs -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Derivatives know scalars, composites and arrays. This pass leaves no other
// values: every struct is replaced by the list of its fields, structs within it
// opened too, in one walk in program order. A struct in an array is read and
// written field by field, through component views. Only arguments stay structs,
// and are read by warp.struct_get. A tile of structs becomes tiles of fields.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_FLATTENSTRUCTS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;

static bool isTileOfStructs(Type type) {
  auto tile = dyn_cast<TileType>(type);
  return tile && isa<StructType>(tile.getElementType());
}

/// A struct, or a tile of structs.
static bool isStruct(Value value) {
  return isa<StructType>(value.getType()) || isTileOfStructs(value.getType());
}

/// Appends the types of a struct's fields, those of inner structs in place.
static void flattenStruct(Type type, SmallVectorImpl<Type> &fields) {
  if (isTileOfStructs(type)) {
    auto tile = cast<TileType>(type);
    SmallVector<Type> elements;
    flattenStruct(tile.getElementType(), elements);
    for (Type element : elements)
      fields.push_back(
          TileType::get(type.getContext(), tile.getShape(), element));
    return;
  }
  auto structure = dyn_cast<StructType>(type);
  if (!structure) {
    fields.push_back(type);
    return;
  }
  for (Type field : structure.getFieldTypes())
    flattenStruct(field, fields);
}

static SmallVector<Type> flattenTypes(TypeRange types) {
  SmallVector<Type> flat;
  for (Type type : types)
    flattenStruct(type, flat);
  return flat;
}

static bool holdsArray(Type type) {
  return llvm::any_of(flattenTypes(type),
                      [](Type field) { return isa<ArrayType>(field); });
}

namespace {

class Flattening {
public:
  explicit Flattening(func::FuncOp function) : builder(function.getContext()) {
    builder.setInsertionPointToStart(&function.getBody().front());
    for (BlockArgument argument : function.getArguments())
      if (isStruct(argument)) {
        fields[argument] = readFields(argument);
        kept.insert(argument);
      }
  }

  void flatten(Block &block) {
    for (Operation &op : llvm::make_early_inc_range(block)) {
      // The values that the constructor made for arguments.
      if (made.contains(&op))
        continue;
      builder.setInsertionPoint(&op);
      flatten(&op);
    }
  }

  void cleanUp() {
    for (Operation *op : llvm::reverse(dead))
      op->erase();
    for (Block *block : deadArguments)
      block->eraseArguments([](BlockArgument a) { return isStruct(a); });
  }

private:
  /// The fields of a value that stays a struct.
  SmallVector<Value> readFields(Value value) {
    SmallVector<Value> read;
    auto type = cast<StructType>(value.getType());
    for (auto [name, field] :
         llvm::zip(type.getFieldNames(), type.getFieldTypes())) {
      auto get =
          StructGetOp::create(builder, value.getLoc(), field, value, name);
      made.insert(get);
      if (isa<StructType>(field))
        llvm::append_range(read, readFields(get));
      else
        read.push_back(get);
    }
    return read;
  }

  SmallVector<Value> lookup(Value value) {
    return isStruct(value) ? fields.at(value) : SmallVector<Value>{value};
  }

  SmallVector<Value> lookup(ValueRange values) {
    SmallVector<Value> flat;
    for (Value value : values)
      llvm::append_range(flat, lookup(value));
    return flat;
  }

  /// The place of a field in the list of its struct: first and count.
  static std::pair<size_t, size_t> findField(Type type, StringRef name) {
    auto structure = cast<StructType>(type);
    auto before =
        structure.getFieldTypes().take_front(structure.getFieldIndex(name));
    auto field = structure.getFieldTypes()[before.size()];
    return {flattenTypes(before).size(), flattenTypes(field).size()};
  }

  void replace(Operation *op, ValueRange flat) {
    for (Value result : op->getResults()) {
      size_t count = flattenTypes(result.getType()).size();
      if (isStruct(result))
        fields[result] = llvm::to_vector(flat.take_front(count));
      else
        result.replaceAllUsesWith(flat.front());
      flat = flat.drop_front(count);
    }
    dead.push_back(op);
  }

  void flatten(Operation *op) {
    if (auto create = dyn_cast<StructCreateOp>(op))
      return replace(op, lookup(create.getFields()));
    if (auto get = dyn_cast<StructGetOp>(op)) {
      SmallVector<Value> source = lookup(get.getSource());
      auto [first, count] =
          findField(get.getSource().getType(), get.getField());
      return replace(op, ArrayRef(source).slice(first, count));
    }
    if (auto set = dyn_cast<StructSetOp>(op)) {
      SmallVector<Value> target = lookup(set.getTarget());
      SmallVector<Value> value = lookup(set.getValue());
      llvm::copy(
          value,
          target.begin() +
              findField(set.getTarget().getType(), set.getField()).first);
      return replace(op, target);
    }
    if (auto load = dyn_cast<LoadOp>(op))
      if (isStruct(load.getResult()) && !holdsArray(load.getType()))
        return flattenLoad(load);
    if (auto store = dyn_cast<StoreOp>(op))
      if (isStruct(store.getValue()) && !holdsArray(store.getValue().getType()))
        return flattenStore(store);
    if (isa<scf::SCFDialect>(op->getDialect()) || isa<TileMapOp>(op))
      return flattenControlFlow(op);
    if (isa<TileYieldOp>(op))
      return op->setOperands(lookup(op->getOperands()));
    if (auto set = dyn_cast<TileSetOp>(op); set && set.getPath())
      return flattenPart(set);
    if (isTileOp(op) && touchesStructs(op))
      return flattenTile(op);
    if (isa<WhereOp, arith::SelectOp>(op) && isStruct(op->getResult(0)))
      return flattenChoice(op);
    keepWhole(op);
  }

  /// Anything else takes and gives whole structs.
  void keepWhole(Operation *op) {
    for (OpOperand &operand : op->getOpOperands())
      if (Value value = operand.get();
          isStruct(value) && !kept.contains(value)) {
        SmallVector<Value> parts = lookup(value);
        operand.set(assemble(value.getLoc(), value.getType(), parts));
      }
    builder.setInsertionPointAfter(op);
    for (Value result : op->getResults())
      if (isStruct(result)) {
        fields[result] = readFields(result);
        kept.insert(result);
      }
  }

  /// A struct of the first of these fields, which are taken off.
  Value assemble(Location loc, Type type, SmallVectorImpl<Value> &parts) {
    SmallVector<Value> operands;
    for (Type field : cast<StructType>(type).getFieldTypes()) {
      if (isa<StructType>(field)) {
        operands.push_back(assemble(loc, field, parts));
        continue;
      }
      operands.push_back(parts.front());
      parts.erase(parts.begin());
    }
    return StructCreateOp::create(builder, loc, type, operands);
  }

  /// Views of an array of structs, one per field.
  SmallVector<Value> viewFields(Location loc, Value array) {
    auto type = cast<ArrayType>(array.getType());
    auto structure = dyn_cast<StructType>(type.getElementType());
    if (!structure)
      return {array};
    SmallVector<Value> views;
    for (auto [name, field] :
         llvm::zip(structure.getFieldNames(), structure.getFieldTypes())) {
      Type viewed = ArrayType::get(type.getContext(), type.getRank(), field);
      Value view = ComponentViewOp::create(builder, loc, viewed, array,
                                           ValueRange(), name);
      llvm::append_range(views, viewFields(loc, view));
    }
    return views;
  }

  void flattenLoad(LoadOp op) {
    SmallVector<Value> loaded;
    for (Value view : viewFields(op.getLoc(), op.getArray())) {
      Type type = cast<ArrayType>(view.getType()).getElementType();
      loaded.push_back(
          LoadOp::create(builder, op.getLoc(), type, view, op.getIndices()));
    }
    replace(op, loaded);
  }

  void flattenStore(StoreOp op) {
    for (auto [field, view] : llvm::zip_equal(
             lookup(op.getValue()), viewFields(op.getLoc(), op.getArray())))
      StoreOp::create(builder, op.getLoc(), field, view, op.getIndices());
    dead.push_back(op);
  }

  static bool touchesStructs(Operation *op) {
    return llvm::any_of(op->getOperands(), isStruct) ||
           llvm::any_of(op->getResults(), isStruct);
  }

  /// A change of a part of elements, in the tiles of the fields that are part
  /// of it; other fields stay.
  void flattenPart(TileSetOp set) {
    SmallVector<Value> tiles = lookup(set.getTile());
    ArrayRef<Attribute> path = set.getPath()->getValue();
    Type type = cast<TileType>(set.getTile().getType()).getElementType();
    size_t first = 0;
    for (; !path.empty() && isa<StructType>(type); path = path.drop_front()) {
      auto field = cast<StringAttr>(path.front());
      first += findField(type, field).first;
      type = getFieldType(type, field);
    }
    ArrayAttr rest = path.empty() ? ArrayAttr() : builder.getArrayAttr(path);
    for (auto [i, value] : llvm::enumerate(lookup(set.getValue()))) {
      Value &tile = tiles[first + i];
      tile = TileSetOp::create(builder, set.getLoc(), tile.getType(),
                               set.getKind(), value, tile, set.getIndices(),
                               set.getComponents(), set.getWhere(), rest);
    }
    replace(set, tiles);
  }

  /// An operation on tiles, for each field by itself.
  void flattenTile(Operation *op) {
    size_t count = 0;
    SmallVector<SmallVector<Value>> operands;
    for (Value operand : op->getOperands()) {
      auto array = dyn_cast<ArrayType>(operand.getType());
      bool isViewed = array && isa<StructType>(array.getElementType());
      operands.push_back(isViewed ? viewFields(op->getLoc(), operand)
                                  : lookup(operand));
      count = std::max(count, operands.back().size());
    }
    SmallVector<Type> types;
    if (op->getNumResults() != 0)
      flattenStruct(op->getResult(0).getType(), types);
    SmallVector<Value> results;
    for (size_t i = 0; i < count; ++i) {
      Operation *part = builder.clone(*op);
      for (auto [number, fields] : llvm::enumerate(operands))
        part->setOperand(number, fields[fields.size() == 1 ? 0 : i]);
      if (!types.empty()) {
        part->getResult(0).setType(types[i]);
        results.push_back(part->getResult(0));
      }
    }
    replace(op, results);
  }

  void flattenChoice(Operation *op) {
    SmallVector<Value> chosen;
    for (auto [yes, no] : llvm::zip_equal(lookup(op->getOperand(1)),
                                          lookup(op->getOperand(2)))) {
      Value operands[] = {op->getOperand(0), yes, no};
      Operation *part =
          Operation::create(op->getLoc(), op->getName(), yes.getType(),
                            operands, op->getDiscardableAttrDictionary(),
                            op->getPropertiesStorage(), BlockRange(), 0);
      chosen.push_back(builder.insert(part)->getResult(0));
    }
    replace(op, chosen);
  }

  void flattenControlFlow(Operation *op) {
    SmallVector<Value> operands = lookup(op->getOperands());
    if (llvm::none_of(op->getResults(), isStruct)) {
      op->setOperands(operands);
    } else {
      Operation *flat = Operation::create(
          op->getLoc(), op->getName(), flattenTypes(op->getResultTypes()),
          operands, op->getDiscardableAttrDictionary(),
          op->getPropertiesStorage(), BlockRange(), op->getNumRegions());
      builder.insert(flat);
      for (auto [to, from] :
           llvm::zip_equal(flat->getRegions(), op->getRegions()))
        to.takeBody(from);
      replace(op, ValueRange(flat->getResults()));
      op = flat;
    }
    for (Region &region : op->getRegions())
      for (Block &block : region) {
        flattenArguments(block);
        flatten(block);
      }
  }

  /// New arguments take the places of the old ones in order.
  void flattenArguments(Block &block) {
    if (llvm::none_of(block.getArguments(), isStruct))
      return;
    deadArguments.push_back(&block);
    for (unsigned i = 0; i < block.getNumArguments(); ++i) {
      BlockArgument old = block.getArgument(i);
      if (!isStruct(old))
        continue;
      SmallVector<Value> parts;
      for (Type type : flattenTypes(old.getType()))
        parts.push_back(block.insertArgument(++i, type, old.getLoc()));
      fields[old] = parts;
    }
  }

  OpBuilder builder;
  llvm::DenseMap<Value, SmallVector<Value>> fields;
  /// Structs that stay, and what reads them.
  llvm::DenseSet<Value> kept;
  llvm::DenseSet<Operation *> made;
  SmallVector<Operation *> dead;
  SmallVector<Block *> deadArguments;
};

struct FlattenStructs : warp::impl::FlattenStructsBase<FlattenStructs> {
  /// Operations that are not done field by field.
  static LogicalResult refuseTiles(func::FuncOp function) {
    WalkResult walked = function.walk([&](Operation *op) -> WalkResult {
      auto isRefused = [&](Type type) {
        return isTileOfStructs(type) &&
               (isa<TileFoldOp>(op) ||
                holdsArray(cast<TileType>(type).getElementType()));
      };
      if (llvm::none_of(op->getOperandTypes(), isRefused) &&
          llvm::none_of(op->getResultTypes(), isRefused))
        return WalkResult::advance();
      return op->emitError("this has no derivative for tiles of structs; use a "
                           "tile for each field, or `enable_backward=False`");
    });
    return failure(walked.wasInterrupted());
  }

  void runOnOperation() override {
    for (auto function : getOperation().getOps<func::FuncOp>()) {
      if (function.isExternal())
        continue;
      if (failed(refuseTiles(function)))
        return signalPassFailure();
      Flattening flattening(function);
      flattening.flatten(function.getBody().front());
      flattening.cleanUp();
    }
  }
};

} // namespace
