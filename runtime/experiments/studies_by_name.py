"""Every id of the command line and the study that answers it."""

from runtime.errors import RuntimeFault
from runtime.experiments.studies import (
    appendix,
    bench,
    excitation,
    ideal,
    logs,
    methods,
    model,
    noise,
    sinusoid,
)
from runtime.experiments.study import Study

STUDIES: dict[str, Study] = {
    study.name: study
    for study in (
        excitation.STUDY,
        model.STUDY,
        ideal.STUDY,
        sinusoid.STUDY,
        noise.STUDY,
        logs.STUDY,
        bench.STUDY,
        methods.STUDY,
        appendix.STUDY,
    )
}
IDS: dict[str, Study] = {view.id: study for study in STUDIES.values() for view in study.views}


def study_of(name: str) -> Study:
    """By an id.

    Raises:
        RuntimeFault: there is no such id.
    """
    if name not in IDS:
        raise RuntimeFault(f"there is no experiment '{name}'; choose one of {', '.join(IDS)}")
    return IDS[name]
