"""From one or several logs to an identified robot."""
