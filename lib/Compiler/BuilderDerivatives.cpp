//===- BuilderDerivatives.cpp - Functions and their derivatives -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A function with a derivative of its own names it in `warp.vjp`, and stays
// called until the engine has used that. With
//
//   @f(arguments) -> (results, residuals)
//
// the derivative, its pullback, is
//
//   @g(arguments, residuals, cotangents of results) -> cotangents of arguments
//
// where only floats and composites of floats have cotangents. Gradients of
// arrays among the arguments are updated by @g itself, through `warp.grad`. For
// forward mode there may be a pushforward in `warp.jvp`:
//
//   @p(arguments, tangents of arguments) -> tangents of results
//
// None of them takes or returns structs: fields are passed one by one.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

#include "WarpDialect/Passes.h"

using namespace mlir;

static func::FuncOp find(warp::Builder::Impl &impl, const std::string &name) {
  auto found = impl.finished.find(name);
  if (found == impl.finished.end())
    impl.fail(warp::Error::Kind::Key, "no finished function '" + name + "'");
  return found->second;
}

static bool hasDifferential(mlir::Type type) {
  mlir::Type scalar = warp::getElementScalar(type);
  return scalar && warp::isFloat(scalar);
}

void warp::Builder::setPullback(const std::string &name,
                                const std::string &pullback, int residuals) {
  ContextLock lock;
  func::FuncOp function = find(*impl, name);
  function->setAttr(attr::vjp,
                    FlatSymbolRefAttr::get(find(*impl, pullback)));
  if (residuals)
    function->setAttr(attr::residuals,
                      impl->builder.getI64IntegerAttr(residuals));
}

void warp::Builder::setPushforward(const std::string &name,
                                   const std::string &pushforward) {
  ContextLock lock;
  find(*impl, name)
      ->setAttr(attr::jvp, FlatSymbolRefAttr::get(find(*impl, pushforward)));
}

void warp::Builder::setReplay(const std::string &name,
                              const std::string &replay) {
  ContextLock lock;
  find(*impl, name)
      ->setAttr(attr::replay, FlatSymbolRefAttr::get(find(*impl, replay)));
}

warp::Builder::Values warp::Builder::vjp(const std::string &name,
                                         const Values &args,
                                         const Values &cotangents,
                                         bool arrays) {
  ContextLock lock;
  func::FuncOp callee = find(*impl, name);
  SmallVector<mlir::Type> results =
      llvm::filter_to_vector(callee.getArgumentTypes(), hasDifferential);
  auto op = VjpOp::create(impl->builder, impl->loc, results, callee.getName(),
                          unwrap(args), unwrap(cotangents), arrays);
  return wrap(op.getResults());
}

warp::Builder::Values warp::Builder::jvp(const std::string &name,
                                         const Values &args,
                                         const Values &tangents) {
  ContextLock lock;
  func::FuncOp callee = find(*impl, name);
  SmallVector<mlir::Type> results =
      llvm::filter_to_vector(callee.getResultTypes(), hasDifferential);
  auto op = JvpOp::create(impl->builder, impl->loc, results, callee.getName(),
                          unwrap(args), unwrap(tangents));
  return wrap(op.getResults());
}

warp::Value warp::Builder::grad(Value array) {
  ContextLock lock;
  if (!isa<ArrayType>(unwrap(array).getType()))
    impl->failType("expects an array for its gradient, but got " +
                   quoted(unwrap(array).getType()));
  return wrap(
      GradOp::create(impl->builder, impl->loc, unwrap(array)).getResult());
}
