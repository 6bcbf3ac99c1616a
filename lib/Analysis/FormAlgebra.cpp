//===- FormAlgebra.cpp - Arithmetic on affine forms -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Numbers are kept modulo 2^64, which every smaller power of two divides, so
// no operation here can overflow.
//
//===----------------------------------------------------------------------===//

#include "Forms.h"

#include "mlir/IR/Operation.h"

#include "llvm/Support/MathExtras.h"
#include "llvm/Support/raw_ostream.h"

#include <numeric>

using namespace mlir;
using warp::Form;
using warp::Symbol;
using warp::Term;

static int64_t addWrapped(int64_t a, int64_t b) {
  return int64_t(uint64_t(a) + uint64_t(b));
}

static int64_t multiplyWrapped(int64_t a, int64_t b) {
  return int64_t(uint64_t(a) * uint64_t(b));
}

//===----------------------------------------------------------------------===//
// Symbols and terms
//===----------------------------------------------------------------------===//

Value Symbol::getValue() const {
  bool isOfValue = kind == Kind::Extent || kind == Kind::Opaque;
  return isOfValue ? Value::getFromOpaquePointer(key) : Value();
}

Operation *Symbol::getLoop() const {
  return kind == Kind::Trip ? static_cast<Operation *>(key) : nullptr;
}

bool Symbol::isDefinedOutside(Operation *op) const {
  if (Operation *loop = getLoop())
    return !op->isAncestor(loop);
  Value value = getValue();
  return !value || !op->isAncestor(value.getParentBlock()->getParentOp());
}

bool Term::isLike(const Term &other) const {
  if (product.size() != other.product.size())
    return false;
  SmallVector<Symbol, 2> rest(other.product);
  for (Symbol symbol : product) {
    auto *found = llvm::find(rest, symbol);
    if (found == rest.end())
      return false;
    rest.erase(found);
  }
  return true;
}

//===----------------------------------------------------------------------===//
// Forms
//===----------------------------------------------------------------------===//

std::optional<int64_t> Form::getConstant() const {
  return terms.empty() ? std::optional(constant) : std::nullopt;
}

std::optional<Symbol> Form::getSymbol() const {
  bool isOne = constant == 0 && terms.size() == 1 && terms[0].factor == 1 &&
               terms[0].product.size() == 1;
  return isOne ? std::optional(terms[0].product[0]) : std::nullopt;
}

bool Form::has(Symbol symbol) const {
  return llvm::any_of(terms,
                      [&](const Term &term) { return term.has(symbol); });
}

bool Form::isDefinedOutside(Operation *op) const {
  return llvm::all_of(terms, [&](const Term &term) {
    return llvm::all_of(term.product, [&](Symbol symbol) {
      return symbol.isDefinedOutside(op);
    });
  });
}

std::optional<Form> Form::coefficientOf(Symbol symbol) const {
  Form coefficient;
  coefficient.isExact = isExact;
  for (const Term &term : terms) {
    if (!term.has(symbol))
      continue;
    Form rest(term.factor);
    Term others{term.factor, {}};
    for (Symbol other : term.product)
      if (!(other == symbol))
        others.product.push_back(other);
    if (others.product.size() + 1 != term.product.size())
      return std::nullopt;
    if (!others.product.empty()) {
      rest.constant = 0;
      rest.terms.push_back(others);
    }
    coefficient.add(rest, 1);
  }
  return coefficient;
}

Form Form::without(Symbol symbol) const {
  Form rest = *this;
  llvm::erase_if(rest.terms, [&](Term &term) { return term.has(symbol); });
  return rest;
}

uint64_t Form::getDivisor() const {
  auto magnitude = [](int64_t x) { return x < 0 ? -uint64_t(x) : uint64_t(x); };
  uint64_t divisor = magnitude(constant);
  for (const Term &term : terms)
    divisor = std::gcd(divisor, magnitude(term.factor));
  return divisor;
}

/// False if the sum is too long.
bool Form::add(const Form &other, int64_t factor) {
  constant = addWrapped(constant, multiplyWrapped(factor, other.constant));
  isExact &= other.isExact;
  for (const Term &term : other.terms) {
    auto *found = llvm::find_if(
        terms, [&](const Term &mine) { return mine.isLike(term); });
    int64_t scaled = multiplyWrapped(factor, term.factor);
    if (found == terms.end())
      terms.push_back({scaled, term.product});
    else
      found->factor = addWrapped(found->factor, scaled);
  }
  llvm::erase_if(terms, [](const Term &term) { return term.factor == 0; });
  return terms.size() <= maxTerms;
}

std::optional<Form> Form::operator+(const Form &other) const {
  Form sum = *this;
  return sum.add(other, 1) ? std::optional(sum) : std::nullopt;
}

std::optional<Form> Form::operator-(const Form &other) const {
  Form difference = *this;
  return difference.add(other, -1) ? std::optional(difference) : std::nullopt;
}

std::optional<Form> Form::operator*(const Form &other) const {
  Form product;
  product.isExact = isExact && other.isExact;
  if (!product.add(*this, other.constant))
    return std::nullopt;
  Form scaled = other;
  scaled.constant = 0;
  if (!product.add(scaled, constant))
    return std::nullopt;
  for (const Term &left : terms)
    for (const Term &right : other.terms) {
      Term both{multiplyWrapped(left.factor, right.factor), left.product};
      llvm::append_range(both.product, right.product);
      Form term;
      term.terms.push_back(both);
      if (both.product.size() > maxFactors || !product.add(term, 1))
        return std::nullopt;
    }
  return product;
}

bool Form::equals(const Form &other) const {
  Form difference = *this;
  difference.add(other, -1);
  return difference.constant == 0 && difference.terms.empty();
}

Form Form::reduced(unsigned bits) const {
  if (bits == 0 || bits >= 64)
    return *this;
  Form result;
  result.isExact = isExact;
  result.constant = llvm::SignExtend64(constant, bits);
  for (const Term &term : terms)
    if (int64_t factor = llvm::SignExtend64(term.factor, bits))
      result.terms.push_back({factor, term.product});
  return result;
}

//===----------------------------------------------------------------------===//
// Text
//===----------------------------------------------------------------------===//

static void print(llvm::raw_ostream &stream, AsmState &names, Symbol symbol) {
  switch (symbol.kind) {
  case Symbol::Kind::Thread:
    stream << 't' << symbol.number;
    return;
  case Symbol::Kind::Trip: {
    // Named by what the first block of the loop begins with, or its results.
    Operation *loop = symbol.getLoop();
    stream << "trip(";
    Block &body = loop->getRegion(0).front();
    if (body.getNumArguments() != 0)
      body.getArgument(0).printAsOperand(stream, names);
    stream << ')';
    return;
  }
  case Symbol::Kind::Extent:
    stream << "dim(";
    symbol.getValue().printAsOperand(stream, names);
    stream << ", " << symbol.number << ')';
    return;
  case Symbol::Kind::Opaque:
    symbol.getValue().printAsOperand(stream, names);
    return;
  }
}

void Form::print(llvm::raw_ostream &stream, AsmState &names) const {
  bool isFirst = true;
  auto begin = [&](int64_t number) {
    bool isNegative = number < 0;
    if (isFirst)
      stream << (isNegative ? "-" : "");
    else
      stream << (isNegative ? " - " : " + ");
    isFirst = false;
    return isNegative ? -uint64_t(number) : uint64_t(number);
  };
  for (const Term &term : terms) {
    if (uint64_t factor = begin(term.factor); factor != 1)
      stream << factor << ' ';
    llvm::interleave(
        term.product, [&](Symbol symbol) { ::print(stream, names, symbol); },
        [&] { stream << ' '; });
  }
  if (constant != 0 || terms.empty())
    stream << begin(constant);
  if (!isExact)
    stream << " if no sum wraps";
}
