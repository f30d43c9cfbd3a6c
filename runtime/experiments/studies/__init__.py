"""Studies by name, and the study of every id of the command line.

A study is a `Study` of a module, and one line here.
"""

from runtime.errors import RuntimeFault
from runtime.experiments.studies import appendix, bench, excitation, logs, methods, model
from runtime.experiments.studies.monte_carlo import IDEAL, NOISE, OVER_DESIGNS, SINES
from runtime.experiments.study import Study

_MONTE_CARLO = (IDEAL, OVER_DESIGNS, SINES, NOISE)
_OTHERS = tuple(each.STUDY for each in (logs, bench, methods, appendix))
STUDIES: dict[str, Study] = {
    study.name: study for study in (excitation.STUDY, model.STUDY, *_MONTE_CARLO, *_OTHERS)
}
IDS: dict[str, Study] = {view.id: study for study in STUDIES.values() for view in study.views}


def study_of(name: str) -> Study:
    """Study of an id."""
    if name not in IDS:
        raise RuntimeFault(
            f"expected an experiment of {', '.join(IDS)}, got '{name}'; choose one of them"
        )
    return IDS[name]
