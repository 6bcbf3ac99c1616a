//===- WarpTypes.td - Types of the warp dialect --------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TYPES_TD
#define WARP_TYPES_TD

include "mlir/IR/AttrTypeBase.td"
include "WarpDialect.td"

class Warp_Type<string name, string typeMnemonic, list<Trait> traits = []>
    : TypeDef<Warp_Dialect, name, traits> {
  let mnemonic = typeMnemonic;
  let genVerifyDecl = 1;
}

def Warp_VecType : Warp_Type<"Vec", "vec"> {
  let summary = "vector of a fixed number of scalars";
  let description = [{
    A value of `length` scalars, such as `!warp.vec<3 x f32>`.

    (C1) `length` is 1 to 65536. (C2) the element type is a scalar.
  }];
  let parameters = (ins "int64_t":$length, "::mlir::Type":$elementType);
  let assemblyFormat = "`<` $length `x` custom<Nested>($elementType) `>`";
}

def Warp_MatType : Warp_Type<"Mat", "mat"> {
  let summary = "row-major matrix of a fixed shape";
  let description = [{
    A value of `rows` times `cols` scalars, such as `!warp.mat<3x3 x f32>`.

    (C1) there are 1 to 65536 components. (C2) the element type is a scalar.
  }];
  let parameters = (ins "int64_t":$rows, "int64_t":$cols,
                        "::mlir::Type":$elementType);
  let assemblyFormat = 
      "`<` custom<MatShape>($rows, $cols) custom<Nested>($elementType) `>`";
}

def Warp_QuatType : Warp_Type<"Quat", "quat"> {
  let summary = "quaternion stored as x, y, z, w";
  let description = [{
    (C1) the element type is a floating-point scalar.
  }];
  let parameters = (ins "::mlir::Type":$elementType);
  let assemblyFormat = "`<` custom<Nested>($elementType) `>`";
}

def Warp_TransformType : Warp_Type<"Transform", "transform"> {
  let summary = "rigid transform: a translation, then a quaternion";
  let description = [{
    Seven scalars: the translation x, y, z and the rotation x, y, z, w.

    (C1) the element type is a floating-point scalar.
  }];
  let parameters = (ins "::mlir::Type":$elementType);
  let assemblyFormat = "`<` custom<Nested>($elementType) `>`";
}

def Warp_ArrayType : Warp_Type<"Array", "array"> {
  let summary = "strided array of rank 1 to 4 in device memory";
  let description = [{
    A descriptor: data pointer, extents and strides in bytes. Copies of the
    descriptor refer to the same memory.

    (C1) the rank is 1 to 4. (C2) the element type is a scalar, a vector, a
    matrix, a quaternion, a transform or a struct.
  }];
  let parameters = (ins "int64_t":$rank, "::mlir::Type":$elementType);
  let assemblyFormat = "`<` $rank `x` custom<Nested>($elementType) `>`";
}

def Warp_StructType : Warp_Type<"Struct", "struct"> {
  let summary = "named aggregate with C layout";
  let description = [{
    A value of named fields, such as
    `!warp.struct<"Particle", {x: !warp.vec<3 x f32>, mass: f32}>`.

    (C1) field names are unique and not empty. (C2) a field is a scalar, a
    composite, an array or a struct. (C3) there are at most
    65536 components, and structs nest at most 64 deep.
  }];
  let parameters = (ins StringRefParameter<"the Python name">:$name,
                        ArrayRefParameter<"::mlir::StringAttr">:$fieldNames,
                        ArrayRefParameter<"::mlir::Type">:$fieldTypes);
  let hasCustomAssemblyFormat = 1;
  let extraClassDeclaration = [{
    /// Index of a field, or -1.
    int64_t getFieldIndex(::llvm::StringRef field) const;
  }];
}

// Type constraints; the predicates are declared in WarpTypes.h.

def Warp_Scalar : Type<CPred<"::warp::isScalar($_self)">,
                       "a boolean, integer or float">;
def Warp_Integer : Type<CPred<"::warp::isInteger($_self)">,
                        "a signed or unsigned integer">;
def Warp_ThreadScalar : Type<CPred<"::warp::isThreadScalar($_self)">,
                             "a boolean, integer or float">;
def Warp_Composite : Type<CPred<"::warp::isComposite($_self)">,
                          "a vector, matrix, quaternion or transform">;
def Warp_Value : Type<CPred<"::warp::isValue($_self)">,
                      "a scalar, composite, array or struct">;
def Warp_Element : Type<CPred<"::warp::isArrayElement($_self)">,
                        "a scalar, composite or struct">;
def Warp_AnyArray : Type<CPred<"::llvm::isa<::warp::ArrayType>($_self)">,
                         "a warp array">;
def Warp_AnyStruct : Type<CPred<"::llvm::isa<::warp::StructType>($_self)">,
                          "a warp struct">;

#endif // WARP_TYPES_TD
