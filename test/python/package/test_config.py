"""Settings: types, choices, environment variables, notices."""

import importlib

import pytest

import warp as wp
from programs import run, write_program
from warp._src.config import SETTINGS


def test_every_setting_has_a_valid_default():
    for setting in SETTINGS.values():
        assert setting.doc and setting.check(setting.default) == setting.default
        assert hasattr(wp.config, setting.name)
    assert dir(wp.config) == sorted(SETTINGS)
    assert importlib.import_module("warp.config") is wp.config
    assert wp.config.version == wp.__version__


@pytest.mark.parametrize(
    "name, value, error",
    [
        ("quiet", "yes", TypeError),
        ("mode", "fast", ValueError),
        ("max_unroll", 2.5, TypeError),
        ("max_unroll", True, TypeError),
        ("max_unroll", None, TypeError),
        ("kernel_cache_dir", 3, TypeError),
        ("quite", True, AttributeError),
    ],
)
def test_bad_values(config, name, value, error):
    with pytest.raises(error, match=name):
        setattr(config, name, value)


def test_unknown_names_get_a_suggestion(config):
    with pytest.raises(AttributeError, match="did you mean 'quiet'"):
        config.quite = True
    with pytest.raises(AttributeError, match="verbos"):
        _ = config.verbos
    with pytest.raises(AttributeError):
        del config.quiet


def test_good_values(config, tmp_path):
    config.quiet = 0
    assert config.quiet is False
    config.mode = "debug"
    config.mode = ""
    assert config.mode == "release"
    config.kernel_cache_dir = tmp_path
    assert config.kernel_cache_dir == str(tmp_path)
    config.optimization_level = None
    config.enable_mathdx_gemm = False


@pytest.mark.parametrize(
    "name, text, expected",
    [
        ("quiet", "1", True),
        ("quiet", "off", False),
        ("max_unroll", "4", 4),
        ("mode", "debug", "debug"),
        ("dump", "/tmp/dump", "/tmp/dump"),
        ("kernel_cache_dir", "", None),
    ],
)
def test_environment(monkeypatch, name, text, expected):
    monkeypatch.delenv("WARP_CACHE_PATH", raising=False)
    monkeypatch.setenv(f"WARP_{name.upper()}", text)
    assert SETTINGS[name].initial() == expected


def test_modes_are_of_their_enumerations():
    """Settings whose values are an enumeration's start as one of them."""
    assert wp.config.launch_array_access_mode is wp.config.LaunchArrayAccessMode.RELAXED


@pytest.mark.parametrize("value", [3, 999, -1, "checked", True, 1.0])
def test_modes_that_there_are_none_of(monkeypatch, value):
    mode = wp.config.launch_array_access_mode
    with pytest.raises((TypeError, ValueError), match="launch_array_access_mode"):
        wp.config.launch_array_access_mode = value
    assert wp.config.launch_array_access_mode is mode
    for one in wp.config.LaunchArrayAccessMode:
        monkeypatch.setattr(wp.config, "launch_array_access_mode", one)
        assert wp.config.launch_array_access_mode is one


@pytest.mark.parametrize("name, text", [("quiet", "maybe"), ("mode", "fast"), ("max_unroll", "x")])
def test_bad_environment(monkeypatch, name, text):
    monkeypatch.setenv(f"WARP_{name.upper()}", text)
    with pytest.raises(ValueError, match=text):
        SETTINGS[name].initial()


PROGRAM = """
import warp as wp
{setting}
wp.init()
a = wp.zeros(3)
"""


def test_standard_output_is_silent():
    status, out, err = run(write_program(PROGRAM, setting=""))
    assert (status, out) == (0, "") and err.startswith("warp-mlir ") and err.count("\n") == 1


@pytest.mark.parametrize(
    "setting, variables", [("wp.config.quiet = True", {}), ("", {"WARP_QUIET": 1})]
)
def test_quiet_switches_notices_off(setting, variables):
    assert run(write_program(PROGRAM, setting=setting), **variables) == (0, "", "")
