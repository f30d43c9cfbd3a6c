"""Several logs in one fit: offsets per log, known payloads, validation by leaving a log out."""
