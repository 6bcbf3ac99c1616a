//===- Registry.cpp - Registry of builtins --------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The table that warp-tblgen writes is constant data, sorted by Python name,
// so the registry costs nothing at start-up. The overloads of a builtin are
// parsed when it is first used. Matching walks the parsed overloads in the
// record's order and binds their letters; the first that fits wins. Nothing
// here knows any builtin by name.
//
// The messages about a failed match are in Mismatch.cpp.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/Registry.h"
#include "OverloadMatcher.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"

#include <atomic>

using namespace mlir;

#include "WarpDialect/BuiltinTable.inc"

ArrayRef<warp::BuiltinSpec> warp::getBuiltins() { return builtinTable; }

const warp::BuiltinSpec *warp::lookupBuiltin(StringRef pythonName) {
  ArrayRef<BuiltinSpec> table = builtinTable;
  const BuiltinSpec *found = llvm::lower_bound(
      table, pythonName, [](const BuiltinSpec &spec, StringRef name) {
        return spec.pythonName < name;
      });
  return found != table.end() && found->pythonName == pythonName ? found
                                                                 : nullptr;
}

const warp::BuiltinSpec *warp::lookupBuiltinOp(StringRef opName) {
  for (const BuiltinSpec &spec : builtinTable)
    if (!spec.isSpecial && spec.opName == opName)
      return &spec;
  return nullptr;
}

ArrayRef<warp::Signature> warp::getSignatures(const BuiltinSpec &spec) {
  using Signatures = std::vector<Signature>;
  static std::atomic<const Signatures *> cache[std::size(builtinTable)];
  std::atomic<const Signatures *> &slot = cache[&spec - builtinTable];
  if (const Signatures *known = slot.load(std::memory_order_acquire))
    return *known;
  auto parsed = std::make_unique<Signatures>();
  if (!spec.isSpecial)
    for (StringRef overload : spec.overloads) {
      std::string error;
      std::optional<Signature> signature = parseSignature(overload, error);
      assert(signature && "warp-tblgen checks overloads");
      parsed->push_back(*std::move(signature));
    }
  const Signatures *expected = nullptr;
  if (!slot.compare_exchange_strong(expected, parsed.get(),
                                    std::memory_order_acq_rel))
    return *expected;
  return *parsed.release();
}

//===----------------------------------------------------------------------===//
// Matching
//===----------------------------------------------------------------------===//

static bool isNumber(mlir::Type type) {
  return warp::isScalar(type) && !warp::isBool(type);
}

static bool fitsScalar(const warp::TypePattern &pattern, mlir::Type type) {
  using Base = warp::TypePattern::Base;
  switch (pattern.base) {
  case Base::Bool:
    return warp::isBool(type);
  case Base::Signed:
    return type.isSignedInteger(pattern.width);
  case Base::Unsigned:
    return type.isUnsignedInteger(pattern.width);
  case Base::BFloat:
    return type.isBF16();
  case Base::Float:
    return warp::isFloat(type) && !type.isBF16() &&
           type.getIntOrFloatBitWidth() == pattern.width;
  }
  return false;
}

bool warp::OverloadMatcher::bind(char letter, mlir::Type type) {
  mlir::Type &bound = types[letter - 'A'];
  if (!bound)
    bound = type;
  return bound == type;
}

bool warp::OverloadMatcher::bind(const TypePattern::Extent &extent,
                                 int64_t number) {
  if (!extent.letter)
    return extent.number == number;
  int64_t &bound = extents[extent.letter - 'a'];
  if (!bound)
    bound = number;
  return bound == number;
}

bool warp::OverloadMatcher::match(const TypePattern &pattern, mlir::Type type) {
  using Kind = TypePattern::Kind;
  auto matchElement = [&](mlir::Type element) {
    return match(pattern.element.front(), element);
  };
  switch (pattern.kind) {
  case Kind::AnyValue:
    return isValue(type) && bind(pattern.letter, type);
  case Kind::AnyNumber:
    return isNumber(type) && bind(pattern.letter, type);
  case Kind::AnyFloat:
    return isFloat(type) && bind(pattern.letter, type);
  case Kind::AnyInteger:
    return isNumber(type) && !isFloat(type) && bind(pattern.letter, type);
  case Kind::Scalar:
    return fitsScalar(pattern, type);
  case Kind::Vec:
    if (auto vec = dyn_cast<VecType>(type))
      return bind(pattern.extents[0], vec.getLength()) &&
             matchElement(vec.getElementType());
    return false;
  case Kind::Mat:
    if (auto mat = dyn_cast<MatType>(type))
      return bind(pattern.extents[0], mat.getRows()) &&
             bind(pattern.extents[1], mat.getCols()) &&
             matchElement(mat.getElementType());
    return false;
  case Kind::Quat:
    if (auto quat = dyn_cast<QuatType>(type))
      return matchElement(quat.getElementType());
    return false;
  case Kind::Transform:
    if (auto transform = dyn_cast<TransformType>(type))
      return matchElement(transform.getElementType());
    return false;
  case Kind::Array:
    if (auto array = dyn_cast<ArrayType>(type))
      return bind(pattern.extents[0], array.getRank()) &&
             matchElement(array.getElementType());
    return false;
  }
  return false;
}

bool warp::OverloadMatcher::match(const Signature &signature,
                                  TypeRange operands) {
  types.fill({});
  extents.fill(0);
  ArrayRef<Parameter> parameters = signature.parameters;
  if (operands.size() > parameters.size())
    return false;
  for (const Parameter &left : parameters.drop_front(operands.size()))
    if (left.defaultValue.empty())
      return false;
  for (auto [parameter, type] : llvm::zip(parameters, operands))
    if (!match(parameter.type, type))
      return false;
  return true;
}

mlir::Type warp::OverloadMatcher::build(const TypePattern &pattern) const {
  using Kind = TypePattern::Kind;
  using Base = TypePattern::Base;
  auto extent = [&](unsigned i) {
    const TypePattern::Extent &wanted = pattern.extents[i];
    return wanted.letter ? extents[wanted.letter - 'a'] : wanted.number;
  };
  auto element = [&] { return build(pattern.element.front()); };
  switch (pattern.kind) {
  case Kind::AnyValue:
  case Kind::AnyNumber:
  case Kind::AnyFloat:
  case Kind::AnyInteger:
    return types[pattern.letter - 'A'];
  case Kind::Scalar:
    if (pattern.base == Base::Bool)
      return IntegerType::get(context, 1);
    if (pattern.base == Base::Signed || pattern.base == Base::Unsigned)
      return IntegerType::get(context, pattern.width,
                              pattern.base == Base::Signed
                                  ? IntegerType::Signed
                                  : IntegerType::Unsigned);
    if (pattern.base == Base::BFloat)
      return BFloat16Type::get(context);
    return pattern.width == 16   ? mlir::Type(Float16Type::get(context))
           : pattern.width == 32 ? mlir::Type(Float32Type::get(context))
                                 : mlir::Type(Float64Type::get(context));
  case Kind::Vec:
    return VecType::get(context, extent(0), element());
  case Kind::Mat:
    // Extents are at most `maxComponents` each.
    if (extent(0) * extent(1) > maxComponents)
      return {};
    return MatType::get(context, extent(0), extent(1), element());
  case Kind::Quat:
    return QuatType::get(context, element());
  case Kind::Transform:
    return TransformType::get(context, element());
  case Kind::Array:
    return ArrayType::get(context, extent(0), element());
  }
  return {};
}

/// The default value of a parameter as a constant of its bound type.
static TypedAttr getDefault(const warp::Parameter &parameter, mlir::Type type) {
  if (isa<FloatType>(type)) {
    double number = 0;
    StringRef(parameter.defaultValue).getAsDouble(number);
    return FloatAttr::get(type, number);
  }
  if (warp::isBool(type))
    return BoolAttr::get(type.getContext(), parameter.defaultValue == "True");
  int64_t number = 0;
  StringRef(parameter.defaultValue).getAsInteger(0, number);
  return IntegerAttr::get(type, number);
}

std::optional<warp::BuiltinMatch> warp::matchBuiltin(const BuiltinSpec &spec,
                                                     MLIRContext *context,
                                                     TypeRange operands,
                                                     std::string *why) {
  OverloadMatcher matcher(context);
  for (auto [index, signature] : llvm::enumerate(getSignatures(spec))) {
    if (!matcher.match(signature, operands))
      continue;
    BuiltinMatch match;
    match.overload = index;
    for (const TypePattern &result : signature.results)
      match.results.push_back(matcher.build(result));
    for (auto [position, parameter] : llvm::enumerate(signature.parameters)) {
      if (position >= operands.size())
        match.defaults.push_back(
            getDefault(parameter, matcher.build(parameter.type)));
      if (!parameter.isInout)
        continue;
      match.inout.push_back(position);
      match.results.push_back(matcher.build(parameter.type));
    }
    if (llvm::is_contained(match.results, mlir::Type())) {
      if (why)
        *why =
            ("the result of '" + spec.pythonName + "' would have more than " +
             Twine(maxComponents) + " components")
                .str();
      return std::nullopt;
    }
    return match;
  }
  if (why)
    *why = describeMismatch(spec, context, operands);
  return std::nullopt;
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

LogicalResult warp::verifyBuiltin(Operation *op, const BuiltinSpec &spec) {
  std::string why;
  std::optional<BuiltinMatch> match =
      matchBuiltin(spec, op->getContext(), op->getOperandTypes(), &why);
  if (!match || !match->defaults.empty()) {
    if (why.empty())
      why = "the defaults of operands are not written out";
    return op->emitOpError("(C1) ") << why;
  }
  if (op->getResultTypes() == TypeRange(match->results))
    return success();
  return op->emitOpError("(C2) expects results of types (")
         << match->results << "), but got (" << op->getResultTypes() << ")";
}

Operation *warp::createBuiltin(OpBuilder &builder, Location location,
                               const BuiltinSpec &spec, ValueRange operands) {
  std::string why;
  std::optional<BuiltinMatch> match =
      matchBuiltin(spec, location.getContext(), operands.getTypes(), &why);
  if (!match) {
    emitError(location) << why;
    return nullptr;
  }
  OperationState state(location, spec.opName);
  state.addOperands(operands);
  for (TypedAttr value : match->defaults)
    state.addOperands(ConstantOp::create(builder, location, value).getResult());
  state.addTypes(match->results);
  return builder.create(state);
}

Operation *warp::createBuiltin(OpBuilder &builder, Location location,
                               StringRef pythonName, ValueRange operands) {
  const BuiltinSpec *spec = lookupBuiltin(pythonName);
  if (!spec || spec->isSpecial) {
    emitError(location) << "there is no builtin '" << pythonName << "'";
    return nullptr;
  }
  return createBuiltin(builder, location, *spec, operands);
}
