//===- LowerCompositesValues.cpp - Constants, casts, parts of values ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// These operations move scalars around. A constant index picks one; an index
// known only at run time becomes a tree of selects, which stays in registers
// where memory would not.
//
//===----------------------------------------------------------------------===//

#include "LowerComposites.h"

#include "Lowerings/Lowerings.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;
using namespace warp::lowering;

namespace warp {

//===----------------------------------------------------------------------===//
// Indexed access
//===----------------------------------------------------------------------===//

static std::optional<int64_t> getConstantIndex(Value index, int64_t extent) {
  llvm::APInt bits;
  if (!matchPattern(index, m_ConstantInt(&bits)))
    return std::nullopt;
  int64_t position = index.getType().isUnsignedInteger() ? bits.getZExtValue()
                                                         : bits.getSExtValue();
  if (position < 0)
    position += extent;
  if (position < 0 || position >= extent)
    return std::nullopt;
  return position;
}

/// A negative index counts from the end.
static Scalar wrapIndex(Scalar index, int64_t extent) {
  if (index.isUnsigned())
    return index;
  return select(index < 0, index + static_cast<double>(extent), index);
}

Scalars CompositeLowering::pick(Scalars scalars, int64_t extent, Value index) {
  size_t size = scalars.size() / extent;
  if (auto position = getConstantIndex(index, extent))
    return Scalars(ArrayRef(scalars).slice(*position * size, size));
  Scalar at = wrapIndex(getScalar(index), extent);
  // Each level halves the groups by one bit of the index.
  for (unsigned bit = 0; extent > 1; ++bit) {
    Scalar odd = (shiftRightLogical(at, bit) & at.like(1)) != 0;
    int64_t half = (extent + 1) / 2;
    Scalars left;
    for (int64_t i = 0; i < half; ++i)
      for (size_t k = 0; k < size; ++k) {
        Scalar even = scalars[2 * i * size + k];
        bool isPair = 2 * i + 1 < extent;
        left.push_back(
            isPair ? select(odd, scalars[(2 * i + 1) * size + k], even) : even);
      }
    scalars = std::move(left);
    extent = half;
  }
  return scalars;
}

Scalars CompositeLowering::put(Scalars scalars, int64_t extent, Value index,
                               Scalars part) {
  size_t size = part.size();
  if (auto position = getConstantIndex(index, extent)) {
    llvm::copy(part, scalars.begin() + *position * size);
    return scalars;
  }
  Scalar at = wrapIndex(getScalar(index), extent);
  for (int64_t i = 0; i < extent; ++i) {
    Scalar here = at == static_cast<double>(i);
    for (size_t k = 0; k < size; ++k)
      scalars[i * size + k] = select(here, part[k], scalars[i * size + k]);
  }
  return scalars;
}

/// Extent of the first axis of a composite.
static int64_t getExtent(Type composite, size_t components) {
  auto matrix = dyn_cast<MatType>(composite);
  return matrix ? matrix.getRows() : components;
}

Scalars CompositeLowering::putAt(Type composite, Scalars scalars,
                                 ValueRange indices, Scalars part) {
  int64_t extent = getExtent(composite, scalars.size());
  if (indices.size() == 1)
    return put(std::move(scalars), extent, indices[0], std::move(part));
  size_t cols = scalars.size() / extent;
  Scalars row = pick(scalars, extent, indices[0]);
  row = put(std::move(row), cols, indices[1], std::move(part));
  return put(std::move(scalars), extent, indices[0], std::move(row));
}

/// One index in bounds, of a table of one dimension.
Value CompositeLowering::lowerTable(TableGetOp op) {
  OpBuilder &b = emitter.builder;
  Location loc = op.getLoc();
  ShapedType shape = op.getTable().getType();
  auto signless = [&](Type type) {
    return type.isIntOrIndex() ? getSignless(type) : type;
  };
  Value place;
  for (auto [given, extent] :
       llvm::zip_equal(op.getIndices(), shape.getShape())) {
    Value index = getIndex(given);
    Type type = index.getType();
    auto number = [&](int64_t value) {
      return emitter.constant(b.getIntegerAttr(type, value));
    };
    if (!given.getType().isUnsignedInteger()) {
      Value isNegative = arith::CmpIOp::create(
          b, loc, arith::CmpIPredicate::slt, index, number(0));
      Value fromEnd = arith::AddIOp::create(b, loc, index, number(extent));
      index = arith::SelectOp::create(b, loc, isNegative, fromEnd, index);
    }
    index = arith::MinUIOp::create(b, loc, index, number(extent - 1));
    if (type.getIntOrFloatBitWidth() > 32)
      index = arith::TruncIOp::create(b, loc, b.getI32Type(), index);
    if (place) {
      Value length = emitter.constant(b.getI32IntegerAttr(extent));
      place = arith::MulIOp::create(b, loc, place, length);
      place = arith::AddIOp::create(b, loc, place, index);
    } else {
      place = index;
    }
  }
  Type element = signless(shape.getElementType());
  DenseElementsAttr table = op.getTable();
  if (element != shape.getElementType())
    table = table.bitcast(element);
  table =
      table.reshape(RankedTensorType::get({shape.getNumElements()}, element));
  return TableGetOp::create(b, loc, element, table, place);
}

//===----------------------------------------------------------------------===//
// Bits
//===----------------------------------------------------------------------===//

/// Goes through pieces as wide as the narrower of both scalar types, the first
/// piece in the lowest bits.
Scalars CompositeLowering::reinterpret(Scalars scalars, Type to) {
  SmallVector<Type> types;
  flatten(to, types);
  auto widthOf = [](Type type) {
    return isBool(type) ? 8u : type.getIntOrFloatBitWidth();
  };
  unsigned piece = ~0u;
  for (Scalar x : scalars)
    piece = std::min(piece, widthOf(x.type));
  for (Type type : types)
    piece = std::min(piece, widthOf(type));
  auto bitsOf = [&](unsigned width) {
    return IntegerType::get(to.getContext(), width, IntegerType::Unsigned);
  };

  Scalars pieces;
  for (Scalar x : scalars) {
    unsigned width = widthOf(x.type);
    Scalar bits = isBool(x.type) ? convert(x, bitsOf(8))
                                 : lowering::reinterpret(x, bitsOf(width));
    for (unsigned at = 0; at < width; at += piece)
      pieces.push_back(
          convert(at ? shiftRightLogical(bits, at) : bits, bitsOf(piece)));
  }
  Scalars result;
  ArrayRef<Scalar> rest = pieces;
  for (Type type : types) {
    unsigned width = widthOf(type);
    Scalar bits = convert(rest[0], bitsOf(width));
    for (unsigned at = piece; at < width; at += piece)
      bits = bits | shiftLeft(convert(rest[at / piece], bitsOf(width)), at);
    rest = rest.drop_front(width / piece);
    result.push_back(isBool(type) ? convert(bits, type)
                                  : lowering::reinterpret(bits, type));
  }
  return result;
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

static Scalars construct(Emitter &emitter, Type type, Scalars parts) {
  size_t count = getComponentCount(type);
  if (parts.empty())
    parts.push_back(emitter.constant(getElementScalar(type), 0));
  if (parts.size() == 1)
    return Scalars(count, parts[0]);
  return parts;
}

/// Position of a field among the flattened values of its struct.
static std::pair<size_t, size_t> getFieldRange(StructType type,
                                               StringRef field) {
  int64_t index = type.getFieldIndex(field);
  size_t first = 0;
  for (Type before : type.getFieldTypes().take_front(index))
    first += getComponentCount(before);
  return {first, getComponentCount(type.getFieldTypes()[index])};
}

std::optional<LogicalResult> CompositeLowering::lowerValueOp(Operation *op) {
  auto done = [&](auto &&flat) {
    replace(op, std::forward<decltype(flat)>(flat));
    return std::optional(success());
  };
  return llvm::TypeSwitch<Operation *, std::optional<LogicalResult>>(op)
      .Case([&](ConstantOp constant) {
        TypedAttr value = constant.getValue();
        if (auto integer = dyn_cast<IntegerAttr>(value))
          value = IntegerAttr::get(getSignless(integer.getType()),
                                   integer.getValue());
        return done(ValueRange(emitter.constant(value)));
      })
      .Case([&](CastOp cast) {
        Type type = cast.getType();
        Type scalar = isa<IndexType>(type) ? type : getElementScalar(type);
        return done(forEach(getScalars(cast.getSource()), [&](Scalar x) {
          return convert(x, scalar ? scalar : type);
        }));
      })
      .Case([&](BitcastOp bitcast) {
        return done(
            reinterpret(getScalars(bitcast.getSource()), bitcast.getType()));
      })
      .Case([&](ConstructOp op) {
        Scalars parts;
        for (Value component : op.getComponents())
          llvm::append_range(parts, getScalars(component));
        return done(construct(emitter, op.getType(), std::move(parts)));
      })
      .Case([&](ExtractOp extract) {
        Scalars parts = getScalars(extract.getSource());
        int64_t extent = getExtent(extract.getSource().getType(), parts.size());
        parts = pick(std::move(parts), extent, extract.getIndices()[0]);
        if (extract.getIndices().size() == 2) {
          size_t cols = parts.size();
          parts = pick(std::move(parts), cols, extract.getIndices()[1]);
        }
        return done(parts);
      })
      .Case([&](TableGetOp get) { return done(ValueRange(lowerTable(get))); })
      .Case([&](InsertOp insert) {
        return done(putAt(insert.getType(), getScalars(insert.getTarget()),
                          insert.getIndices(), getScalars(insert.getValue())));
      })
      .Case([&](PositionOp position) {
        Scalar index = getScalar(position.getIndex());
        index = wrapIndex(index, position.getExtent());
        return done(ValueRange(convert(index, position.getType()).value));
      })
      .Case([&](StructCreateOp create) {
        return done(ValueRange(lookup(create.getFields())));
      })
      .Case([&](StructGetOp get) {
        auto [first, count] = getFieldRange(
            cast<StructType>(get.getSource().getType()), get.getField());
        SmallVector<Value> flat(lookup(get.getSource()).slice(first, count));
        return done(ValueRange(flat));
      })
      .Case([&](StructSetOp set) {
        auto [first, count] =
            getFieldRange(cast<StructType>(set.getType()), set.getField());
        SmallVector<Value> flat(lookup(set.getTarget()));
        llvm::copy(lookup(set.getValue()), flat.begin() + first);
        return done(ValueRange(flat));
      })
      .Default([](Operation *) { return std::nullopt; });
}

} // namespace warp
