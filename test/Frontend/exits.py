# RUN: %python %s | FileCheck %s
"""break, continue and early return become flags, and only where something must test them."""

import warp as wp
from warp._src.frontend.build import build_kernel


# A branch that always leaves takes the rest of the body into the other branch: no flag.
# CHECK-LABEL: func.func @guard
# CHECK: %[[I:.*]] = warp.tid
# CHECK: %[[OUT:.*]] = warp.ge(%[[I]], %{{.*}})
# CHECK: scf.if %[[OUT]] {
# CHECK-NEXT: } else {
# CHECK-NEXT: warp.store
# CHECK-NEXT: }
# CHECK-NEXT: return
@wp.kernel
def guard(x: wp.array(dtype=float), n: int):
    i = wp.tid()
    if i >= n:
        return
    x[i] = 1.0


# The results of a function's returns merge; nothing else is carried.
# CHECK-LABEL: func.func @choose
# CHECK: call @clamp_low
# CHECK-LABEL: func.func private @clamp_low
# CHECK: %[[R:.*]] = scf.if %{{.*}} -> (f32) {
# CHECK-NEXT: scf.yield
# CHECK-NEXT: } else {
# CHECK-NEXT: scf.yield
# CHECK-NEXT: }
# CHECK-NEXT: return %[[R]] : f32
@wp.func
def clamp_low(x: float):
    if x < 0.0:
        return 0.0
    return x


@wp.kernel
def choose(x: wp.array(dtype=float)):
    x[0] = clamp_low(x[0])


# `break` makes a loop that counts trips and tests one flag.
# CHECK-LABEL: func.func @first_negative
# CHECK: %[[W:.*]]:3 = scf.while
# CHECK: %[[MORE:.*]] = warp.lt
# CHECK: %[[CLEAR:.*]] = warp.unot
# CHECK: %[[GO:.*]] = warp.bit_and(%[[MORE]], %[[CLEAR]])
# CHECK: scf.condition(%[[GO]])
# CHECK: scf.yield
# CHECK: warp.store %[[W]]#2
@wp.kernel
def first_negative(x: wp.array(dtype=float), n: int, out: wp.array(dtype=int)):
    found = int(-1)
    for i in range(n):
        if x[i] < 0.0:
            found = i
            break
    out[0] = found


# `continue` alone keeps the counted loop and carries no flag.
# CHECK-LABEL: func.func @skip_odd
# CHECK: scf.for {{.*}} iter_args(%{{.*}} = %{{.*}}) -> (si32) : i32 {
# CHECK: scf.if %{{.*}} -> (si32) {
@wp.kernel
def skip_odd(n: int, out: wp.array(dtype=int)):
    s = int(0)
    for i in range(n):
        if i % 2 == 1:
            continue
        s += i
    out[0] = s


for kernel in (guard, choose, first_negative, skip_odd):
    print(build_kernel(kernel).text())
