"""Universal Robots arms: reading their state, writing a payload, its form."""
