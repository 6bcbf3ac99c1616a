"""Runs under this package and under NVIDIA Warp: python peer_program.py out.npz [device]

Fills arrays by kernels and saves them by name, for test_peer_semantics.py to compare.
"""

import sys

import numpy as np

import warp as wp

if hasattr(wp.config, "quiet"):
    wp.config.quiet = True
DEVICE = sys.argv[2] if len(sys.argv) > 2 else "cpu"
N = 512
rng = np.random.default_rng(99)
SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, -1.5, 2.5, -2.5, np.inf, -np.inf, np.nan]
FLOATS = np.concatenate([SPECIAL, rng.normal(0.0, 3.0, N - len(SPECIAL))]).astype(np.float32)
OTHERS = rng.permutation(FLOATS)
FINITE = rng.normal(0.0, 3.0, (N, 3)).astype(np.float32)
INTS = rng.integers(-50, 50, N).astype(np.int32)
NONZERO = np.where(rng.integers(0, 2, N) == 1, 1, -1) * rng.integers(1, 9, N)
results = {}


def array(data, dtype):
    return wp.array(data, dtype=dtype, device=DEVICE)


def record(kernel, inputs, **outputs):
    """Launch over N threads; keep each output, given as name=dtype."""
    arrays = {name: wp.zeros(N, dtype=dtype, device=DEVICE) for name, dtype in outputs.items()}
    wp.launch(kernel, N, inputs, list(arrays.values()), device=DEVICE)
    results.update({name: a.numpy() for name, a in arrays.items()})


@wp.kernel
def integers(
    a: wp.array(dtype=int),
    b: wp.array(dtype=int),
    int_div: wp.array(dtype=int),
    int_floordiv: wp.array(dtype=int),
    int_mod: wp.array(dtype=int),
    int_shift: wp.array(dtype=int),
    int_bits: wp.array(dtype=int),
    int_sign: wp.array(dtype=int),
):
    i = wp.tid()
    x = a[i]
    y = b[i]
    int_div[i] = x / y
    int_floordiv[i] = x // y
    int_mod[i] = x % y
    int_shift[i] = (x << 3) + (x >> 2)
    int_bits[i] = (x & y) + (x | y) * 3 + (x ^ y) * 5 + ~x
    int_sign[i] = wp.sign(x) + wp.abs(x) * 4 + wp.min(x, y) * 100 + wp.clamp(x, -10, y + 10) * 1000


@wp.kernel
def floats(
    a: wp.array(dtype=float),
    b: wp.array(dtype=float),
    min_max: wp.array(dtype=wp.vec2),
    rounding: wp.array(dtype=wp.vec4),
    floor_ceil: wp.array(dtype=wp.vec3),
    signs: wp.array(dtype=wp.vec4),
    remainder: wp.array(dtype=wp.vec2),
    blend: wp.array(dtype=wp.vec2),
    clamped: wp.array(dtype=float),
    tests: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    x = a[i]
    y = b[i]
    min_max[i] = wp.vec2(wp.min(x, y), wp.max(x, y))
    rounding[i] = wp.vec4(wp.round(x), wp.rint(x), wp.trunc(x), wp.frac(x))
    floor_ceil[i] = wp.vec3(wp.floor(x), wp.ceil(x), -x)
    signs[i] = wp.vec4(wp.sign(x), wp.step(x), wp.nonzero(x), wp.copysign(2.0, x))
    remainder[i] = wp.vec2(x % y, x // y)
    blend[i] = wp.vec2(wp.lerp(x, y, 0.3), wp.smoothstep(-1.0, 2.0, x))
    clamped[i] = wp.clamp(x, -1.25, 1.25)
    tests[i] = wp.vec3(float(wp.isnan(x)), float(wp.isinf(x)), float(wp.isfinite(x)))


@wp.kernel
def clamped_domains(a: wp.array(dtype=wp.vec3), inverse_trig: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    x = a[i][0]
    inverse_trig[i] = wp.vec3(wp.asin(x), wp.acos(x), wp.atan2(x, a[i][1]))


@wp.kernel
def vectors(
    a: wp.array(dtype=wp.vec3),
    mat_row_major: wp.array(dtype=wp.mat33),
    skew_matrix: wp.array(dtype=wp.mat33),
    products: wp.array(dtype=wp.vec3),
    picks: wp.array(dtype=wp.vec4),
    zero_normal: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    v = a[i]
    m = wp.mat33(v[0], 1.0, 2.0, 3.0, v[1], 4.0, 5.0, 6.0, v[2])
    mat_row_major[i] = m * wp.transpose(m) + wp.outer(v, wp.vec3(1.0, 2.0, 3.0))
    skew_matrix[i] = wp.skew(v)
    products[i] = m * v + wp.cw_mul(v, v) + wp.cw_div(v, wp.vec3(2.0, 4.0, 8.0))
    picks[i] = wp.vec4(
        float(wp.argmin(v)), float(wp.argmax(v)), wp.ddot(m, m), wp.dot(m[1], v) + wp.trace(m)
    )
    zero_normal[i] = wp.normalize(wp.vec3(0.0, 0.0, 0.0)) + wp.inverse(wp.mat33()) * v


@wp.kernel
def quaternions(
    a: wp.array(dtype=wp.vec3),
    product: wp.array(dtype=wp.quat),
    rpy: wp.array(dtype=wp.quat),
    slerp: wp.array(dtype=wp.quat),
    from_matrix: wp.array(dtype=wp.quat),
    axis_angle: wp.array(dtype=wp.vec4),
    rotated: wp.array(dtype=wp.vec3),
    matrix: wp.array(dtype=wp.mat33),
    identity: wp.array(dtype=wp.quat),
):
    i = wp.tid()
    v = a[i]
    p = wp.quat_from_axis_angle(wp.normalize(v), v[0])
    q = wp.normalize(wp.quat(v[1], v[2], v[0], 0.7))
    product[i] = p * q
    rpy[i] = wp.quat_rpy(v[0] * 0.3, v[1] * 0.3, v[2] * 0.3)
    slerp[i] = wp.quat_slerp(p, q, 0.25)
    from_matrix[i] = wp.quat_from_matrix(wp.quat_to_matrix(q))
    axis, angle = wp.quat_to_axis_angle(q)
    axis_angle[i] = wp.vec4(axis[0], axis[1], axis[2], angle)
    rotated[i] = wp.quat_rotate(q, v) + wp.quat_rotate_inv(p, v)
    matrix[i] = wp.quat_to_matrix(p)
    identity[i] = wp.quat_identity() * wp.quat_inverse(q)


@wp.kernel
def transforms(
    a: wp.array(dtype=wp.vec3), moved: wp.array(dtype=wp.vec3), pose: wp.array(dtype=wp.transform)
):
    i = wp.tid()
    v = a[i]
    t = wp.transform(v, wp.quat_from_axis_angle(wp.vec3(0.0, 1.0, 0.0), v[0]))
    s = wp.transform(v * 2.0, wp.quat_identity())
    moved[i] = wp.transform_point(t, v) + wp.transform_vector(wp.transform_inverse(t), v)
    pose[i] = wp.transform_multiply(t, s)


@wp.kernel
def randoms(
    uniform: wp.array(dtype=float),
    ranged: wp.array(dtype=float),
    normal: wp.array(dtype=float),
    integer: wp.array(dtype=int),
    bounded: wp.array(dtype=int),
    raw: wp.array(dtype=wp.uint32),
    seeded: wp.array(dtype=wp.uint32),
):
    i = wp.tid()
    state = wp.rand_init(i * 7919)
    other = wp.rand_init(42, i)
    uniform[i] = wp.randf(state)
    ranged[i] = wp.randf(state, -3.0, 5.0)
    normal[i] = wp.randn(state)
    integer[i] = wp.randi(state)
    bounded[i] = wp.randi(state, -7, 100)
    raw[i] = wp.randu(other)
    seeded[i] = other


record(
    integers,
    [array(INTS, int), array(NONZERO.astype(np.int32), int)],
    int_div=int,
    int_floordiv=int,
    int_mod=int,
    int_shift=int,
    int_bits=int,
    int_sign=int,
)
record(
    floats,
    [array(FLOATS, float), array(OTHERS, float)],
    min_max=wp.vec2,
    rounding=wp.vec4,
    floor_ceil=wp.vec3,
    signs=wp.vec4,
    remainder=wp.vec2,
    blend=wp.vec2,
    clamped=float,
    tests=wp.vec3,
)
finite = array(FINITE, wp.vec3)
record(clamped_domains, [finite], inverse_trig=wp.vec3)
record(
    vectors,
    [finite],
    mat_row_major=wp.mat33,
    skew_matrix=wp.mat33,
    products=wp.vec3,
    picks=wp.vec4,
    zero_normal=wp.vec3,
)
record(
    quaternions,
    [finite],
    product=wp.quat,
    rpy=wp.quat,
    slerp=wp.quat,
    from_matrix=wp.quat,
    axis_angle=wp.vec4,
    rotated=wp.vec3,
    matrix=wp.mat33,
    identity=wp.quat,
)
record(transforms, [finite], moved=wp.vec3, pose=wp.transform)
record(
    randoms,
    [],
    uniform=float,
    ranged=float,
    normal=float,
    integer=int,
    bounded=int,
    raw=wp.uint32,
    seeded=wp.uint32,
)
np.savez(sys.argv[1], **results)
