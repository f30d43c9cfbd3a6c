"""The identified model at work: external torque, contacts, drift, models of the posterior."""
