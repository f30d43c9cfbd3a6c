"""Identification of a payload: ten parameters of one body on an arm that is known."""

from runtime.identification.payload.arm import ArmModel, arm_model, read_arm_model
from runtime.identification.payload.body import (
    Body,
    Mount,
    Payload,
    body_of,
    mount_of,
    pi_of_body,
)
from runtime.identification.payload.estimate import identify_payload
from runtime.identification.payload.known import (
    KnownPayload,
    read_known_payload,
    read_payload_facts,
)
from runtime.identification.payload.output import load_facts, write_payload

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
