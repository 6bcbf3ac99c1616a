"""`warp.examples`: a folder that the user names, and what to do where there is none."""

import pytest

import warp as wp
import warp.examples


def test_the_folder_is_that_of_the_variable(tmp_path, monkeypatch):
    folder = tmp_path / "examples" / "assets"
    folder.mkdir(parents=True)
    monkeypatch.setenv("WARP_EXAMPLE_ASSETS", str(folder))
    assert warp.examples.get_asset_directory() == str(folder.resolve())
    assert warp.examples.get_source_directory() == str(folder.parent.resolve())


@pytest.mark.parametrize(
    "value, problem", [(None, "not set"), ("/nowhere/assets", "/nowhere/assets")]
)
def test_without_one_the_error_names_the_variable(value, problem, monkeypatch):
    monkeypatch.delenv("WARP_EXAMPLE_ASSETS", raising=False)
    if value:
        monkeypatch.setenv("WARP_EXAMPLE_ASSETS", value)
    with pytest.raises(wp.WarpError, match=f"WARP_EXAMPLE_ASSETS.*{problem}"):
        warp.examples.get_asset_directory()
