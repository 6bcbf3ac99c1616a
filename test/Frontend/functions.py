# RUN: %python %s | FileCheck %s
"""A function is translated once per combination of argument types."""

from typing import Any

import warp as wp
from warp._src.frontend.build import build_kernel


@wp.func
def square(x: Any):
    return x * x


@wp.func
def both(x: float, y: float = 2.0):
    return square(x), y


# CHECK-LABEL: func.func @calls
# CHECK: call @square(%{{.*}}) : (f32) -> f32
# CHECK: call @square(%{{.*}}) : (f32) -> f32
# CHECK: call @square_1(%{{.*}}) : (si32) -> si32
# CHECK: call @both(%{{.*}}, %{{.*}}) : (f32, f32) -> (f32, f32)
# CHECK: func.func private @square(%{{.*}}: f32) -> f32
# CHECK: func.func private @square_1(%{{.*}}: si32) -> si32
# CHECK: func.func private @both
# CHECK: call @square(
@wp.kernel
def calls(x: wp.array(dtype=float), n: int):
    x[0] = square(x[0])
    x[1] = square(x[1])
    x[2] = float(square(n))
    a, b = both(x[3])
    x[3] = a + b


print(build_kernel(calls).text())
