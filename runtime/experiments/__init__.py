"""Experiments of the document: one command per table and figure, with provenance.

A study is computed in chunks of trials and writes into OUT/STUDY/ (OUT is results/experiments):

config.json       {config_hash, trials, config} of the folder
chunks/A-B.parquet  finished trials A to B, from which an interrupted run continues
trials.parquet    all trials: one row per case, method and trial, with the columns case, method,
                  status (text), trial (integer), consistent (bool) and metrics, null where they
                  do not apply:
                  airm, frobenius, frobenius_rms (over n), base_error (%), smallest_eigenvalue
                  (relative), tau_error_1…n and tau_error (%, of the test motion, Eq. 5.1),
                  tau_rms_1…n (N·m), iterations, time_s, loss, gap, n_eff, and those of the study
series.npz        curves of the figures, by the names in the views
result.json       written last, with the SHA-256 of the two files above:
  format, study, title, robot, joints, model_hash, versions, command, trials, config, config_hash
  files           {"trials.parquet": sha256, "series.npz": sha256}
  cases, methods  name → a sentence, in the order of columns
  views           one per id: {id, kind, title, cases, metrics, series, axes, document}; kind is
                  table (cases × metrics), band (series iteration, mean, std), lines (x, then
                  curves (N,) or (N, n)), path ((N, 3) m), motion (t, q, dq, ddq, tau), loglog
                  (x, curve, reference), bars (cases × metrics, methods side by side)
  facts           facts of the data: rates and counts, filters and delays, friction
                  columns, weights, torque RMS per joint, condition numbers with normalisation and
                  column set, seeds, choices that the document leaves open
  summary         [{case, method, metric, mean, std, n}]; std is None for one trial; the mean of
                  consistent is a share
  document        [{id, source, case, method, metric, mean, std}]: numbers of the document

The hash covers config, seed, robot and the arrays of other studies, not the number of trials.
Equal hashes give equal digits except time_s, for any chunks, threads and cluster.
"""

from runtime.experiments.runner import DEFAULT_TRIALS, Request, reproduce, state_of
from runtime.experiments.storage import RESULT, valid_result
from runtime.experiments.studies import IDS, STUDIES, study_of
from runtime.experiments.study import Study, View

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
