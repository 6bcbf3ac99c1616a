//===- FunctionBase.td - Records of device functions --------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A record of a function of the device library is the only place that knows
// its signature. From it come the prototype that lib/DeviceLib is compiled
// against, the table that `warp.library_call` is verified and lowered with, and
// the declarations for C++ snippets of users. A record of a handle kind gives
// its number and the layout of its slot to C++, to kernels in Python, to alias
// analysis and to files of saved graphs.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_FUNCTION_BASE_TD
#define WARP_FUNCTION_BASE_TD

//===----------------------------------------------------------------------===//
// Handles
//===----------------------------------------------------------------------===//

/// Words of 64 bits in the slot of a handle.
class SlotField<string nameOf, int wordsOf = 1> {
  string name = nameOf;
  int words = wordsOf;
  string form = "Number";
  int elementSize = 0;
  bit isReadOnly = 0;
}
/// One number, or two of 32 bits.
class Word<string name> : SlotField<name>;
/// An address; null where there is nothing.
class Pointer<string name> : SlotField<name> { let form = "Pointer"; }
/// An array descriptor: addresses of values and gradients, extents, strides.
class Array<string name, int size> : SlotField<name, 7> {
  let form = "Array";
  let elementSize = size;
}
/// A field that leads to memory which only the runtime writes, and not while
/// kernels run, so that loads may be moved and repeated. It holds for what
/// kernels take as an array of one dimension there.
class ReadOnly<SlotField of> : SlotField<of.name, of.words> {
  let form = of.form;
  let elementSize = of.elementSize;
  let isReadOnly = 1;
}

/// A kind of objects that kernels know by a number. Word 0 of the slot tells
/// kind, device and generation; `fields` begin at word 1. A handle is accepted
/// where one of `bases` is expected.
class HandleKind<int numberOf, list<SlotField> fieldsOf,
                 list<HandleKind> basesOf = []> {
  int number = numberOf;
  list<SlotField> fields = fieldsOf;
  list<HandleKind> bases = basesOf;
}

//===----------------------------------------------------------------------===//
// Functions
//===----------------------------------------------------------------------===//

/// A C++ struct of results, `name: type, ...`. A type is a scalar, an array of
/// scalars such as `i32[8]`, or another struct.
class ResultStruct<string fieldsOf> {
  string fields = fieldsOf;
}

class FunctionTrait;
/// Registers of a GPU thread, where the function searches step by step through
/// memory and threads have to hide each other's latency.
class Registers<int countOf> : FunctionTrait { int count = countOf; }
/// There is a form `<name>_lanes` for SIMD lanes of a CPU: operands but the
/// first `shared` are pointers to one value per lane, the number of lanes comes
/// next, and results are as many values per member. It may be called with any
/// values for lanes that do not run.
class Lanes<int sharedOf> : FunctionTrait { int shared = sharedOf; }
/// GPU kernels link machine code of it; with `Short` only beside others.
def Assembled : FunctionTrait;
def AssembledShort : FunctionTrait;
/// The same on targets whose archive has products of tiles.
def AssembledProduct : FunctionTrait;
def AssembledProductShort : FunctionTrait;
/// Gives the address of the slot of a handle, its first operand, of a kind,
/// its second operand.
def FindsSlot : FunctionTrait;
/// The compiler replaces calls; the library does not define it.
def Expanded : FunctionTrait;

/// A function `warp_<name>` of the device library. The signature is
/// `(name: type, ...) -> type`; types of operands:
///   i32  u64  f32  f64     numbers
///   vec2d  vec3f  vec3d  vec3i   their components, one operand each
///   handle<Kind>           a handle of that kind
///   address                memory, which the function may change
/// The result is a scalar, a struct by the name of its record, or `()`. In C
/// the last parameter is a pointer to the result. A star at the end of a name
/// stands for several endings.
class DeviceFunction<string nameOf, string signatureOf,
                     list<FunctionTrait> traitsOf = []> {
  string name = nameOf;
  string signature = signatureOf;
  list<FunctionTrait> traits = traitsOf;
}
class TileFunction<string name, string signature,
                   list<FunctionTrait> traits = []>
    : DeviceFunction<"tile_" # name, signature, traits>;

#endif // WARP_FUNCTION_BASE_TD
