"""Defaults of `symgen excite` that depend on other options."""

from runtime.cli.excite import harmonics_of, margin_of
from runtime.excitation.search.design_settings import DesignSettings


def test_defaults_depend_on_the_document_and_on_exports() -> None:
    """Property: the document keeps its 5 harmonics, exports leave 5 %, given values count."""
    assert (harmonics_of(None, False), harmonics_of(None, True)) == (8, DesignSettings().harmonics)
    assert (harmonics_of(0, True), harmonics_of(3, False)) == (0, 3)
    assert (margin_of(None, False), margin_of(None, True)) == (1.0, 0.95)
    assert (margin_of(0.0, True), margin_of(0.9, False)) == (0.0, 0.9)
