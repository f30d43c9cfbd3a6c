"""Identification of a payload: ten parameters of one body on an arm that is known."""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.identification.payload.body import Body, body_of, pi_of_body
    from runtime.identification.payload.estimate import identify_payload
    from runtime.identification.payload.identified_payload import Payload
    from runtime.identification.payload.known import (
        KnownPayload,
        read_known_payload,
        read_payload_facts,
    )
    from runtime.identification.payload.mount import Mount, mount_of
    from runtime.identification.payload.output import load_facts, write_payload
    from runtime.identification.payload.reading import ArmModel, arm_model, read_arm_model

__all__ = [
    "ArmModel",
    "Body",
    "KnownPayload",
    "Mount",
    "Payload",
    "arm_model",
    "body_of",
    "identify_payload",
    "load_facts",
    "mount_of",
    "pi_of_body",
    "read_arm_model",
    "read_known_payload",
    "read_payload_facts",
    "write_payload",
]

__getattr__ = lazy_names(
    __name__,
    {
        "ArmModel": "runtime.identification.payload.reading",
        "Body": "runtime.identification.payload.body",
        "KnownPayload": "runtime.identification.payload.known",
        "Mount": "runtime.identification.payload.mount",
        "Payload": "runtime.identification.payload.identified_payload",
        "arm_model": "runtime.identification.payload.reading",
        "body_of": "runtime.identification.payload.body",
        "identify_payload": "runtime.identification.payload.estimate",
        "load_facts": "runtime.identification.payload.output",
        "mount_of": "runtime.identification.payload.mount",
        "pi_of_body": "runtime.identification.payload.body",
        "read_arm_model": "runtime.identification.payload.reading",
        "read_known_payload": "runtime.identification.payload.known",
        "read_payload_facts": "runtime.identification.payload.known",
        "write_payload": "runtime.identification.payload.output",
    },
)
