"""Plans of forms that tests choose."""

import pytest

from warp._src.fem.forms.form import Form


@pytest.fixture(params=["elements", "rows"])
def threads(request, monkeypatch):
    """Threads are elements, as on CPUs, or rows of elements, as on GPUs."""
    monkeypatch.setattr(Form, "has_many_threads", request.param == "rows")
    return request.param
