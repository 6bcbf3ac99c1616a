"""Views of arrays, kernels, meshes and volumes in notebooks."""

import xml.etree.ElementTree as ElementTree

import numpy as np

import warp as wp


@wp.kernel
def twice(x: wp.array(dtype=float), a: float):
    i = wp.tid()
    x[i] = a * x[i]


def text_of(thing):
    """The words of the HTML, which is well-formed."""
    tree = ElementTree.fromstring(f"<div>{thing._repr_html_()}</div>".replace("<br>", "<br/>"))
    return " ".join(tree.itertext()), tree


def test_arrays(device):
    x = wp.array(np.arange(20).reshape(2, 10), dtype=float, device=device, requires_grad=True)
    text, _ = text_of(x)
    for word in ("(2, 10)", "float", str(x.device), "0.0, 1.0, 2.0", "...", "gradient"):
        assert word in text
    assert "begins" not in text_of(wp.zeros((3, 0), dtype=wp.vec3, device=device))[0]


def test_kernels():
    x = wp.zeros(100, dtype=float, device="cpu")
    with wp.ScopedDevice("cpu"):
        wp.launch(twice, 100, [x, 2.0])
        text, _ = text_of(twice)
    assert "twice(x" in text and "a: float" in text and "lanes" in text


def test_meshes_and_volumes(device):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    indices = wp.array([0, 1, 2, 0, 1, 3, 1, 2, 3, 0, 2, 3], dtype=int, device=device)
    mesh = wp.Mesh(wp.array(points, dtype=wp.vec3, device=device), indices)
    text, tree = text_of(mesh)
    assert "faces 4" in text.replace("faces4", "faces 4") and len(tree.findall(".//path")) == 4
    volume = wp.Volume.load_from_numpy(np.ones((4, 4, 4)), voxel_size=0.5, device=device)
    text, _ = text_of(volume)
    assert "float32" in text and "0.5" in text
