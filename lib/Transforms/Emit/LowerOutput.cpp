//===- LowerOutput.cpp - printf, assertions and error records -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `printf` becomes a call: of `warp_printf` (the runtime's) with C's variable
// arguments on the CPU, of the target's with a packed buffer on the GPU. The
// conversions of the format are rewritten to the lengths of the arguments.
//
// An error is written to the launch's error record, by the first thread that
// meets one; the record names the place in the source by a site number.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"
#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/DataLayoutInterfaces.h"

using namespace mlir;
using namespace warp;

//===----------------------------------------------------------------------===//
// printf
//===----------------------------------------------------------------------===//

/// The conversion, if it suits an argument of this type, else one that does:
/// no format may make `printf` read or write where there is nothing.
static char suitConversion(char letter, mlir::Type type) {
  if (isFloat(type))
    return StringRef("aAeEfFgG").contains(letter) ? letter : 'f';
  return StringRef("diuoxXc").contains(letter) ? letter : 'd';
}

/// The format with every conversion, and its length, made that of its argument.
/// `letters` gets the conversion letter of each argument.
static std::string rewriteFormat(StringRef format, TypeRange types,
                                 SmallVectorImpl<char> &letters) {
  std::string text;
  for (size_t i = 0; i < format.size(); ++i) {
    text += format[i];
    if (format[i] != '%')
      continue;
    if (i + 1 < format.size() && format[i + 1] == '%') {
      text += format[++i];
      continue;
    }
    while (++i < format.size() && !isalpha(format[i]))
      if (format[i] != '*')
        text += format[i];
    while (i < format.size() && StringRef("hlLqjzt").contains(format[i]))
      ++i;
    if (i == format.size())
      break;
    size_t number = letters.size();
    char letter = 'd';
    if (number < types.size())
      letter = suitConversion(format[i], types[number]);
    if (number < types.size() && types[number].isInteger(64) && letter != 'c')
      text += "ll";
    letters.push_back(letter);
    text += letter;
  }
  return text;
}

/// A constant string of the module, as a pointer.
mlir::Value ArrayLowering::formatString(StringRef text) {
  unsigned space = gpu ? 1 : 0;
  LLVM::GlobalOp global;
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(module.getBody());
    SmallVector<char> bytes(text.begin(), text.end());
    bytes.push_back(0);
    StringAttr value = b.getStringAttr(StringRef(bytes.data(), bytes.size()));
    auto type = LLVM::LLVMArrayType::get(i8, bytes.size());
    auto globals = module.getOps<LLVM::GlobalOp>();
    int64_t number = std::distance(globals.begin(), globals.end());
    global = LLVM::GlobalOp::create(
        b, loc, type, /*isConstant=*/true, LLVM::Linkage::Internal,
        "warp_text" + std::to_string(number), value, /*alignment=*/1, space);
  }
  mlir::Value address = LLVM::AddressOfOp::create(
      b, loc, LLVM::LLVMPointerType::get(b.getContext(), space),
      global.getSymName());
  if (gpu)
    address = LLVM::AddrSpaceCastOp::create(b, loc, pointer, address);
  return address;
}

LLVM::LLVMFuncOp ArrayLowering::declare(StringRef name, TypeRange arguments,
                                        bool isVariadic) {
  if (auto found = module.lookupSymbol<LLVM::LLVMFuncOp>(name))
    return found;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(module.getBody());
  auto type = LLVM::LLVMFunctionType::get(
      i32, SmallVector<mlir::Type>(arguments), isVariadic);
  return LLVM::LLVMFuncOp::create(b, loc, name, type);
}

void ArrayLowering::lowerPrintf(PrintfOp op) {
  SmallVector<char> letters;
  std::string format =
      rewriteFormat(op.getFormat(), op.getArgs().getTypes(), letters);
  // C's promotions: 32-bit integers at least, and doubles.
  SmallVector<mlir::Value> args;
  for (auto [i, value] : llvm::enumerate(op.getArgs())) {
    mlir::Type type = value.getType();
    char letter = i < letters.size() ? letters[i] : 'd';
    bool isUnsigned = type.isInteger(1) || StringRef("uxXoc").contains(letter);
    mlir::Value promoted = value;
    if (isFloat(type) && !type.isF64())
      promoted = arith::ExtFOp::create(b, loc, b.getF64Type(), value);
    else if (!isFloat(type) && type.getIntOrFloatBitWidth() < 32)
      promoted = isUnsigned
                     ? arith::ExtUIOp::create(b, loc, i32, value).getResult()
                     : arith::ExtSIOp::create(b, loc, i32, value).getResult();
    args.push_back(promoted);
  }
  mlir::Value text = formatString(format);
  if (!gpu) {
    args.insert(args.begin(), text);
    LLVM::CallOp::create(b, loc, declare("warp_printf", pointer, true), args);
    return;
  }
  SmallVector<mlir::Type> fields;
  for (mlir::Value value : args)
    fields.push_back(value.getType());
  auto record = LLVM::LLVMStructType::getLiteral(b.getContext(), fields);
  mlir::Value buffer;
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(&entry.getBody().front());
    buffer =
        LLVM::AllocaOp::create(b, loc, pointer, record, constant(i32, 1), 8);
  }
  for (auto [i, value] : llvm::enumerate(args)) {
    mlir::Value slot = LLVM::GEPOp::create(
        b, loc, pointer, record, buffer, ArrayRef<LLVM::GEPArg>{0, int32_t(i)});
    LLVM::StoreOp::create(b, loc, value, slot);
  }
  target.emitPrintf(b, loc, module, text, buffer,
                    DataLayout(module).getTypeSize(record).getFixedValue());
}

//===----------------------------------------------------------------------===//
// Error records
//===----------------------------------------------------------------------===//

void ArrayLowering::lowerAssert(AssertOp op) {
  if (!debug && !op.getAlways())
    return;
  mlir::Value failed = arith::XOrIOp::create(b, loc, op.getCondition(),
                                             constant(b.getI1Type(), 1));
  auto guard = scf::IfOp::create(b, loc, failed, /*withElseRegion=*/false);
  b.setInsertionPointToStart(guard.thenBlock());
  report(op.getLoc(),
         op.getAlways() ? CheckKind::Failure : CheckKind::Assertion,
         op.getMessage(), {}, {});
}

void ArrayLowering::lowerCheckIndex(CheckIndexOp op) {
  mlir::Value inside;
  SmallVector<mlir::Value, 4> indices, extents;
  for (auto [index, bound] :
       llvm::zip_equal(op.getIndices(), op.getExtents())) {
    mlir::Value extent = constant(i32, bound);
    mlir::Value i = op.getOffsets() ? index : wrapIndex(index, extent);
    mlir::Value fits = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult,
                                             i, widen(extent, i.getType()));
    inside =
        inside ? arith::AndIOp::create(b, loc, inside, fits).getResult() : fits;
    indices.push_back(i);
    extents.push_back(extent);
  }
  auto check = scf::IfOp::create(b, loc, inside, /*withElseRegion=*/true);
  b.setInsertionPointToStart(check.elseBlock());
  report(op.getLoc(), op.getOffsets() ? CheckKind::Offset : CheckKind::Part,
         op.getWhat(), indices, extents);
}

/// The innermost place that is not in functions of the package itself, if there
/// is one: who called them can mend it.
static FileLineColLoc findPlace(Location at) {
  FileLineColLoc innermost, found;
  at->walk([&](Location part) {
    auto place = dyn_cast<FileLineColLoc>(part);
    if (!place)
      return WalkResult::advance();
    if (!innermost)
      innermost = place;
    if (place.getFilename().getValue().contains("/warp/_src/"))
      return WalkResult::advance();
    found = place;
    return WalkResult::interrupt();
  });
  return found ? found : innermost;
}

/// Number of a place in the table that goes with the code.
int64_t ArrayLowering::siteNumber(Location at, StringRef what) {
  FileLineColLoc place = findPlace(at);
  Attribute site = b.getArrayAttr(
      {b.getStringAttr(place ? place.getFilename().getValue() : ""),
       b.getI64IntegerAttr(place ? place.getLine() : 0),
       b.getI64IntegerAttr(place ? place.getColumn() : 0),
       b.getStringAttr(what)});
  auto found = llvm::find(sites, site);
  if (found == sites.end())
    found = sites.insert(found, site);
  return found - sites.begin();
}

void ArrayLowering::report(Location at, CheckKind kind, StringRef what,
                           ValueRange indices, ValueRange shape) {
  SmallVector<mlir::Value> args{
      errorRecord, constant(i32, siteNumber(at, what)),
      constant(i32, static_cast<int64_t>(kind) | indices.size() << 8)};
  for (size_t d = 0; d < 4; ++d)
    args.push_back(d < indices.size() ? widen(indices[d], i64)
                                      : constant(i64, 0));
  for (size_t d = 0; d < 4; ++d)
    args.push_back(d < shape.size() ? shape[d] : constant(i32, 0));
  LLVM::CallOp::create(b, loc, getReportFunction(), args);
}

/// void warp_report(i64 record, i32 site, i32 kind, 4 indices, 4 extents)
/// The second byte of `kind`, which is that of the record's `rank`, is the
/// number of indices.
LLVM::LLVMFuncOp ArrayLowering::getReportFunction() {
  StringRef name = "warp_report";
  if (auto found = module.lookupSymbol<LLVM::LLVMFuncOp>(name))
    return found;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(module.getBody());
  SmallVector<mlir::Type> types{i64, i32, i32};
  types.append(4, i64);
  types.append(4, i32);
  auto type = LLVM::LLVMFunctionType::get(
      LLVM::LLVMVoidType::get(b.getContext()), types);
  auto function =
      LLVM::LLVMFuncOp::create(b, loc, name, type, LLVM::Linkage::Internal);
  function.setPassthroughAttr(
      b.getArrayAttr({b.getStringAttr("noinline"), b.getStringAttr("cold")}));
  Block *first = function.addEntryBlock(b);
  Block *exit = b.createBlock(&function.getBody());
  LLVM::ReturnOp::create(b, loc, ValueRange());
  Block *write = b.createBlock(exit);
  Block *claim = b.createBlock(write);
  auto branch = [&](mlir::Value condition, Block *then) {
    LLVM::CondBrOp::create(b, loc, condition, then, ValueRange(), exit,
                           ValueRange());
  };

  b.setInsertionPointToStart(first);
  mlir::Value address = function.getArgument(0);
  branch(arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, address,
                               constant(i64, 0)),
         claim);
  b.setInsertionPointToStart(claim);
  mlir::Value record = LLVM::IntToPtrOp::create(b, loc, dataPointer, address);
  mlir::Value taken = LLVM::AtomicRMWOp::create(
      b, loc, LLVM::AtomicBinOp::xchg, record, constant(i32, 1),
      LLVM::AtomicOrdering::monotonic);
  branch(arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, taken,
                               constant(i32, 0)),
         write);
  b.setInsertionPointToStart(write);
  auto store = [&](int argument, int64_t offset) {
    LLVM::StoreOp::create(b, loc, function.getArgument(argument),
                          advance(record, offset));
  };
  store(1, offsetof(ErrorRecord, site));
  store(2, offsetof(ErrorRecord, kind));
  for (int d = 0; d < maxRank; ++d) {
    store(3 + d, offsetof(ErrorRecord, index) + sizeof(int64_t) * d);
    store(3 + maxRank + d, offsetof(ErrorRecord, shape) + sizeof(int32_t) * d);
  }
  LLVM::BrOp::create(b, loc, ValueRange(), exit);
  return function;
}
