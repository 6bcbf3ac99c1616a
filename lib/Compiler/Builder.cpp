//===- Builder.cpp - Functions, constants and calls -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The implementation of "warp/Builder.h" over MLIR. A function is built from
// front to back at one insertion point; a function that a caller needs is
// begun while the caller's is open, so open functions form a stack.
//
// Constants stand at the start of the entry block, each once. They dominate
// everything, so the front end may ask for one at any time, and the text of
// the module, which keys the kernel cache, does not depend on when it did.
//
// Branches and loops are in BuilderControl.cpp, operations on values in
// BuilderValues.cpp, on arrays in BuilderArrays.cpp.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/IR/Verifier.h"

#include <cmath>

using namespace mlir;

//===----------------------------------------------------------------------===//
// State
//===----------------------------------------------------------------------===//

warp::Builder::Impl::Impl(const std::string &name)
    : builder(&compilerContext()), loc(builder.getUnknownLoc()) {
  module = ModuleOp::create(loc, name);
}

warp::Builder::Impl::~Impl() {
  ContextLock lock;
  module = nullptr;
}

void warp::Builder::Impl::fail(Error::Kind kind,
                               const std::string &message) const {
  throw Error(kind, message, file, line, column);
}

warp::Builder::Impl::Function &warp::Builder::Impl::function() {
  if (functions.empty())
    fail(Error::Kind::Value, "expects an open function, begin one first");
  return functions.back();
}

warp::Builder::Builder(const std::string &name) {
  ContextLock lock;
  impl = std::make_unique<Impl>(name);
}

warp::Builder::~Builder() = default;

void warp::Builder::setLocation(const std::string &file, int line,
                                int column) {
  if (impl->line == line && impl->column == column && impl->file == file)
    return;
  ContextLock lock;
  impl->file = file;
  impl->line = line;
  impl->column = column;
  impl->loc = FileLineColLoc::get(impl->builder.getContext(), file, line,
                                  column);
}

//===----------------------------------------------------------------------===//
// Functions
//===----------------------------------------------------------------------===//

warp::Builder::Values
warp::Builder::beginFunction(const std::string &name,
                             const std::vector<std::string> &argNames,
                             const std::vector<Type> &argTypes,
                             bool isKernel) {
  ContextLock lock;
  OpBuilder &b = impl->builder;
  if (impl->module->lookupSymbol(name))
    impl->fail(Error::Kind::Value, "function '" + name + "' exists already");
  SmallVector<mlir::Type> types;
  for (Type type : argTypes)
    types.push_back(unwrap(type));
  Impl::Function opened;
  opened.caller = b.saveInsertionPoint();
  b.setInsertionPointToEnd(impl->module->getBody());
  opened.op = func::FuncOp::create(b, impl->loc, name,
                                   b.getFunctionType(types, {}));
  if (isKernel) {
    SmallVector<StringRef> names(argNames.begin(), argNames.end());
    opened.op->setAttr(kernelAttrName, b.getUnitAttr());
    opened.op->setAttr(attr::argNames, b.getStrArrayAttr(names));
  } else {
    opened.op.setPrivate();
  }
  Block *body = opened.op.addEntryBlock();
  b.setInsertionPointToStart(body);
  impl->functions.push_back(std::move(opened));
  return wrap(body->getArguments());
}

void warp::Builder::endFunction(const Values &results) {
  ContextLock lock;
  OpBuilder &b = impl->builder;
  Impl::Function &closed = impl->function();
  if (!closed.ifs.empty() || !closed.loops.empty())
    impl->fail(Error::Kind::Value, "a branch or loop is still open");
  SmallVector<mlir::Value> values = unwrap(results);
  func::ReturnOp::create(b, impl->loc, values);
  closed.op.setFunctionType(
      b.getFunctionType(closed.op.getArgumentTypes(),
                        TypeRange(ValueRange(values))));
  impl->finished[closed.op.getSymName()] = closed.op;
  b.restoreInsertionPoint(closed.caller);
  impl->functions.pop_back();
}

void warp::Builder::setInlineBudget(int64_t operations) {
  ContextLock lock;
  impl->function().op->setAttr(attr::inlineBudget,
                               impl->builder.getI64IntegerAttr(operations));
}

std::vector<warp::Type>
warp::Builder::resultTypes(const std::string &name) const {
  auto found = impl->finished.find(name);
  if (found == impl->finished.end())
    impl->fail(Error::Kind::Key, "no finished function '" + name + "'");
  std::vector<Type> types;
  for (mlir::Type type : found->second.getResultTypes())
    types.push_back(wrap(type));
  return types;
}

warp::Builder::Values warp::Builder::call(const std::string &name,
                                          const Values &args) {
  ContextLock lock;
  auto found = impl->finished.find(name);
  if (found == impl->finished.end())
    impl->fail(Error::Kind::Key, "no finished function '" + name + "'");
  func::FuncOp callee = found->second;
  SmallVector<mlir::Value> operands = unwrap(args);
  TypeRange passed{ValueRange(operands)};
  if (passed != TypeRange(callee.getArgumentTypes()))
    impl->failType("function '" + name + "' expects " +
                   quotedTypes(callee.getArgumentTypes()) + ", but got " +
                   quotedTypes(passed));
  auto call = func::CallOp::create(impl->builder, impl->loc, callee, operands);
  return wrap(call.getResults());
}

warp::Module warp::Builder::finish() {
  ContextLock lock;
  if (!impl->functions.empty())
    impl->fail(Error::Kind::Value, "a function is still open");
  Diagnostics diagnostics;
  if (failed(verify(*impl->module)))
    throw diagnostics.toError(Error::Kind::Compile, "invalid IR");
  auto made = std::make_shared<Module::Impl>();
  made->op = std::move(impl->module);
  impl->finished.clear();
  impl->module = ModuleOp::create(impl->builder.getUnknownLoc());
  return Module(std::move(made));
}

//===----------------------------------------------------------------------===//
// Constants
//===----------------------------------------------------------------------===//

/// The integral value of a number, as 65 bits, signed.
static std::optional<APInt> integerBits(const warp::Number &number) {
  constexpr unsigned width = 65;
  if (const bool *flag = std::get_if<bool>(&number))
    return APInt(width, *flag);
  if (const int64_t *value = std::get_if<int64_t>(&number))
    return APInt(width, *value, /*isSigned=*/true);
  if (const uint64_t *value = std::get_if<uint64_t>(&number))
    return APInt(width, *value);
  return std::nullopt;
}

static double toDouble(const warp::Number &number) {
  return std::visit([](auto value) { return static_cast<double>(value); },
                    number);
}

TypedAttr warp::numberAttr(mlir::Type type, const Number &number) {
  if (isFloat(type))
    return FloatAttr::get(type, toDouble(number));
  if (isBool(type))
    return IntegerAttr::get(type, toDouble(number) != 0.0);
  unsigned width = type.getIntOrFloatBitWidth();
  bool isSigned = !type.isUnsignedInteger();
  if (std::optional<APInt> bits = integerBits(number)) {
    bool fits = isSigned ? bits->isSignedIntN(width)
                         : !bits->isNegative() && bits->isIntN(width);
    return fits ? TypedAttr(IntegerAttr::get(type, bits->trunc(width)))
                : TypedAttr();
  }
  // A float becomes an integer as `cast` does it.
  llvm::APSInt rounded(width, !isSigned);
  bool exact = false;
  double value = std::get<double>(number);
  if (std::isnan(value))
    return IntegerAttr::get(type, APInt(width, 0));
  APFloat(value).convertToInteger(rounded, APFloat::rmTowardZero, &exact);
  return IntegerAttr::get(type, rounded);
}

mlir::Value warp::Builder::Impl::constant(TypedAttr value) {
  mlir::Value &known = function().constants[value];
  if (!known)
    known = hoist([&] {
      return ConstantOp::create(builder, functions.back().op.getLoc(), value)
          .getResult();
    });
  return known;
}

mlir::Value warp::Builder::Impl::constantI32(int64_t value) {
  mlir::Type type = builder.getIntegerType(32, /*isSigned=*/true);
  return constant(IntegerAttr::get(type, value));
}

static std::string numberText(const warp::Number &number) {
  if (const double *value = std::get_if<double>(&number)) {
    std::string text;
    llvm::raw_string_ostream(text) << *value;
    return text;
  }
  return llvm::toString(*integerBits(number), 10, /*Signed=*/true);
}

warp::Value warp::Builder::constant(Type type, Number number) {
  ContextLock lock;
  mlir::Type wanted = unwrap(type);
  mlir::Type scalar = getElementScalar(wanted);
  if (!scalar)
    impl->failType("expects a number or composite for a constant, but got " +
                   quoted(wanted));
  TypedAttr attribute = numberAttr(scalar, number);
  if (!attribute)
    impl->fail(Error::Kind::Overflow, "integer " + numberText(number) +
                                          " does not fit " + quoted(scalar));
  mlir::Value component = impl->constant(attribute);
  if (scalar == wanted)
    return wrap(component);
  return construct(type, {wrap(component)});
}

mlir::Value warp::Builder::Impl::zero(mlir::Type type) {
  if (isScalar(type))
    return constant(numberAttr(type, int64_t(0)));
  if (mlir::Value known = function().zeros.lookup(type))
    return known;
  SmallVector<mlir::Value> fields;
  auto structType = dyn_cast<StructType>(type);
  auto arrayType = dyn_cast<ArrayType>(type);
  if (arrayType)
    fields.assign(arrayType.getRank() + 1,
                  constant(numberAttr(builder.getIntegerType(64, false),
                                      int64_t(0))));
  else if (structType)
    for (mlir::Type field : structType.getFieldTypes())
      fields.push_back(zero(field));
  else if (auto tileType = dyn_cast<TileType>(type))
    fields.push_back(zero(tileType.getElementType()));
  else if (!isComposite(type))
    failType("no zero of type " + quoted(type));
  Location place = functions.back().op.getLoc();
  mlir::Value made = hoist([&]() -> mlir::Value {
    if (structType)
      return StructCreateOp::create(builder, place, type, fields);
    if (arrayType)
      return ArrayAtOp::create(builder, place, type, fields[0],
                               ArrayRef(fields).drop_front());
    if (isa<TileType>(type))
      return TileSplatOp::create(builder, place, type, fields[0]);
    return ConstructOp::create(builder, place, type, ValueRange());
  });
  return function().zeros[type] = made;
}

warp::Value warp::Builder::zero(Type type) {
  ContextLock lock;
  return wrap(impl->zero(unwrap(type)));
}
