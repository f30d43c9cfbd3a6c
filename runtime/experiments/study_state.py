"""State of a study, read from its folder."""

from dataclasses import dataclass

from runtime.experiments.runner import Request, folder_hash, requested
from runtime.experiments.storage.chunks import Chunks
from runtime.experiments.storage.result_files import read_series, valid_result
from runtime.experiments.study import Arrays, Study, config_facts, config_hash
from runtime.library import Library

MISSING, PARTIAL, DONE, DIFFERS = "missing", "partial", "done", "hash differs"


@dataclass(frozen=True, slots=True)
class State:
    """State of one study in one folder.

    Attributes:
        word: missing, partial, done or hash differs.
        done: number of finished trials.
        trials: number of requested trials.
    """

    word: str
    done: int
    trials: int

    def __str__(self) -> str:
        if self.word in {MISSING, DIFFERS}:
            return self.word
        return f"{self.word} ({self.done} of {self.trials} trials)"


def state_of(lib: Library, study: Study, request: Request) -> State:
    """State of a study without computing anything.

    Args:
        lib: the robot.
        study: of which the folder is read.
        request: output folder, seed and number of trials.

    Returns:
        The state.
    """
    folder = request.out / study.name
    config, trials = requested(study, request)
    existing = folder_hash(folder)
    if existing is None:
        return State(MISSING, 0, trials)
    needed: Arrays = {}
    for name in study.needs:
        if valid_result(request.out / name) is None:
            return State(DIFFERS, 0, trials)
        needed = {**needed, **read_series(request.out / name)}
    mark = config_hash(config_facts(study, config, lib), lib.manifest.model_hash, needed)
    if existing != mark:
        return State(DIFFERS, 0, trials)
    result = valid_result(folder, mark)
    if result is not None and result["trials"] == trials:
        return State(DONE, trials, trials)
    done = len(Chunks(folder, mark, lambda _: None).read(trials))
    return State(PARTIAL, done, trials)
