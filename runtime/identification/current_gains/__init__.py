"""Gains of motor currents from one log, up to a common factor or with a weighed mass."""
