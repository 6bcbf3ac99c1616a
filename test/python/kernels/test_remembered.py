"""Results that libraries keep in the kernel cache: found again, made anew, cleared."""

import warp as wp
from warp import extend


def test_a_result_is_made_once(tmp_path):
    old, wp.config.kernel_cache_dir = wp.config.kernel_cache_dir, str(tmp_path)
    try:
        made = []

        def make():
            made.append(1)
            return {"kinds": ("a", 3), "size": len(made)}

        found = [extend.remembered(("numbers", 3), make) for _ in range(3)]
        assert found == [{"kinds": ("a", 3), "size": 1}] * 3
        assert extend.remembered(("numbers", 4), make)["size"] == 2
        assert len(list(tmp_path.glob("*.facts"))) == 2
        # A file of somebody else, or one that is cut off.
        for file in tmp_path.glob("*.facts"):
            file.write_bytes(b"xyz")
        assert extend.remembered(("numbers", 3), make)["size"] == 3
        # Objects have no name that lasts.
        assert extend.remembered((object(),), make)["size"] == 4
        assert len(list(tmp_path.glob("*.facts"))) == 2
        from warp._src.kernels.inspection import forget

        forget()
        assert list(tmp_path.glob("*.facts")) == []
    finally:
        wp.config.kernel_cache_dir = old
