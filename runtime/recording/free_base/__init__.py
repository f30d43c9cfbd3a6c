"""Recordings of robots with a free base."""

from runtime.recording.free_base.reading import free_base_of, read_free_base
from runtime.recording.free_base.recording import Contacts, FreeBaseRecording

__all__ = ["Contacts", "FreeBaseRecording", "free_base_of", "read_free_base"]
