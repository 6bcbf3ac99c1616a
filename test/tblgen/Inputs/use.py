"""Reports of type checkers about code that uses the package."""

import warp as wp

v = wp.vec3(1.0, 2.0, 3.0)
m = wp.mat33d()

# CHECK: Revealed type is "float"
reveal_type(wp.dot(v, v))
# CHECK: Revealed type is "{{.*}}float64"
reveal_type(wp.determinant(m))
# CHECK: Revealed type is "tuple[{{.*}}_Vec[Literal[3], float], float]"
reveal_type(wp.quat_to_axis_angle(wp.quat(0.0, 0.0, 0.0, 1.0)))
# CHECK: Revealed type is "{{.*}}_Mat[Literal[3], Literal[2], float]"
reveal_type(wp.outer(v, wp.vec2()))
w: wp.vec3 = wp.normalize(v * 2.0 + v)
# CHECK: error: Cannot infer value of type parameter "_n" of "dot"
wp.dot(v, wp.vec2(1.0, 2.0))
# CHECK: error: Argument 1 to "cross" has incompatible type
wp.cross(wp.vec2(), v)
# CHECK: error: {{.*}} "sin"
wp.sin("0.5")
