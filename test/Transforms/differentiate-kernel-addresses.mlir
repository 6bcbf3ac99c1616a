// RUN: warp-opt %s --warp-differentiate-kernel=active=1 --canonicalize --cse | FileCheck %s --check-prefix=REVERSE
// RUN: warp-opt %s --warp-differentiate-kernel="mode=forward active=1 width=2" --canonicalize --cse | FileCheck %s --check-prefix=FORWARD
// RUN: warp-opt %s --warp-lower-composites --canonicalize | FileCheck %s --check-prefix=PRIMAL

// In reverse mode gradients are added to where the address of gradients says,
// unless it is 0, and atomically, as nobody knows who else adds there.
// REVERSE-LABEL: func.func @scale_adjoint
// REVERSE-SAME: %[[AT:.*]]: ui64, %[[GRAD:.*]]: ui64, %[[N:.*]]: si32
// REVERSE: %[[G:.*]] = warp.load
// REVERSE: %[[THERE:.*]] = warp.ne(%[[GRAD]]
// REVERSE: scf.if %[[THERE]]
// REVERSE-NEXT: %[[GRADS:.*]] = warp.array_at %[[GRAD]][%[[N]]] : ui64
// REVERSE-NEXT: warp.accumulate %{{.*}}, %[[GRADS]][%{{.*}}] :

// In forward mode tangents are read there, those of the second direction behind
// those of the first, or they are zero.
// FORWARD-LABEL: func.func @scale_tangent
// FORWARD-SAME: %[[AT:.*]]: ui64, %[[GRAD:.*]]: ui64, %[[N:.*]]: si32
// FORWARD-DAG: %[[FIRST:.*]] = warp.array_at %[[GRAD]][%[[N]]] : ui64
// FORWARD-DAG: %[[SIZE:.*]] = warp.constant 12 : ui64
// FORWARD-DAG: %[[COUNT:.*]] = warp.cast %[[N]]
// FORWARD-DAG: %[[STEP:.*]] = warp.mul(%[[SIZE]], %[[COUNT]])
// FORWARD-DAG: warp.add(%[[GRAD]], %[[STEP]])
// FORWARD: scf.if
// FORWARD: warp.load %[[FIRST]]
// FORWARD: else
// FORWARD: scf.if

// The kernel itself knows nothing of it.
// PRIMAL-LABEL: func.func @scale(
// PRIMAL-NOT: grad

func.func @scale(%at: ui64, %grad: ui64, %n: si32,
                 %out: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %x = warp.array_at %at[%n] grad(%grad : ui64) : ui64, si32 -> !warp.array<1 x !warp.vec<3 x f32>>
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %s = warp.add(%v, %v) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> !warp.vec<3 x f32>
  warp.store %s, %out[%i] : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32
  return
}
