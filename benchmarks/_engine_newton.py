"""Scenes of Newton for benchmarks/_engine_profile.py, as its own examples build them."""

from __future__ import annotations

import numpy as np

import warp as wp

# The solver and the seconds of a substep by scene; explicit integration of the ant's stiff contacts
# needs short ones.
NEWTON = {
    "newton_humanoid": ("SolverMuJoCo", 2.0e-3),
    "newton_ant": ("SolverFeatherstone", 1.0e-4),
    "newton_ant_xpbd": ("SolverXPBD", 2.0e-3),
    "newton_ant_mujoco": ("SolverMuJoCo", 2.0e-3),
    "newton_quadruped": ("SolverXPBD", 1.0e-3),
    "newton_cloth": ("SolverVBD", 2.0e-3),
    "newton_soft": ("SolverVBD", 1.0 / 600.0),
    "newton_mpm": ("SolverImplicitMPM", 4.0e-3),
}


def newton_scene(name: str, worlds: int):
    """A step of two substeps, so that states are where they were, and coordinates."""
    import newton

    solver_name, seconds = NEWTON[name]
    builder = newton.ModelBuilder()
    make = getattr(newton.solvers, solver_name)
    options = OPTIONS.get(name, {})
    if name == "newton_mpm":
        make.register_custom_attributes(builder)
        if wp.get_device().is_cuda:
            # A grid of the same cells in every step, which a graph needs.
            options = {"config": make.Config(grid_type="fixed", max_active_cell_count=1 << 15)}
        else:
            options = {"config": make.Config()}
    elif solver_name == "SolverMuJoCo":
        make.register_custom_attributes(builder)
    BUILDERS.get(name, robots)(builder, name, worlds)
    builder.add_ground_plane()
    if solver_name == "SolverVBD":
        builder.color(include_bending=name == "newton_cloth")
    model = builder.finalize()
    solver = make(model, **options)
    states, control, contacts, collide = [model.state(), model.state()], model.control(), None, None
    if model.joint_count:
        newton.eval_fk(model, model.joint_q, model.joint_qd, states[0])
    if solver_name not in ("SolverMuJoCo", "SolverImplicitMPM"):
        pipeline = newton.CollisionPipeline(model)
        contacts = pipeline.contacts()
        collide = pipeline.collide

    def step():
        for _ in range(2):
            states[0].clear_forces()
            if collide:
                collide(states[0], contacts)
            solver.step(states[0], states[1], control, contacts, seconds)
            states.reverse()

    def result():
        if not model.joint_count:
            array = states[0].particle_q
        else:
            array = states[0].body_q if solver_name == "SolverXPBD" else states[0].joint_q
        return array.numpy().ravel()[:64]

    return step, result


def robots(builder, name: str, worlds: int) -> None:
    """Ants or humanoids, each in a world of its own."""
    import newton.examples

    body = newton.ModelBuilder()
    body.add_mjcf(
        newton.examples.get_asset("nv_humanoid.xml" if "humanoid" in name else "nv_ant.xml"),
        ignore_names=["floor", "ground"],
        xform=wp.transform((0.0, 0.0, 1.0), wp.quat_identity()),
        parse_sites=False,
    )
    builder.replicate(body, worlds)


def quadrupeds(builder, _: str, worlds: int) -> None:
    """The robot of example_basic_urdf, with its drives and armature."""
    import newton.examples

    body = newton.ModelBuilder()
    body.default_joint_cfg.armature = 0.01
    body.default_joint_cfg.target_ke = 2000.0
    body.default_joint_cfg.target_kd = 1.0
    body.default_shape_cfg.mu = 1.0
    body.add_urdf(
        newton.examples.get_asset("quadruped.urdf"),
        xform=wp.transform((0.0, 0.0, 0.7), wp.quat_identity()),
        floating=True,
        enable_self_collisions=False,
        ignore_inertial_definitions=True,
        joint_damping_mode="drive",
    )
    for link in range(body.body_count):
        inertia = np.asarray(body.body_inertia[link], dtype=np.float32).reshape(3, 3)
        body.body_inertia[link] = wp.mat33(inertia + 0.01 * np.eye(3, dtype=np.float32))
    body.joint_q[-12:] = [0.2, 0.4, -0.6, -0.2, -0.4, 0.6, -0.2, 0.4, -0.6, 0.2, -0.4, 0.6]
    body.joint_target_q[-12:] = body.joint_q[-12:]
    builder.replicate(body, worlds)


def cloth(builder, _: str, worlds: int) -> None:
    """A hanging cloth, longer with more worlds."""
    builder.add_cloth_grid(
        pos=wp.vec3(0.0, 0.0, 4.0),
        rot=wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), wp.pi * 0.5),
        vel=wp.vec3(0.0, 0.0, 0.0),
        dim_x=max(8, worlds),
        dim_y=32,
        cell_x=0.1,
        cell_y=0.1,
        mass=0.1,
        fix_left=True,
        edge_ke=1.0e1,
        edge_kd=0.0,
        particle_radius=0.05,
        tri_ke=1.0e3,
        tri_ka=1.0e3,
        tri_kd=1.0e2,
    )


def soft(builder, _: str, worlds: int) -> None:
    """The hanging bars of example_softbody_hanging, a bar for each 16 worlds."""
    for row in range(max(1, worlds // 16)):
        builder.add_soft_grid(
            pos=wp.vec3(0.0, 0.6 * row, 1.0),
            rot=wp.quat_identity(),
            vel=wp.vec3(0.0, 0.0, 0.0),
            dim_x=12,
            dim_y=4,
            dim_z=4,
            cell_x=0.1,
            cell_y=0.1,
            cell_z=0.1,
            density=1.0e3,
            k_mu=1.0e5,
            k_lambda=1.0e5,
            k_damp=1.0e3,
            fix_left=True,
        )


def sand(builder, _: str, worlds: int) -> None:
    """A column of sand, as many particles as 8 for each world, at least 4,096."""
    side = max(16, round((8 * worlds) ** (1 / 3)))
    spacing = 0.05
    builder.add_particle_grid(
        pos=wp.vec3(0.0, 0.0, 0.1),
        rot=wp.quat_identity(),
        vel=wp.vec3(0.0, 0.0, 0.0),
        dim_x=side,
        dim_y=side,
        dim_z=side,
        cell_x=spacing,
        cell_y=spacing,
        cell_z=spacing,
        mass=1000.0 * spacing**3,
        jitter=0.0,
        radius_mean=0.5 * spacing,
    )


BUILDERS = {
    "newton_quadruped": quadrupeds,
    "newton_cloth": cloth,
    "newton_soft": soft,
    "newton_mpm": sand,
}
OPTIONS = {
    "newton_humanoid": {"njmax": 200, "nconmax": 50},
    "newton_ant_mujoco": {"njmax": 100, "nconmax": 30},
    "newton_cloth": {"iterations": 10},
    "newton_soft": {"iterations": 10, "particle_enable_self_contact": False},
}
