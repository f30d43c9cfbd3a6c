"""Viscous friction that changes with the temperature of the joints, or with the time of operation.

    viscous_temperature (T − T_ref) dq · viscous_uptime t dq

Beside `viscous`, whose coefficient is then that at T_ref = 25 °C or at the start: oil and grease
become thinner as they warm up. T [°C] is the signal `temperature`. Where none is logged, t [h] is
the signal `uptime`, by default the time since the start of the log: warming up to first order. It
is a column of its own, because its coefficient belongs to one warm-up and not to the robot.
Source: Simoni, Beschi, Legnani & Visioli 2015; Gao, Yuan, Han, Wang & Wang 2017.
"""

from runtime.recording.settings import FrictionColumn

REFERENCE = 25.0  # T_ref [°C]
HOUR = 3600.0  # seconds of the unit of `viscous_uptime`


VISCOUS_TEMPERATURE = FrictionColumn(
    "viscous_temperature",
    f"(T − {REFERENCE:g} °C) dq",
    lambda motion, _: (motion.signals["temperature"] - REFERENCE) * motion.dq,
    signals=("temperature",),
    is_passive=False,
    omitted=f"viscous friction is that at {REFERENCE:g} °C",
)
VISCOUS_UPTIME = FrictionColumn(
    "viscous_uptime",
    "t dq, t in hours since the start of the log",
    lambda motion, _: motion.signals["uptime"] / HOUR * motion.dq,
    signals=("uptime",),
    is_passive=False,
    omitted="viscous friction is that at the start of the log",
)
