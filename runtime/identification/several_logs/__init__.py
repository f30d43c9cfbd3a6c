"""Several logs in one fit: offsets per log, known payloads, validation by leaving a log out."""

from runtime.identification.several_logs.identify import LeftOutLog, LogAgreement, identify_logs
from runtime.identification.several_logs.joint_fit import NamedLog, read_carried

__all__ = ["LeftOutLog", "LogAgreement", "NamedLog", "identify_logs", "read_carried"]
