//===- Mismatch.cpp - Why operands fit no overload ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The text names what was passed and lists what is accepted. When converting
// some operands to another scalar type would make an overload fit, it says so:
// mixing integers and floats is by far the most common cause.
//
//===----------------------------------------------------------------------===//

#include "OverloadMatcher.h"

#include "mlir/IR/Builders.h"
#include "llvm/ADT/StringExtras.h"

using namespace mlir;

/// `(vec3f, int32)`.
static std::string describeOperands(TypeRange operands) {
  std::string text = "(";
  llvm::ListSeparator comma;
  for (mlir::Type type : operands)
    text += StringRef(comma).str() + warp::getPythonName(type);
  return text + ")";
}

/// How Python writes the conversion of a value to a type.
static std::string getConversion(mlir::Type type) {
  if (type.isF32())
    return "float(...)";
  if (type.isSignedInteger(32))
    return "int(...)";
  return warp::getPythonName(type) + "(...)";
}

/// Candidates for a common scalar type, the ones that lose least first.
static SmallVector<mlir::Type> getScalarTypes(TypeRange operands,
                                              MLIRContext *context) {
  SmallVector<mlir::Type> found;
  for (mlir::Type type : operands)
    if (mlir::Type scalar = warp::getElementScalar(type))
      if (warp::isScalar(scalar) && !llvm::is_contained(found, scalar))
        found.push_back(scalar);
  auto rank = [](mlir::Type type) {
    return std::tuple(warp::isFloat(type), type.getIntOrFloatBitWidth(),
                      type.isSignedInteger(), type.isBF16());
  };
  llvm::sort(found,
             [&](mlir::Type a, mlir::Type b) { return rank(a) > rank(b); });
  // A function of floats called with integers only.
  mlir::Type single = Float32Type::get(context);
  if (!found.empty() && !llvm::is_contained(found, single))
    found.push_back(single);
  return found;
}

/// The conversions that make an overload fit, or nothing. Scalars are
/// preferred to composites as what is to be converted.
static std::string findConversions(ArrayRef<warp::Signature> signatures,
                                   TypeRange operands, MLIRContext *context) {
  warp::OverloadMatcher matcher(context);
  for (bool convertComposites : {false, true})
    for (mlir::Type scalar : getScalarTypes(operands, context)) {
      SmallVector<mlir::Type> converted(operands.begin(), operands.end());
      for (mlir::Type &type : converted)
        if (warp::isScalar(type) ||
            (convertComposites && warp::isComposite(type)))
          if (mlir::Type other = warp::withElementScalar(type, scalar))
            type = other;
      if (llvm::none_of(signatures, [&](const warp::Signature &signature) {
            return matcher.match(signature, converted);
          }))
        continue;
      std::string text;
      for (auto [i, type] : llvm::enumerate(converted)) {
        if (type == operands[i])
          continue;
        text += (text.empty() ? "use `" : ", `") + getConversion(type) +
                "` for operand " + std::to_string(i + 1);
      }
      return text;
    }
  return "";
}

std::string warp::describeMismatch(const BuiltinSpec &spec,
                                   MLIRContext *context, TypeRange operands) {
  bool isOperator = !spec.symbol.empty();
  StringRef name = isOperator ? spec.symbol : spec.pythonName;
  std::string text =
      "no overload of '" + name.str() + "' takes " + describeOperands(operands);
  ArrayRef<Signature> signatures = getSignatures(spec);
  std::string fix = findConversions(signatures, operands, context);
  if (!fix.empty())
    text += "; " + fix;
  text += "\n  overloads:";
  for (const Signature &signature : signatures)
    text += "\n    " + printSignature(spec.pythonName, signature);
  return text;
}
