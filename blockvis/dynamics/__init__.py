"""What follows the last equilibrium, by an engine that others keep; nothing static depends on it."""
