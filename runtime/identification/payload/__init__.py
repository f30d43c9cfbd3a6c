"""Identification of a payload: ten parameters of one body on an arm that is known."""
