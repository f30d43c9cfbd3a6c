"""Defaults of `symgen excite` that depend on other options."""

from runtime.cli.excite_settings import ExciteSettings
from runtime.excitation.search.design_settings import DesignSettings


def test_defaults_depend_on_the_document_and_on_exports() -> None:
    """Property: the document keeps its 5 harmonics, exports leave 5 %, given values count."""
    usual, document = ExciteSettings(), ExciteSettings(document=True)
    assert (usual.functions, document.functions) == (8, DesignSettings().harmonics)
    assert ExciteSettings(harmonics=0, document=True).functions == 0
    assert ExciteSettings(harmonics=3).functions == 3
    assert (usual.share, ExciteSettings(export=["ros"]).share) == (1.0, 0.95)
    assert ExciteSettings(margin=0.0, export=["ros"]).share == 0.0
    assert ExciteSettings(margin=0.9).share == 0.9
