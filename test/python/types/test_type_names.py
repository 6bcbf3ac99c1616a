"""`__name__` of a type is a name of this package, or that of its family."""

import itertools
import typing

import pytest

import warp as wp

SCALARS = (wp.bool, wp.int8, wp.uint16, wp.int32, wp.uint64, wp.float16, wp.bfloat16, wp.float32)


def made():
    for dtype, n in itertools.product((*SCALARS, wp.float64), (1, 2, 3, 4, 5, 6, 9)):
        yield wp.types.vector(n, dtype), "vec_t"
        yield wp.types.matrix((n, 4), dtype), "mat_t"
        yield wp.types.matrix((3, n), dtype), "mat_t"
    for dtype in (wp.float16, wp.bfloat16, wp.float32, wp.float64):
        yield wp.types.quaternion(dtype), "quat_t"
        yield wp.types.transformation(dtype), "transform_t"


def test_annotations_are_shown_as_programs_write_them():
    spaces = {"wp": wp, "Any": typing.Any, "Literal": typing.Literal}
    kinds = (wp.array, wp.indexedarray, wp.fabricarray, wp.indexedfabricarray)
    written = [wp.array2d[wp.vec3], wp.array4d[wp.uint32], wp.array[typing.Any]]
    written += [kind[dtype] for dtype in (*SCALARS, *(one for one, _ in made())) for kind in kinds]
    written += [kind[float, typing.Any] for kind in kinds]
    written += [kind[wp.mat22, typing.Literal[2]] for kind in kinds]
    for annotation in written:
        assert eval(repr(annotation), spaces) == annotation, annotation
    assert [repr(one) for one in written[:3]] == [
        "wp.array2d[wp.vec3f]",
        "wp.array4d[wp.uint32]",
        "wp.array[Any]",
    ]


def test_names_lead_back():
    """Programs write a name to a file, and look it up unless it is that of a family."""
    families = 0
    for kind, family in made():
        if kind.__name__ == family:
            families += 1
            assert kind._wp_generic_type_str_ == family
        else:
            assert getattr(wp, kind.__name__) is kind
    assert families > 60


@pytest.mark.parametrize(
    "name",
    ["vec3f", "vec2ub", "vec4d", "mat22f", "mat44d", "quath", "transformd", "spatial_vectorf"],
)
def test_types_of_this_package(name):
    kind = getattr(wp, name)
    assert kind.__name__ == name
    assert wp.types.vector(3, float).__name__ == "vec3f"


def test_messages_tell_sizes():
    five = wp.types.vector(5, float)
    assert repr(five(1.0)) == "vec5f([1.0, 1.0, 1.0, 1.0, 1.0])"
    assert repr(wp.types.matrix((1, 2), int)(3)) == "mat12i([3, 3])"
    assert repr(wp.zeros(2, dtype=five, device="cpu").dtype()) == repr(five())
    assert "[wp.types.vector(length=5, dtype=wp.float32)]" in repr(wp.array(dtype=five))
    with pytest.raises(TypeError, match="index of 'vec5f'"):
        five()["a"]
    with pytest.raises(ValueError, match="5 components for 'vec5f'"):
        five(1.0, 2.0)

    class Named(five):
        pass

    assert repr(Named()).startswith("Named(")
