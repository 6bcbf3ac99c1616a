# RUN: %python %s | FileCheck %s
"""Loops and branches carry what is assigned in them and read later, and nothing else."""

import warp as wp
from warp._src.frontend.build import build_kernel


# `t` is dead after the loop and assigned before it is read: not carried.
# CHECK-LABEL: func.func @only_live
# CHECK: scf.for {{.*}} iter_args(%[[S:.*]] = %{{.*}}) -> (f32) : i32 {
# CHECK: %[[T:.*]] = warp.mul
# CHECK: %[[N:.*]] = warp.add(%[[S]], %[[T]])
# CHECK-NEXT: scf.yield %[[N]] : f32
@wp.kernel
def only_live(x: wp.array(dtype=float), n: int):
    s = float(0.0)
    for i in range(n):
        t = x[i] * 2.0
        s += t
    x[0] = s


# Storing to an element does not carry the array.
# CHECK-LABEL: func.func @arrays_stay
# CHECK: scf.for %{{.*}} = %{{.*}} to %{{.*}} step %{{.*}} : i32 {
# CHECK: warp.store
# CHECK-NEXT: }
@wp.kernel
def arrays_stay(x: wp.array(dtype=float), n: int):
    for i in range(n):
        x[i] = 1.0


# A name first assigned inside keeps its value from iteration to iteration, zero at first.
# CHECK-LABEL: func.func @first_assigned_inside
# CHECK-DAG: %[[ZERO:.*]] = warp.constant 0.0{{.*}} : f32
# CHECK: %[[R:.*]] = scf.for {{.*}} iter_args(%[[Z:.*]] = %[[ZERO]]) -> (f32) : i32 {
# CHECK: scf.if %{{.*}} -> (f32) {
# CHECK: } else {
# CHECK-NEXT: scf.yield %[[Z]]
# CHECK: warp.store %[[R]]
@wp.kernel
def first_assigned_inside(x: wp.array(dtype=float), n: int):
    for i in range(n):
        if x[i] > 1.0:
            z = x[i]
    x[0] = z


# A component assignment makes a new vector, carried like any other value.
# CHECK-LABEL: func.func @component
# CHECK: scf.for {{.*}} -> (!warp.vec<3 x f32>) : i32 {
# CHECK: warp.extract
# CHECK: %[[V:.*]] = warp.insert
# CHECK-NEXT: scf.yield %[[V]] : !warp.vec<3 x f32>
@wp.kernel
def component(x: wp.array(dtype=wp.vec3), n: int):
    v = wp.vec3()
    for _ in range(n):
        v.y += 1.0
    x[0] = v


# A negative step counts trips from zero.
# CHECK-LABEL: func.func @down
# CHECK: scf.for unsigned %[[T:.*]] = %{{.*}} to %{{.*}} step
# CHECK: %[[C:.*]] = warp.cast %[[T]] : i32 to si32
# CHECK: %[[O:.*]] = warp.mul(%[[C]]
# CHECK: warp.add(%{{.*}}, %[[O]])
@wp.kernel
def down(x: wp.array(dtype=float), n: int):
    for i in range(n, 0, -1):
        x[i] = 1.0


for kernel in (only_live, arrays_stay, first_assigned_inside, component, down):
    print(build_kernel(kernel).text())
