"""The document's experiments: one command per table and figure, each number with its provenance.

A study is run in chunks of trials and leaves in OUT/STUDY/ (OUT is results/experiments):

config.json       {config_hash, trials, config}: what the folder is of
chunks/A-B.parquet  finished trials A to B; what a kill leaves and the next run goes on from
trials.parquet    all of them, tidy: one row per case, method and trial, with the columns
                  case, method, status (text), trial (whole), consistent (bool) and figures, null
                  where they do not apply:
                  airm, frobenius, frobenius_rms (over n), base_error (%), smallest_eigenvalue
                  (relative), tau_error_1…n and tau_error (%, of the test motion, Eq. 5.1),
                  tau_rms_1…n (N·m), iterations, time_s, loss, gap, n_eff, and the study's own
series.npz        curves of the figures, by the names that the views name
result.json       written last; it vouches for the two files above by their sha256:
  format, study, title, robot, joints, model_hash, versions, command, trials, config, config_hash
  files           {"trials.parquet": sha256, "series.npz": sha256}
  cases, methods  name → a sentence, in the order of columns
  views           one per id: {id, kind, title, cases, metrics, series, axes, document}; kind is
                  table (cases × metrics), band (series iteration, mean, std), lines (x, then
                  curves (N,) or (N, n)), path ((N, 3) m), motion (t, q, dq, ddq, tau), loglog
                  (x, curve, reference), bars (cases × metrics, methods side by side)
  facts           what must be reported of the data: rates and counts, filters and delays, friction
                  columns, weights, torque RMS per joint, condition numbers with normalisation and
                  column set, seeds, choices that the document leaves open
  summary         [{case, method, metric, mean, std, n}]; std is None for one trial; the mean of
                  consistent is a share
  document        [{id, source, case, method, metric, mean, std}]: the document's own numbers

The hash covers config, seed, robot and what was taken from other studies, not the number of
trials. Same hash, same digits but for time_s, whatever the chunks, threads or cluster.
"""

from runtime.experiments.runner import DEFAULT_TRIALS, Request, reproduce
from runtime.experiments.storage.result_files import RESULT, valid_result
from runtime.experiments.studies_by_name import IDS, STUDIES, study_of
from runtime.experiments.study import Study, View
from runtime.experiments.study_state import state_of

__all__ = [
    "DEFAULT_TRIALS",
    "IDS",
    "RESULT",
    "STUDIES",
    "Request",
    "Study",
    "View",
    "reproduce",
    "state_of",
    "study_of",
    "valid_result",
]
