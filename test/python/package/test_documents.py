"""The programs printed in the documents run as printed."""

import re
from pathlib import Path

import pytest

import programs

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    "name",
    ["README.md"]
    + [
        f"docs/{page}.md"
        for page in ("guide", "graphs", "differentiation", "extend", "distributed")
    ]
    + [f"docs/{page}.md" for page in ("fem", "geometry", "report", "tiles")],
)
def test_python_blocks_run(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert blocks
    status, out, err = programs.run(programs.write_program("\n\n".join(blocks)))
    assert status == 0, err
    assert out


def test_links_between_documents_lead_somewhere():
    for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        text = path.read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#:]+)\)", text):
            if target.startswith("api/"):  # Written when the site is built.
                continue
            assert (path.parent / target).exists(), f"{path.name} links to {target}"


def test_the_demonstration_runs(tmp_path, device):
    program = ROOT / "examples" / "particles.py"
    status, out, err = programs.run(program, "--quick", "--device", device, "--output", tmp_path)
    assert status == 0, err
    name = device.replace(":", "")
    for picture in (f"fountain_{name}.png", f"work_precision_{name}.png"):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    rows = (tmp_path / f"work_precision_{name}.csv").read_text().splitlines()
    assert len(rows) == 1 + 2 * 2 * 2 * 5
    assert "✗" in out and "| 2.0" in out


@pytest.mark.parametrize(
    "name, options, said",
    [
        ("trajectory", [], "iterations"),
        ("spring_rollout", ["--masses", "8", "--steps", "200"], "equal gradients"),
    ],
)
def test_examples_of_derivatives_run(tmp_path, device, name, options, said):
    program = ROOT / "examples" / f"{name}.py"
    status, out, err = programs.run(program, "--device", device, "--output", tmp_path, *options)
    assert status == 0, err
    assert said in out
    picture = tmp_path / f"{name}_{device.replace(':', '')}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
