//===- FunctionKernel.cpp - Functions as kernels and back -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "FunctionKernel.h"

#include "Analysis/Effects.h"

#include "Autodiff/Rules/Rules.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/IRMapping.h"

using namespace mlir;
using warp::FunctionKernel;

bool warp::hasDifferential(Type type) {
  Type scalar = getElementScalar(type);
  return scalar && isFloat(scalar);
}

std::string warp::freshName(ModuleOp module, StringRef name,
                            StringRef suffix) {
  std::string made = (name + suffix).str();
  while (module.lookupSymbol(made))
    made += "_";
  return made;
}

//===----------------------------------------------------------------------===//
// The kernel
//===----------------------------------------------------------------------===//

FunctionKernel::FunctionKernel(func::FuncOp function)
    : name(function.getName()), argumentTypes(function.getArgumentTypes()) {
  auto module = function->getParentOfType<ModuleOp>();
  OpBuilder b(module.getContext());
  Location loc = function.getLoc();
  SmallVector<Type> types(argumentTypes);
  for (auto [i, type] : llvm::enumerate(argumentTypes)) {
    if (!hasDifferential(type))
      continue;
    types[i] = ArrayType::get(b.getContext(), 1, type);
    boxes.push_back({unsigned(i), type, false, {}, {}});
  }
  for (Type type : function.getResultTypes()) {
    if (!hasDifferential(type))
      continue;
    boxes.push_back({unsigned(types.size()), type, true, {}, {}});
    types.push_back(ArrayType::get(b.getContext(), 1, type));
  }
  b.setInsertionPointToEnd(module.getBody());
  auto kernel =
      func::FuncOp::create(b, loc, freshName(module, name, "_kernel"),
                           b.getFunctionType(types, {}));
  SmallVector<StringRef> names(types.size(), "x");
  kernel->setAttr(kernelAttrName, b.getUnitAttr());
  kernel->setAttr(attr::argNames, b.getStrArrayAttr(names));
  Block *body = kernel.addEntryBlock();
  b.setInsertionPointToStart(body);
  Value zero = ConstantOp::create(
      b, loc,
      cast<TypedAttr>(IntegerAttr::get(b.getIntegerType(32, true), 0)));
  SmallVector<Value> operands(
      body->getArguments().take_front(argumentTypes.size()));
  for (Box &box : boxes)
    if (!box.isResult)
      operands[box.position] = LoadOp::create(
          b, loc, box.type, body->getArgument(box.position), zero);
  auto call = func::CallOp::create(b, loc, function, operands);
  unsigned position = argumentTypes.size();
  for (Value result : call.getResults())
    if (hasDifferential(result.getType()))
      StoreOp::create(b, loc, result, body->getArgument(position++), zero);
  func::ReturnOp::create(b, loc);
}

//===----------------------------------------------------------------------===//
// From arrays to values
//===----------------------------------------------------------------------===//

LogicalResult FunctionKernel::fail(Operation *op) {
  return op->emitError("the derivative of '")
         << name << "' cannot be taken within a kernel: it keeps values in "
         << "memory between launches";
}

static Value converted(OpBuilder &b, Location loc, Value value, Type type) {
  if (!value)
    return warp::autodiff::zero(b, loc, type);
  return value.getType() == type
             ? value
             : warp::CastOp::create(b, loc, type, value).getResult();
}

/// Makes the element of an array a variable of the function's body. Returns its
/// value at the end; null stands for zero.
FailureOr<Value> FunctionKernel::promote(ArrayRef<Value> arrays,
                                         Value initial) {
  SmallVector<Operation *> accesses;
  for (Value array : arrays)
    llvm::copy_if(array.getUsers(), std::back_inserter(accesses),
                  [](Operation *op) { return !isa<GradOp>(op); });
  bool isConstant = llvm::all_of(
      accesses, [](Operation *op) { return isPlainRead(op); });
  auto isNested = [](Operation *op) {
    return !isa<func::FuncOp>(op->getParentOp());
  };
  if (!isConstant && llvm::any_of(accesses, isNested))
    return fail(accesses[0]);
  if (!isConstant)
    llvm::sort(accesses, [](Operation *a, Operation *b) {
      return a->isBeforeInBlock(b);
    });
  Value current = initial;
  for (Operation *op : accesses) {
    OpBuilder b(op);
    auto access = dyn_cast<AccessOp>(op);
    if (!access || access.getMask() || (access.isUpdate() && !isSum(op)))
      return fail(op);
    Value value = access.mayWrite() ? access.getWritten().front()
                                    : access.getRead().front();
    auto before = [&]() {
      return converted(b, op->getLoc(), current, value.getType());
    };
    if (access.isUpdate())
      current = autodiff::add(b, op->getLoc(), current ? before() : Value(),
                              value);
    else if (access.mayWrite())
      current = value;
    else
      value.replaceAllUsesWith(before());
    op->erase();
  }
  return current;
}

/// The twin of an array in the dual of a kernel, if it has one.
static Value findTwin(func::FuncOp dual, unsigned leaf) {
  auto hidden = dual->getAttrOfType<ArrayAttr>(warp::attr::hidden);
  if (!hidden)
    return nullptr;
  unsigned first = dual.getNumArguments() - hidden.size();
  for (auto [i, entry] : llvm::enumerate(hidden.getAsRange<warp::HiddenAttr>()))
    if (entry.getLeaf() == leaf)
      return dual.getArgument(first + i);
  return nullptr;
}

/// Arrays that hold the cotangent or tangent of what a box holds.
static SmallVector<Value> findDifferentials(func::FuncOp derivative,
                                            unsigned position, bool forward) {
  SmallVector<Value> found;
  Value array = derivative.getArgument(position);
  if (!forward) {
    for (Operation *user : array.getUsers())
      if (isa<warp::GradOp>(user))
        found.push_back(user->getResult(0));
    return found;
  }
  unsigned leaf = llvm::count_if(
      derivative.getArgumentTypes().take_front(position),
      [](Type type) { return isa<warp::ArrayType>(type); });
  if (Value twin = findTwin(derivative, leaf))
    found.push_back(twin);
  return found;
}

/// Makes a cotangent or tangent a value. One that is asked for is returned at
/// once, so that it follows when what it is computed from is replaced.
LogicalResult FunctionKernel::replaceDifferential(Box &box,
                                                  func::FuncOp derivative,
                                                  bool forward) {
  SmallVector<Value> arrays =
      findDifferentials(derivative, box.position, forward);
  FailureOr<Value> found = promote(arrays, box.seed);
  if (failed(found))
    return failure();
  if (!box.seed) {
    auto end = cast<func::ReturnOp>(derivative.front().getTerminator());
    OpBuilder b(end);
    end.getOperandsMutable().append(
        converted(b, end.getLoc(), *found, box.type));
  }
  for (Value array : arrays)
    if (Operation *op = array.getDefiningOp())
      op->erase();
  return success();
}

FailureOr<func::FuncOp> FunctionKernel::toFunction(func::FuncOp derivative,
                                                   ModuleOp module,
                                                   bool forward) {
  auto hidden = derivative->getAttrOfType<ArrayAttr>(attr::hidden);
  if (hidden && !forward)
    return fail(derivative);
  Block &body = derivative.front();
  Location loc = derivative.getLoc();
  for (Box &box : boxes) {
    if (!box.isResult)
      box.value = body.addArgument(box.type, loc);
    if (box.isResult != forward)
      box.seed = body.addArgument(box.type, loc);
    if (failed(promote({body.getArgument(box.position)}, box.value)))
      return failure();
  }
  for (Box &box : boxes)
    if (failed(replaceDifferential(box, derivative, forward)))
      return failure();
  return move(derivative, module, forward);
}

func::FuncOp FunctionKernel::move(func::FuncOp derivative, ModuleOp module,
                                  bool forward) {
  auto end = cast<func::ReturnOp>(derivative.front().getTerminator());
  OpBuilder b(end);
  SmallVector<Type> types(argumentTypes);
  for (Box &box : boxes)
    if (box.seed)
      types.push_back(box.type);
  b.setInsertionPointToEnd(module.getBody());
  auto made = func::FuncOp::create(
      b, derivative.getLoc(),
      freshName(module, name, forward ? "_jvp" : "_vjp"),
      b.getFunctionType(types, end.getOperandTypes()));
  made.setPrivate();
  Block *body = made.addEntryBlock();
  IRMapping map;
  for (unsigned i = 0; i < argumentTypes.size(); ++i)
    map.map(derivative.getArgument(i), body->getArgument(i));
  unsigned seeds = argumentTypes.size();
  for (Box &box : boxes) {
    if (box.value)
      map.map(box.value, body->getArgument(box.position));
    if (box.seed)
      map.map(box.seed, body->getArgument(seeds++));
  }
  b.setInsertionPointToStart(body);
  for (Operation &op : derivative.front())
    b.clone(op, map);
  return made;
}
