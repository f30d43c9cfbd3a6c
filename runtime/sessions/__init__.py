"""Several logs in one fit: offsets per log, known payloads, validation by leaving a log out."""

from runtime.sessions.joint import Session, read_carried
from runtime.sessions.study import Held, Study, identify_sessions

__all__ = ["Held", "Session", "Study", "identify_sessions", "read_carried"]
