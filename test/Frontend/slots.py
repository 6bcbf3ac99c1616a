# RUN: %python %s | FileCheck %s
"""Parts of array elements are stored and updated alone, through a component view."""

import warp as wp
from warp._src.frontend.build import build_kernel


@wp.struct
class Particle:
    position: wp.vec3
    mass: float


# CHECK-LABEL: func.func @slots
# CHECK: %[[I:.*]] = warp.tid
# CHECK: %[[P:.*]] = warp.component_view %[[A:.*]][] field "position"
# CHECK-NEXT: %[[Y:.*]] = warp.component_view %[[P]][%{{.*}}]
# CHECK-NEXT: warp.store %{{.*}}, %[[Y]][%[[I]]]
# CHECK: %[[M:.*]] = warp.component_view %[[A]][] field "mass"
# CHECK-NEXT: warp.atomic add %{{.*}}, %[[M]][%[[I]]]
# CHECK: %[[R:.*]] = warp.component_view {{.*}} -> !warp.array<1 x !warp.vec<3 x f32>>
# CHECK-NEXT: warp.store %{{.*}}, %[[R]][%[[I]]]
# CHECK-NOT: warp.load
@wp.kernel
def slots(p: wp.array(dtype=Particle), m: wp.array(dtype=wp.mat33)):
    i = wp.tid()
    p[i].position.y = 2.0
    p[i].mass += 1.0
    m[i][1] = wp.vec3(1.0, 2.0, 3.0)


# CHECK-LABEL: func.func @updates
# CHECK: warp.atomic add
# CHECK: warp.atomic sub
# CHECK: %[[OLD:.*]] = warp.load
# CHECK: %[[NEW:.*]] = warp.mul(%[[OLD]]
# CHECK: warp.store %[[NEW]]
@wp.kernel
def updates(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] += 1.0
    x[i] -= 2.0
    x[i] *= 3.0


print(build_kernel(slots).text())
print(build_kernel(updates).text())
