"""`warp.render.UsdRenderer`: what a simulation shows, as a USD stage with one sample per frame.

Every shape is a prim below `/root`, which scales the scene, or below the prim of a body. It is made
when it is first drawn; each time it is drawn again it gets samples at the frame's time. Schemas:
UsdGeom of OpenUSD.
"""

from __future__ import annotations

from warp._src.render.shapes import Shapes
from warp.extend import checked, errors
from warp.extend.kinds import NUMBER, TEXT

_ROOT = "/root"
_TEMPLATES = "/_templates"


def load():
    """The modules of USD.

    Raises:
        ImportError: they are not installed.
    """
    try:
        from pxr import Gf, Sdf, Tf, Usd, UsdGeom, Vt
    except ImportError as problem:
        raise errors.absent("usd-core", "writing USD") from problem

    class Modules:
        """The used names, with their values."""

    found = {"Gf": Gf, "Sdf": Sdf, "Tf": Tf, "Usd": Usd, "UsdGeom": UsdGeom, "Vt": Vt}
    for name, module in found.items():
        setattr(Modules, name, module)
    return Modules


class UsdRenderer(Shapes):
    """Writes shapes, meshes, lines and points to a USD stage, frame by frame.

    Args:
        stage: path of the file to write, or a `Usd.Stage`.
        up_axis: axis that points up: "X", "Y" or "Z".
        fps: frames per second.
        scaling: factor of all lengths.

    Positions are three numbers, rotations quaternions (x, y, z, w). Arrays may be of Warp, NumPy or
    lists; those of Warp are copied to the host. Methods that draw return the path of the prim.

    Raises:
        ImportError: the package usd-core is not installed.
        ValueError: there is no such axis.

    Example:
        >>> import warp as wp
        >>> renderer = wp.render.UsdRenderer("points.usda")  # doctest: +SKIP
        >>> for frame in range(60):  # doctest: +SKIP
        ...     renderer.begin_frame(frame / 60.0)
        ...     renderer.render_points("points", positions, radius=0.1)
        ...     renderer.end_frame()
        >>> renderer.save()  # doctest: +SKIP
    """

    @checked(up_axis=TEXT, fps=NUMBER, scaling=NUMBER)
    def __init__(self, stage, up_axis="Y", fps=60, scaling=1.0):
        self.usd = usd = load()
        self.up_axis = str(up_axis).upper()
        if self.up_axis not in ("X", "Y", "Z"):
            raise ValueError(f"expects 'X', 'Y' or 'Z' as up_axis, but got {up_axis!r}")
        self.stage = stage if isinstance(stage, usd.Usd.Stage) else _new_stage(usd, stage)
        self.fps = fps
        self.scaling = scaling
        # The frame's time code.
        self.time = 0.0
        # Shapes that were drawn, by path, and what was last said of their visibility.
        self._drawn: dict = {}
        self._shown: dict = {}
        self.root = usd.UsdGeom.Xform.Define(self.stage, _ROOT)
        self.root.ClearXformOpOrder()
        self.root.AddScaleOp().Set(usd.Gf.Vec3d(scaling, scaling, scaling))
        self.stage.SetDefaultPrim(self.root.GetPrim())
        self.stage.SetStartTimeCode(0.0)
        self.stage.SetEndTimeCode(0.0)
        self.stage.SetTimeCodesPerSecond(fps)
        self.stage.SetFramesPerSecond(fps)
        usd.UsdGeom.SetStageUpAxis(self.stage, self.up_axis)

    def begin_frame(self, time) -> None:
        """Starts the frame at a time in seconds."""
        self.time = round(float(time) * self.fps)
        if self.time > self.stage.GetEndTimeCode():
            self.stage.SetEndTimeCode(self.time)

    def end_frame(self) -> None:
        """Ends the frame."""

    def save(self) -> None:
        """Writes the file.

        Raises:
            RuntimeError: it cannot be written.
        """
        try:
            self.stage.GetRootLayer().Save()
        except self.usd.Tf.ErrorException as problem:
            raise RuntimeError(f"the USD stage cannot be written: {problem}") from None

    def clear(self) -> None:
        """Removes all that was drawn."""
        for path in list(self._drawn):
            self.stage.RemovePrim(path)
        self._drawn.clear()
        self._shown.clear()

    def register_body(self, body_name) -> None:
        """Makes a body, which shapes can be parts of (`parent_body`)."""
        self._posed(f"{_ROOT}/{self._name(body_name)}")

    def add_shape_instance(
        self,
        name,
        shape,
        body,
        pos,
        rot,
        scale=(1.0, 1.0, 1.0),
        color1=None,
        color2=None,
        custom_index=-1,
        visible=True,
    ):
        """Draws a shape that was made with `is_template=True`.

        Args:
            name: of the instance.
            shape: path of the template.
            body: of which it is a part, or None.
            pos, rot, scale: pose.
            color1: colour, by default that of the template; `color2` and `custom_index` are
                accepted and change nothing.
        """
        path = self._path(name, body)
        if path not in self._drawn:
            # Without a type of its own it has that of the template.
            self.stage.DefinePrim(path).GetReferences().AddInternalReference(shape)
            self._pose(path, self.usd.UsdGeom.Imageable(self.stage.GetPrimAtPath(path)))
        self._place(path, pos, rot, scale, visible)
        if color1 is not None:
            target = self.stage.GetPrimAtPath(path)
            self._color(self.usd.UsdGeom.Gprim(target), color1)
        return path

    # The parts of shapes.

    def _name(self, name) -> str:
        return self.usd.Tf.MakeValidIdentifier(str(name))

    def _path(self, name, parent_body=None, is_template=False) -> str:
        """The path of a shape; characters that USD does not allow become underscores."""
        if is_template:
            if not self.stage.GetPrimAtPath(_TEMPLATES):
                self.stage.CreateClassPrim(_TEMPLATES)
            return f"{_TEMPLATES}/{self._name(name)}"
        if parent_body is None:
            return f"{_ROOT}/{self._name(name)}"
        body = f"{_ROOT}/{self._name(parent_body)}"
        if body not in self._drawn:
            self._posed(body)
        return f"{body}/{self._name(name)}"

    def _posed(self, path, schema=None):
        """A prim with a pose: translation, rotation and scale."""
        made = (schema or self.usd.UsdGeom.Xform).Define(self.stage, path)
        return self._pose(path, made)

    def _pose(self, path, made):
        """Gives a prim translation, rotation and scale, and remembers it."""
        pose = self.usd.UsdGeom.Xformable(made)
        pose.ClearXformOpOrder()
        operations = (pose.AddTranslateOp(), pose.AddOrientOp(), pose.AddScaleOp())
        self._drawn[path] = made, operations
        return made

    def _drawn_as(self, path, schema):
        """The prim at a path, and whether it is new."""
        known = self._drawn.get(path)
        if known is not None:
            return known[0], False
        return self._posed(path, schema), True

    def _place(self, path, pos=None, rot=None, scale=None, visible=True) -> None:
        """Samples of the pose at the frame's time; parts that are None stay as they are."""
        gf, (made, (move, turn, size)) = self.usd.Gf, self._drawn[path]
        if pos is not None:
            move.Set(gf.Vec3d(*map(float, pos)), self.time)
        if rot is not None:
            x, y, z, w = map(float, rot)
            turn.Set(gf.Quatf(w, x, y, z), self.time)
        if scale is not None:
            size.Set(gf.Vec3f(*map(float, scale)), self.time)
        if visible != self._shown.get(path, True):
            self._shown[path] = visible
            word = self.usd.UsdGeom.Tokens.inherited if visible else "invisible"
            made.GetVisibilityAttr().Set(word, self.time)

    def _color(self, made, color) -> None:
        """One colour for a shape."""
        if color is not None:
            value = self.usd.Vt.Vec3fArray([self.usd.Gf.Vec3f(*map(float, color))])
            made.CreateDisplayColorAttr().Set(value, self.time)


def _new_stage(usd, path):
    try:
        return usd.Usd.Stage.CreateNew(str(path))
    except usd.Tf.ErrorException as problem:
        raise ValueError(f"no USD stage can be made at '{path}': {problem}") from None
