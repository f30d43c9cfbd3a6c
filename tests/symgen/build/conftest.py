"""Ground of the tests of builds."""

import pytest

from symgen.build.objects import OFF


@pytest.fixture
def compiled_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Builds of this test, in processes of their own too, take no object of another build."""
    monkeypatch.setenv("SYMGEN_OBJECTS", OFF)
