"""Values of options of `symgen excite` whose default depends on other options."""

from runtime.errors import RuntimeFault
from runtime.excitation import DesignSettings

HARMONICS = 8
"""Default number of harmonics: logs of virtual arms give smaller errors than with 5, and the same
as with 10 (`scripts/bench_excitation --designs`)."""
DOCUMENT_HARMONICS = DesignSettings().harmonics
"""That of the document's problem."""
EXPORT_MARGIN = 0.95
"""Default share of the limits that an exported motion uses."""

HARMONICS_HELP = (
    f"Number M of harmonics or splines per joint; default {HARMONICS}, with --document "
    f"{DOCUMENT_HARMONICS}."
)
MARGIN_HELP = (
    "Share of every limit that the motion may use, 0 to 1; distances and the box have margins in "
    f"m. Default {EXPORT_MARGIN:g} with --export, which leaves the rest to the robot's controller, "
    "else 1."
)


def harmonics_of(given: int | None, document: bool) -> int:
    """Number of harmonics of a design."""
    if given is not None:
        return given
    return DOCUMENT_HARMONICS if document else HARMONICS


def margin_of(given: float | None, is_exported: bool) -> float:
    """Share of every limit that a design may use."""
    if given is not None:
        return given
    return EXPORT_MARGIN if is_exported else 1.0


def require_plain(document: bool, options: tuple[object, ...]) -> None:
    """Refuse options of limits beside --document."""
    if document and any(option is not None for option in options):
        raise RuntimeFault(
            "--document excludes --torque-fraction, --table, --box, --clearance, --viscous, "
            "--coulomb, --carry, --obstacles, --from, --payload-band, --friction-band and "
            "--model-band; give --criterion cond instead, which keeps all limits"
        )
