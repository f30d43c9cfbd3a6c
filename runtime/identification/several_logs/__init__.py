"""Several logs in one fit: offsets per log, known payloads, validation by leaving a log out."""

from runtime.identification.several_logs.joint_fit import Session, read_carried
from runtime.identification.several_logs.study import Held, Study, identify_sessions

__all__ = ["Held", "Session", "Study", "identify_sessions", "read_carried"]
