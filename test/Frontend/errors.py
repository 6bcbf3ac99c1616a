# RUN: %python %s | FileCheck %s
"""An error shows the place with a caret under the whole expression, and the fix."""

import warp as wp
from warp._src.frontend.build import build_kernel


def show(kernel):
    try:
        build_kernel(kernel)
        print("accepted")
    except wp.WarpCodegenError as error:
        print(error)


@wp.kernel
def mixes(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = (i * 2) + x[i]


# CHECK: errors.py:[[#@LINE-3]]:12: {{.*}}(int32, float32)
# CHECK-NEXT: {{^}}    x[i] = (i * 2) + x[i]
# CHECK-NEXT: {{^}}           ^~~~~~~~~~~~~~
# CHECK-NEXT: note: overloads:
# CHECK: hint: use `float(...)` for operand 1
show(mixes)


@wp.kernel
def misspelled(x: wp.array(dtype=float)):
    value = x[0]
    x[1] = vallue


# CHECK: errors.py:[[#@LINE-3]]:12: 'vallue' is not defined
# CHECK-NEXT: {{^}}    x[1] = vallue
# CHECK-NEXT: {{^}}           ^~~~~~
# CHECK-NEXT: hint: did you mean `value`?
show(misspelled)


@wp.kernel
def changes(x: wp.array(dtype=float), n: int):
    s = int(0)
    for i in range(n):
        s = x[i]


# CHECK: errors.py:[[#@LINE-3]]:9: 's' is 'int32' and cannot become 'float32'
# CHECK-NEXT: {{^}}    s = x[i]
# CHECK-NEXT: {{^}}    ^~~~~~~~
# CHECK-NEXT: note: 's' is 'int32' at line [[#@LINE-8]]
show(changes)


@wp.kernel
def branches(x: wp.array(dtype=float)):
    if x[0] > 0.0:
        a = 1
    else:
        a = 2.0
    x[1] = float(a)


# CHECK: errors.py:[[#@LINE-7]]:5: 'a' is 'int32' in one branch and 'float32' in the other
# CHECK: note: 'a' is 'int32' at line [[#@LINE-7]]
# CHECK-NEXT: note: 'a' is 'float32' at line [[#@LINE-6]]
# CHECK-NEXT: hint: use `float(...)`
show(branches)


@wp.kernel
def out_of_range():
    v = wp.vec3(1.0, 2.0, 3.0)
    a = v[3]


# CHECK: errors.py:[[#@LINE-3]]:9: index 3 is out of range for 'vec3f' with 3 elements
# CHECK-NEXT: {{^}}    a = v[3]
# CHECK-NEXT: {{^}}        ^~~~
show(out_of_range)


@wp.kernel
def too_large():
    a = 5000000000


# CHECK: errors.py:[[#@LINE-3]]:9: integer 5000000000 does not fit 'int32'
# CHECK: hint: use `wp.int64(5000000000)`
show(too_large)


@wp.func
def ping(x: float):
    return pong(x)


@wp.func
def pong(x: float):
    return ping(x)


@wp.kernel
def recursive(x: wp.array(dtype=float)):
    x[0] = ping(x[0])


# CHECK: errors.py:[[#@LINE-8]]:12: recursion is not supported in kernels: ping -> pong -> ping
# CHECK: note: called from 'ping' at
# CHECK: note: called from 'recursive' at
show(recursive)
