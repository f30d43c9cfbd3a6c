"""Code that both packages share: files, records, commands, errors; not about robots."""
