"""Several logs in one fit: offsets per log, known payloads, validation by leaving a log out."""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.identification.several_logs.agreement import LeftOutLog, LogAgreement
    from runtime.identification.several_logs.identify import identify_logs
    from runtime.identification.several_logs.joint_fit import NamedLog, read_carried

__all__ = ["LeftOutLog", "LogAgreement", "NamedLog", "identify_logs", "read_carried"]

__getattr__ = lazy_names(
    __name__,
    {
        "LeftOutLog": "runtime.identification.several_logs.agreement",
        "LogAgreement": "runtime.identification.several_logs.agreement",
        "NamedLog": "runtime.identification.several_logs.joint_fit",
        "identify_logs": "runtime.identification.several_logs.identify",
        "read_carried": "runtime.identification.several_logs.joint_fit",
    },
)
