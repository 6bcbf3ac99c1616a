// RUN: warp-opt %s --split-input-file --warp-lower-composites --canonicalize | FileCheck %s --check-prefix=FOLDED
// RUN: warp-opt %s --split-input-file --warp-lower-math | FileCheck %s --check-prefix=CALLED

// The angle of the origin is not NaN, however late its coordinates are known.
// FOLDED-LABEL: func.func @origin
// FOLDED-DAG: %[[ZERO:.*]] = arith.constant 0.000000e+00 : f32
// FOLDED-DAG: %[[PI:.*]] = arith.constant -3.14159274 : f32
// FOLDED: return %[[ZERO]], %[[PI]]
func.func @origin() -> (f32, f32) {
  %zero = arith.constant 0.0 : f32
  %negative = arith.constant -0.0 : f32
  %two = arith.constant 2.0 : f32
  %y = arith.mulf %two, %zero : f32
  %a = warp.atan2(%y, %zero) : (f32, f32) -> f32
  %b = warp.atan2(%negative, %negative) : (f32, f32) -> f32
  return %a, %b : f32, f32
}

// -----

// The call gets the operands themselves, other selects stay.
// CALLED-LABEL: llvm.func @call
// CALLED-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[C:.*]]: i1)
// CALLED: llvm.call @warp_atan2f(%[[Y]], %[[X]])
// CALLED: %[[CHOSEN:.*]] = arith.select
// CALLED: llvm.call @warp_atan2f(%[[Y]], %[[CHOSEN]])
llvm.func @call(%x: f32, %y: f32, %c: i1)
    attributes {warp.entry, warp.target = "cpu"} {
  %side = math.copysign %y, %x : f32
  %guard = arith.select %c, %side, %x {warp.angle_guard} : f32
  %a = math.atan2 %y, %guard : f32
  %chosen = arith.select %c, %side, %x : f32
  %b = math.atan2 %y, %chosen : f32
  llvm.return
}
