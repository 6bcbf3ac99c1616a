"""Twelve kernels of modules of their own, launched at a given moment; prints CPU seconds."""

import os
import sys
import time

import warp as wp

wp.config.quiet = True


def make(number):
    @wp.kernel(module="unique")
    def work(x: wp.array(dtype=wp.vec3), m: wp.array(dtype=wp.mat33), y: wp.array(dtype=float)):
        t = wp.tid()
        v = x[t]
        q = wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), float(number) * 0.1)
        s = float(0.0)
        for _ in range(8):
            v = m[t] * wp.quat_rotate(q, v) * 0.5 + wp.vec3(float(number))
            s += wp.sin(v[0]) * wp.exp(-v[1] * v[1]) + wp.length(v)
        wp.atomic_add(y, 0, s)

    return work


x = wp.full(1, wp.vec3(1.0, 2.0, 3.0), dtype=wp.vec3, device="cpu")
m = wp.full(1, wp.identity(n=3, dtype=float), dtype=wp.mat33, device="cpu")
y = wp.zeros(1, dtype=float, device="cpu")
while time.time() < float(sys.argv[1]):
    time.sleep(0.001)
before = os.times()
for number in range(12):
    wp.launch(make(number), 1, [x, m, y], device="cpu")
after = os.times()
print(after.user + after.system - before.user - before.system, float(y.numpy()[0]))
