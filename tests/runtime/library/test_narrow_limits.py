"""Searches with a small share of the limits."""

from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import information
from runtime.excitation.search.prediction import without_unseen
from runtime.excitation.search.single_start import Search
from runtime.library import Library


def test_a_search_in_narrow_limits_ends_inside(wrist: Library) -> None:
    """Property: with 3 % of the limits of dependent joints a start keeps the share before any
    repair, to 1 % of it (chords between samples of the grid); it ended far outside while the
    penalty counted whole limits.
    """
    plain = DesignSettings(margin=0.03, starts=1, duration=4.0, criterion="cond")
    settings, _, left = without_unseen(wrist, plain, information(wrist))
    assert left
    search = Search(wrist, settings)
    a = search.refined(search.start(0)[1])
    motion = search.limit_rows(2e-3, share=1.0)
    used = 1.0 + max(float(values.max()) for values in motion.by_constraint(a))
    assert 0.02 < used < 1.01 * 0.03
