"""Messages where a package that arrays are exchanged with is not installed."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys

sys.modules[{package!r}] = None
import warp as wp

x = wp.zeros(3, dtype=float, device="cpu")
try:
    {call}
except ImportError as error:
    print(error)
"""


@pytest.mark.parametrize("call", ["wp.to_torch(x)", "wp.stream_from_torch()", "wp.to_jax(x)"])
def test_message_has_the_command(call):
    package = "torch" if "torch" in call else "jax"
    title = {"torch": "PyTorch", "jax": "JAX"}[package]
    program = PROGRAM.format(package=package, call=call)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == (
        f"exchange with {title} needs the package '{package}': pip install \"warp-mlir[{package}]\""
    )


@pytest.mark.parametrize(
    ("package", "call", "command"),
    [
        ("PIL", "import warp.render; wp.render.save_picture('a.jpg', [[0.5]])", "pillow"),
        ("meshio", "import warp.fem; wp.fem.read_mesh('a.msh')", "meshio"),
        ("pxr", "import warp.render; wp.render.UsdRenderer('a.usd')", "usd-core"),
        ("trimesh", "import warp.render; wp.render.load_mesh('a.obj')", "trimesh"),
        ("imageio_ffmpeg", "wp.render.save_movie('a.mp4', [[[0.5]]])", "imageio-ffmpeg"),
    ],
)
def test_files_name_the_package_of_their_format(tmp_path, package, call, command):
    program = PROGRAM.format(package=package, call=call)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].endswith(f"'{command}': pip install {command}")


def test_report_says_so_before_it_measures():
    program = (
        "import importlib.util as u, runpy, sys\n"
        "find = u.find_spec\n"
        "u.find_spec = lambda name, *rest: None if name == 'matplotlib' else find(name, *rest)\n"
        "sys.argv = ['report', '--quick']\n"
        "runpy.run_module('warp.report', run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == 'figures need matplotlib: run `pip install "warp-mlir[report]"`\n'
